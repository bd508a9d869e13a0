//! The modified Phong model (Lafortune and Willems 1994), on the outside only.

use std::f32::consts::{FRAC_1_PI, TAU};
use std::sync::Arc;

use super::{Bsdf, BsdfSample, Eval, are_above, specular_or_diffuse, specular_share};
use crate::error::Result;
use crate::math::{Frame, Rgb, Vec2, Vec3, fresnel, luminance, vec3, warp};
use crate::scene::Surface;
use crate::scene::plugin::{Loader, Object, Plugin};
use crate::scene::texture::Texture;

/// `phong`.
pub const PLUGIN: Plugin<Arc<dyn Bsdf>> =
    Plugin { name: "phong", parameters: "exponent = 30, specular_reflectance = 0.2, diffuse_reflectance = 0.5", make };

fn make(object: &Object, loader: &mut dyn Loader) -> Result<Arc<dyn Bsdf>> {
    let exponent = loader.texture(object, "exponent", Rgb::splat(30.0))?;
    Ok(Arc::new(Phong { exponent, pair: Pair::load(object, loader)? }))
}

/// A diffuse and a specular reflectance, of which no channel exceeds one in sum.
pub struct Pair {
    diffuse: Arc<dyn Texture>,
    specular: Arc<dyn Texture>,
    scale: f32,
    /// Share of the specular lobe in sampling.
    pub specular_share: f32,
}

impl Pair {
    /// Reads both; if together they would reflect more light than there is, both are made darker.
    pub fn load(object: &Object, loader: &mut dyn Loader) -> Result<Self> {
        let diffuse = loader.texture(object, "diffuse_reflectance", Rgb::splat(0.5))?;
        let specular = loader.texture(object, "specular_reflectance", Rgb::splat(0.2))?;
        let largest = (diffuse.largest() + specular.largest()).max_element();
        let scale = if largest > 1.0 { 0.99 / largest } else { 1.0 };
        let specular_share = specular_share(&*diffuse, &*specular);
        Ok(Self { diffuse, specular, scale, specular_share })
    }

    /// The diffuse and the specular reflectance.
    pub fn at(&self, surface: &Surface) -> (Rgb, Rgb) {
        (self.diffuse.color(&surface.at) * self.scale, self.specular.color(&surface.at) * self.scale)
    }

    /// f |cos θo| and density, from those of the specular lobe of reflectance one.
    pub fn eval(&self, surface: &Surface, cos_o: f32, specular: f32, specular_pdf: f32) -> Eval {
        let (kd, ks) = self.at(surface);
        let diffuse_pdf = warp::cosine_hemisphere_pdf(cos_o);
        Eval {
            value: kd * (FRAC_1_PI * cos_o) + ks * specular,
            pdf: self.specular_share * specular_pdf + (1.0 - self.specular_share) * diffuse_pdf,
        }
    }

    /// Both reflectances together.
    pub fn albedo(&self, surface: &Surface) -> Rgb {
        let (kd, ks) = self.at(surface);
        (kd + ks).clamp(Rgb::ZERO, Rgb::ONE)
    }
}

struct Phong {
    exponent: Arc<dyn Texture>,
    pair: Pair,
}

impl Phong {
    fn exponent(&self, surface: &Surface) -> f32 {
        self.exponent.scalar(&surface.at).max(0.0)
    }
}

impl Bsdf for Phong {
    fn sample(&self, surface: &Surface, wi: Vec3, lobe: f32, u: Vec2) -> Option<BsdfSample> {
        let wo = specular_or_diffuse(wi, (lobe, self.pair.specular_share), u, || {
            let cos = u.y.powf(1.0 / (self.exponent(surface) + 1.0));
            let (sin, (y, x)) = ((1.0 - cos * cos).max(0.0).sqrt(), (TAU * u.x).sin_cos());
            Frame::around(fresnel::reflect(wi)).to_world(vec3(x * sin, y * sin, cos))
        })?;
        self.eval(surface, wi, wo).sampled(wo)
    }

    fn eval(&self, surface: &Surface, wi: Vec3, wo: Vec3) -> Eval {
        if !are_above(wi, wo) {
            return Eval::default();
        }
        let n = self.exponent(surface);
        let power = fresnel::reflect(wi).dot(wo).max(0.0).powf(n);
        self.pair.eval(surface, wo.z, (n + 2.0) / TAU * power * wo.z, (n + 1.0) / TAU * power)
    }

    /// The roughness of a microfacet surface with as wide a lobe (Walter et al. 2007).
    fn roughness(&self, surface: &Surface) -> Option<f32> {
        let (_, specular) = self.pair.at(surface);
        let alpha = (2.0 / (self.exponent(surface) + 2.0)).sqrt();
        Some(if luminance(specular) > 0.0 { alpha } else { f32::INFINITY })
    }

    fn albedo(&self, surface: &Surface) -> Rgb {
        self.pair.albedo(surface)
    }
}
