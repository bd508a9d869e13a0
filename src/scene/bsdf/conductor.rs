//! Smooth metal, on the outside only.

use std::sync::Arc;

use super::{Bsdf, BsdfSample, Delta, Eval, Lobe};
use crate::error::Result;
use crate::math::{Rgb, Vec2, Vec3, fresnel, vec3};
use crate::scene::Surface;
use crate::scene::load::props::Object;
use crate::scene::load::{Loader, Plugin};
use crate::scene::texture::Texture;

/// `conductor`.
pub const PLUGIN: Plugin<Arc<dyn Bsdf>> =
    Plugin { name: "conductor", parameters: "material, eta, k, specular_reflectance", make };

fn make(object: &Object, loader: &mut Loader) -> Result<Arc<dyn Bsdf>> {
    Ok(Arc::new(Conductor { metal: Metal::load(object, loader)? }))
}

/// Complex index of refraction and a factor on the reflectance.
pub struct Metal {
    eta: Rgb,
    k: Rgb,
    reflectance: Arc<dyn Texture>,
}

/// Metals by name: eta and k of linear sRGB, integrated from measured spectra (SOPRA database).
const METALS: &[(&str, [f32; 3], [f32; 3])] = &[
    ("none", [0.0; 3], [1.0; 3]),
    ("Al", [1.65750, 0.88040, 0.52124], [9.22381, 6.26950, 4.83700]),
    ("Ag", [0.15528, 0.11673, 0.13839], [4.82835, 3.12222, 2.14690]),
    ("Au", [0.14304, 0.37531, 1.44205], [3.98300, 2.38556, 1.60336]),
    ("Cu", [0.20101, 0.92375, 1.10222], [3.91326, 2.45305, 2.14209]),
    ("Cr", [4.36967, 2.91651, 1.65490], [5.20655, 4.23131, 3.75470]),
    ("W", [4.37082, 3.30025, 2.99841], [3.50064, 2.60487, 2.27323]),
    ("Hg", [2.39894, 1.44003, 0.90957], [6.32759, 4.37192, 3.42176]),
];

impl Metal {
    /// From `material`, or from `eta` and `k`.
    pub fn load(object: &Object, loader: &mut Loader) -> Result<Self> {
        let names: Vec<_> = METALS.iter().map(|(name, ..)| *name).collect();
        let (_, eta, k) = METALS[object.choice("material", &names, 0)?];
        let eta = object.color("eta", Rgb::from_array(eta))?;
        let k = object.color("k", Rgb::from_array(k))?;
        Ok(Self { eta, k, reflectance: loader.texture(object, "specular_reflectance", Rgb::ONE)? })
    }

    /// Reflectance at a cosine.
    pub fn reflectance(&self, surface: &Surface, cos: f32) -> Rgb {
        fresnel::conductor(cos, self.eta, self.k) * self.reflectance.color(surface.uv)
    }
}

struct Conductor {
    metal: Metal,
}

impl Bsdf for Conductor {
    fn sample(&self, surface: &Surface, wi: Vec3, _lobe: f32, _u: Vec2) -> Option<BsdfSample> {
        let Delta { wo, value, .. } = self.delta(surface, wi, Lobe::DeltaReflect)?;
        Some(BsdfSample { wo, weight: value, pdf: 1.0, lobe: Lobe::DeltaReflect, eta: 1.0 })
    }

    fn eval(&self, _surface: &Surface, _wi: Vec3, _wo: Vec3) -> Eval {
        Eval::default()
    }

    fn delta(&self, surface: &Surface, wi: Vec3, lobe: Lobe) -> Option<Delta> {
        let happens = wi.z > 0.0 && lobe == Lobe::DeltaReflect;
        happens.then(|| Delta {
            wo: fresnel::reflect(wi),
            value: self.metal.reflectance(surface, wi.z),
            probability: 1.0,
        })
    }

    fn roughness(&self, _surface: &Surface) -> Option<f32> {
        None
    }

    fn albedo(&self, surface: &Surface) -> Rgb {
        self.metal.reflectance(surface, 1.0).clamp(vec3(0.0, 0.0, 0.0), Rgb::ONE)
    }
}
