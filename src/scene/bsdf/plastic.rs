//! Smooth plastic: a dielectric coat over a diffuse base, with the light that is reflected back inside.

use std::sync::Arc;

use super::ior::{POLYPROPYLENE, relative_ior};
use super::{Bsdf, Whole, specular_share};
use crate::error::Result;
use crate::math::lanes::{Lanes, Lanes3};
use crate::math::{Rgb, fresnel};
use crate::scene::Surface;
use crate::scene::closure::{self, Closure};
use crate::scene::plugin::{Loader, Object, Plugin};
use crate::scene::texture::{Point, Texture};

/// `plastic`.
pub const PLUGIN: Plugin<Arc<dyn Bsdf>> = Plugin {
    name: "plastic",
    parameters: "int_ior = polypropylene, ext_ior = air, diffuse_reflectance = 0.5, specular_reflectance = 1, \
        nonlinear = false",
    make,
};

fn make(object: &Object, loader: &mut dyn Loader) -> Result<Arc<dyn Bsdf>> {
    let eta = relative_ior(object, POLYPROPYLENE)?;
    let base = Base::load(object, loader, eta, fresnel::dielectric_diffuse(1.0 / eta))?;
    Ok(Arc::new(Plastic { eta, base }))
}

/// Common part of smooth and rough plastic: the diffuse base under a coat, and the probabilities of sampling either.
pub struct Base {
    diffuse: Arc<dyn Texture>,
    specular: Arc<dyn Texture>,
    nonlinear: bool,
    /// Share of light from the base that the coat sends back to it.
    internal: f32,
    inverse_eta_squared: f32,
    /// Share of the coat in sampling where both are equally bright.
    specular_share: f32,
}

impl Base {
    /// Reads the two reflectances and `nonlinear`: whether the base's colour is saturated by each return.
    pub fn load(object: &Object, loader: &mut dyn Loader, eta: f32, internal: f32) -> Result<Self> {
        let diffuse = loader.texture(object, "diffuse_reflectance", Rgb::splat(0.5))?;
        let specular = loader.texture(object, "specular_reflectance", Rgb::ONE)?;
        let nonlinear = object.boolean("nonlinear", false)?;
        let specular_share = specular_share(&*diffuse, &*specular);
        Ok(Self { diffuse, specular, nonlinear, internal, inverse_eta_squared: 1.0 / (eta * eta), specular_share })
    }

    /// Colour of the coat's reflection.
    pub fn specular(&self, at: &Point) -> Rgb {
        self.specular.color(at)
    }

    /// Colour of the base with the light that the coat sends back to it, without the coat's transmittances.
    pub fn base(&self, at: &Point) -> Rgb {
        let color = self.diffuse.color(at);
        let returned = if self.nonlinear { color * self.internal } else { Rgb::splat(self.internal) };
        color / (Rgb::ONE - returned) * self.inverse_eta_squared
    }

    /// Share of the coat in sampling where both are equally bright.
    pub fn specular_share(&self) -> f32 {
        self.specular_share
    }

    /// Both reflectances.
    pub fn textures(&self) -> Vec<&dyn Texture> {
        vec![&*self.diffuse, &*self.specular]
    }

    /// The base's colour with the coat's white, as a feature.
    pub fn albedo(&self, surface: &Surface) -> Rgb {
        self.diffuse.color(&surface.at).clamp(Rgb::ZERO, Rgb::ONE)
    }
}

struct Plastic {
    eta: f32,
    base: Base,
}

impl Bsdf for Plastic {
    fn closure(&self, at: &Point, _surface: Whole) -> Option<Closure> {
        let [base, specular] = [self.base.base(at), self.base.specular(at)].map(Lanes3::splat);
        let [eta, share] = [self.eta, self.base.specular_share()].map(|value| Lanes([value]));
        Some(closure::Plastic { eta, base, specular, share }.closure(Some(f32::INFINITY)))
    }

    fn textures(&self) -> Vec<&dyn Texture> {
        self.base.textures()
    }

    fn albedo(&self, surface: &Surface) -> Rgb {
        self.base.albedo(surface)
    }
}
