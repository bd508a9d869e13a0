//! Rough diffuse surfaces (Oren and Nayar 1994), on the outside only.

use std::f32::consts::{FRAC_1_PI, PI};
use std::sync::Arc;

use super::{Bsdf, BsdfSample, Eval};
use crate::error::Result;
use crate::math::{Rgb, Vec2, Vec3, warp};
use crate::scene::Surface;
use crate::scene::plugin::{Loader, Object, Plugin};
use crate::scene::texture::Texture;

/// `roughdiffuse`.
pub const PLUGIN: Plugin<Arc<dyn Bsdf>> =
    Plugin { name: "roughdiffuse", parameters: "reflectance = 0.5, alpha = 0.2, use_fast_approx = false", make };

fn make(object: &Object, loader: &mut dyn Loader) -> Result<Arc<dyn Bsdf>> {
    let named = if object.get("reflectance").is_some() { "reflectance" } else { "diffuse_reflectance" };
    object.ignore(&["diffuse_reflectance"]);
    Ok(Arc::new(RoughDiffuse {
        reflectance: loader.texture(object, named, Rgb::splat(0.5))?,
        alpha: loader.texture(object, "alpha", Rgb::splat(0.2))?,
        fast: object.boolean("use_fast_approx", false)?,
    }))
}

struct RoughDiffuse {
    reflectance: Arc<dyn Texture>,
    /// Root mean square slope of the facets, times √2 as in Beckmann's convention.
    alpha: Arc<dyn Texture>,
    /// Without light that is reflected between facets, and with fewer terms.
    fast: bool,
}

/// A pair of directions as the model sees it: the steeper and the flatter one, and the cosine of their azimuths'
/// difference.
struct Geometry {
    /// Sine and angle of the direction that is further from the normal.
    steep: (f32, f32),
    /// Sine, angle and tangent of the other.
    flat: (f32, f32, f32),
    cos_azimuth: f32,
}

impl Geometry {
    fn new(wi: Vec3, wo: Vec3) -> Self {
        let sine = |w: Vec3| (1.0 - w.z * w.z).max(0.0).sqrt();
        let (si, so) = (sine(wi), sine(wo));
        let planar = wi.x * wo.x + wi.y * wo.y;
        let cos_azimuth = if si > 1e-4 && so > 1e-4 { (planar / (si * so)).clamp(-1.0, 1.0) } else { 0.0 };
        let (flat, steep) = if wi.z > wo.z { ((si, wi.z), (so, wo.z)) } else { ((so, wo.z), (si, wi.z)) };
        let angle = |cos: f32| cos.clamp(0.0, 1.0).acos();
        Self { steep: (steep.0, angle(steep.1)), flat: (flat.0, angle(flat.1), flat.0 / flat.1), cos_azimuth }
    }
}

impl RoughDiffuse {
    /// π f.
    fn reflected(&self, rho: Rgb, variance: f32, pair: &Geometry) -> Rgb {
        let Geometry { steep: (sin_a, a), flat: (sin_b, b, tan_b), cos_azimuth } = *pair;
        let c1 = 1.0 - 0.5 * variance / (variance + 0.33);
        let c2 = 0.45 * variance / (variance + 0.09);
        if self.fast {
            return rho * (c1 + c2 * cos_azimuth.max(0.0) * sin_a * tan_b);
        }
        let turned = 2.0 * b / PI;
        let c2 = c2 * if cos_azimuth > 0.0 { sin_a } else { sin_a - turned * turned * turned };
        let both = 4.0 * a * b / (PI * PI);
        let c3 = 0.125 * variance / (variance + 0.09) * both * both;
        let c4 = 0.17 * variance / (variance + 0.13);
        let cosine = |sine: f32| (1.0 - sine * sine).max(0.0).sqrt();
        let tan_half = (sin_a + sin_b) / (cosine(sin_a) + cosine(sin_b));
        let single = rho * (c1 + cos_azimuth * c2 * tan_b + (1.0 - cos_azimuth.abs()) * c3 * tan_half);
        single + rho * rho * (c4 * (1.0 - cos_azimuth * turned * turned))
    }
}

impl Bsdf for RoughDiffuse {
    fn sample(&self, surface: &Surface, wi: Vec3, _lobe: f32, u: Vec2) -> Option<BsdfSample> {
        let wo = warp::cosine_hemisphere(u);
        self.eval(surface, wi, wo).sampled(wo)
    }

    fn eval(&self, surface: &Surface, wi: Vec3, wo: Vec3) -> Eval {
        if wi.z <= 0.0 || wo.z <= 0.0 {
            return Eval::default();
        }
        let sigma = self.alpha.scalar(&surface.at).max(0.0);
        let reflected =
            self.reflected(self.reflectance.color(&surface.at), 0.5 * sigma * sigma, &Geometry::new(wi, wo));
        Eval { value: reflected * (FRAC_1_PI * wo.z), pdf: warp::cosine_hemisphere_pdf(wo.z) }
    }

    fn roughness(&self, _surface: &Surface) -> Option<f32> {
        Some(f32::INFINITY)
    }

    fn albedo(&self, surface: &Surface) -> Rgb {
        self.reflectance.color(&surface.at).clamp(Rgb::ZERO, Rgb::ONE)
    }
}
