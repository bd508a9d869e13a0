//! Rough plastic: a rough dielectric coat over a diffuse base.

use std::sync::Arc;

use super::ior::{POLYPROPYLENE, relative_ior};
use super::microfacet::{Kind, Microfacet, RoughTransmittance};
use super::plastic::Base;
use super::{Bsdf, Whole};
use crate::error::Result;
use crate::math::Rgb;
use crate::math::lanes::{Lanes, Lanes3};
use crate::scene::Surface;
use crate::scene::closure::{self, Closure};
use crate::scene::plugin::{Loader, Object, Plugin};
use crate::scene::texture::{Point, Texture};

/// `roughplastic`.
pub const PLUGIN: Plugin<Arc<dyn Bsdf>> = Plugin {
    name: "roughplastic",
    parameters: "int_ior = polypropylene, ext_ior = air, diffuse_reflectance = 0.5, specular_reflectance = 1, \
        nonlinear = false, alpha = 0.1, distribution = beckmann (ggx), sample_visible (ignored)",
    make,
};

fn make(object: &Object, loader: &mut dyn Loader) -> Result<Arc<dyn Bsdf>> {
    // Visible normals are always sampled.
    object.ignore(&["sample_visible"]);
    let eta = relative_ior(object, POLYPROPYLENE)?;
    if eta <= 1.0 {
        return Err(object.loc.unsupported("roughplastic with an interior no denser than its exterior"));
    }
    let facets = Microfacet::new(Kind::load(object, loader)?, object.float("alpha", 0.1)?);
    let transmittance = RoughTransmittance::new(facets, eta);
    let base = Base::load(object, loader, eta, transmittance.internal)?;
    Ok(Arc::new(RoughPlastic { eta, facets, transmittance, base }))
}

struct RoughPlastic {
    eta: f32,
    facets: Microfacet,
    transmittance: RoughTransmittance,
    base: Base,
}

impl Bsdf for RoughPlastic {
    fn closure(&self, at: &Point, _surface: Whole) -> Option<Closure> {
        let [base, specular] = [self.base.base(at), self.base.specular(at)].map(Lanes3::splat);
        let [eta, share] = [self.eta, self.base.specular_share()].map(|value| Lanes([value]));
        let (facets, transmittance) = (self.facets.facets(), self.transmittance.series());
        let lobes = closure::RoughPlastic { eta, base, specular, share, facets, transmittance };
        Some(lobes.closure(Some(self.facets.smallest())))
    }

    fn textures(&self) -> Vec<&dyn Texture> {
        self.base.textures()
    }

    fn albedo(&self, surface: &Surface) -> Rgb {
        self.base.albedo(surface)
    }
}
