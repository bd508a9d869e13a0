//! Smooth plastic: a dielectric coat over a diffuse base, with the light that is reflected back inside.

use std::f32::consts::FRAC_1_PI;
use std::sync::Arc;

use super::{Bsdf, BsdfSample, Delta, Eval, Lobe, POLYPROPYLENE, relative_ior, specular_share};
use crate::error::Result;
use crate::math::{Rgb, Vec2, Vec3, fresnel, warp};
use crate::scene::Surface;
use crate::scene::load::props::Object;
use crate::scene::load::{Loader, Plugin};
use crate::scene::texture::Texture;

/// `plastic`.
pub const PLUGIN: Plugin<Arc<dyn Bsdf>> = Plugin {
    name: "plastic",
    parameters: "int_ior = polypropylene, ext_ior = air, diffuse_reflectance = 0.5, specular_reflectance = 1, \
        nonlinear = false",
    make,
};

fn make(object: &Object, loader: &mut Loader) -> Result<Arc<dyn Bsdf>> {
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
    pub fn load(object: &Object, loader: &mut Loader, eta: f32, internal: f32) -> Result<Self> {
        let diffuse = loader.texture(object, "diffuse_reflectance", Rgb::splat(0.5))?;
        let specular = loader.texture(object, "specular_reflectance", Rgb::ONE)?;
        let nonlinear = object.boolean("nonlinear", false)?;
        let specular_share = specular_share(&*diffuse, &*specular);
        Ok(Self { diffuse, specular, nonlinear, internal, inverse_eta_squared: 1.0 / (eta * eta), specular_share })
    }

    /// Colour of the coat's reflection.
    pub fn specular(&self, surface: &Surface) -> Rgb {
        self.specular.color(&surface.at)
    }

    /// f |cos θo| of the base, for transmitted shares `t` of the coat in both directions together.
    pub fn value(&self, surface: &Surface, cos_o: f32, t: f32) -> Rgb {
        let color = self.diffuse.color(&surface.at);
        let returned = if self.nonlinear { color * self.internal } else { Rgb::splat(self.internal) };
        color / (Rgb::ONE - returned) * (FRAC_1_PI * cos_o * self.inverse_eta_squared * t)
    }

    /// Probability of sampling the coat where it reflects the share `reflectance`.
    pub fn coat_probability(&self, reflectance: f32) -> f32 {
        let coat = reflectance * self.specular_share;
        let base = (1.0 - reflectance) * (1.0 - self.specular_share);
        if coat + base > 0.0 { coat / (coat + base) } else { 1.0 }
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

impl Plastic {
    fn reflectance(&self, cos: f32) -> f32 {
        fresnel::dielectric(cos, self.eta).reflectance
    }
}

impl Bsdf for Plastic {
    fn sample(&self, surface: &Surface, wi: Vec3, lobe: f32, u: Vec2) -> Option<BsdfSample> {
        if wi.z <= 0.0 {
            return None;
        }
        if lobe < self.base.coat_probability(self.reflectance(wi.z)) {
            let Delta { wo, value, probability } = self.delta(surface, wi, Lobe::DeltaReflect)?;
            let weight = value / probability;
            return Some(BsdfSample { wo, weight, pdf: probability, lobe: Lobe::DeltaReflect, eta: 1.0 });
        }
        let wo = warp::cosine_hemisphere(u);
        self.eval(surface, wi, wo).sampled(wo)
    }

    fn eval(&self, surface: &Surface, wi: Vec3, wo: Vec3) -> Eval {
        if wi.z <= 0.0 || wo.z <= 0.0 {
            return Eval::default();
        }
        let (ri, ro) = (self.reflectance(wi.z), self.reflectance(wo.z));
        let value = self.base.value(surface, wo.z, (1.0 - ri) * (1.0 - ro));
        Eval { value, pdf: (1.0 - self.base.coat_probability(ri)) * warp::cosine_hemisphere_pdf(wo.z) }
    }

    fn delta(&self, surface: &Surface, wi: Vec3, lobe: Lobe) -> Option<Delta> {
        if wi.z <= 0.0 || lobe != Lobe::DeltaReflect {
            return None;
        }
        let reflectance = self.reflectance(wi.z);
        let value = self.base.specular(surface) * reflectance;
        let probability = self.base.coat_probability(reflectance);
        (probability > 0.0).then_some(Delta { wo: fresnel::reflect(wi), value, probability })
    }

    fn roughness(&self, _surface: &Surface) -> Option<f32> {
        Some(f32::INFINITY)
    }

    fn albedo(&self, surface: &Surface) -> Rgb {
        self.base.albedo(surface)
    }
}
