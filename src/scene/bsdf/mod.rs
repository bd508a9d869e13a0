//! Materials. Directions are local (the shading normal is +z) and point away from the surface; `wi` is where the
//! path came from, `wo` where it goes.

mod blendbsdf;
mod bumpmap;
mod coating;
mod conductor;
mod dielectric;
mod diffuse;
mod ior;
mod mask;
mod metals;
pub mod microfacet;
mod normalmap;
mod null;
mod perturbed;
mod phong;
mod plastic;
mod plugins;
mod polarizer;
mod pplastic;
mod principled;
mod roughconductor;
mod roughdielectric;
mod roughdiffuse;
mod roughplastic;
mod thindielectric;
mod twosided;
mod ward;

pub use self::plugins::{PLUGINS, default};
pub use super::closure::{BsdfSample, Delta, Eval, Lobe};

use super::Surface;
use super::closure::Closure;
use super::texture::{Point, Texture};
use crate::math::{Rgb, Vec2, Vec3, vec3, warp};

/// Whether both directions are on the side of a surface that reflects.
fn are_above(wi: Vec3, wo: Vec3) -> bool {
    wi.z > 0.0 && wo.z > 0.0
}

/// A direction of a specular lobe, if the random number `lobe` is below its share, or of a diffuse one; none from behind.
fn specular_or_diffuse(wi: Vec3, (lobe, share): (f32, f32), u: Vec2, specular: impl FnOnce() -> Vec3) -> Option<Vec3> {
    (wi.z > 0.0).then(|| if lobe < share { specular() } else { warp::cosine_hemisphere(u) })
}

/// Share of a specular lobe in sampling beside a diffuse one, by their mean reflectances.
fn specular_share(diffuse: &dyn Texture, specular: &dyn Texture) -> f32 {
    let total = diffuse.mean() + specular.mean();
    if total > 0.0 { specular.mean() / total } else { 0.5 }
}

/// A surface that is put together only where a material asks for more than its texture coordinates.
pub type Whole<'a> = &'a dyn Fn() -> Surface;

/// Scattering at a surface. A material says either what its closure is or, if it has none, how it scatters.
pub trait Bsdf: Send + Sync {
    /// The material at a surface, if it is one of the [kinds](crate::scene::closure::Kind) that packets evaluate. It has one
    /// everywhere or nowhere; where one is missing all the same, the material is asked as if it had none.
    fn closure(&self, _at: &Point, _surface: Whole) -> Option<Closure> {
        None
    }

    /// Everything that the closure looks up.
    fn textures(&self) -> Vec<&dyn Texture> {
        Vec::new()
    }

    /// Has everything that the closure looks up at a point brought into the cache.
    fn prefetch(&self, at: &Point) {
        self.textures().into_iter().for_each(|texture| texture.prefetch(at));
    }

    /// Draws a direction from the lobe number `lobe` in [0, 1) and `u`. `None` absorbs.
    fn sample(&self, surface: &Surface, wi: Vec3, lobe: f32, u: Vec2) -> Option<BsdfSample> {
        self.closure(&surface.at, &|| *surface)?.sample_one(wi, lobe, u)
    }

    /// The smooth lobes.
    fn eval(&self, surface: &Surface, wi: Vec3, wo: Vec3) -> Eval {
        self.closure(&surface.at, &|| *surface).map_or_else(Eval::default, |closure| closure.eval_one(wi, wo))
    }

    /// Scattering by a delta lobe; `None` if the material has none, or if it does not scatter `wi`.
    fn delta(&self, surface: &Surface, wi: Vec3, lobe: Lobe) -> Option<Delta> {
        self.closure(&surface.at, &|| *surface)?.delta(wi, lobe)
    }

    /// Smallest roughness (Beckmann or GGX alpha) of the smooth lobes, infinite for diffuse ones; `None` without
    /// smooth lobes.
    fn roughness(&self, surface: &Surface) -> Option<f32> {
        self.closure(&surface.at, &|| *surface)?.roughness_of_one()
    }

    /// Overall colour in [0, 1], the same from everywhere: the albedo feature.
    fn albedo(&self, surface: &Surface) -> Rgb;

    /// Whether light can pass to the other side.
    fn transmits(&self) -> bool {
        false
    }

    /// Interior over exterior index of refraction of the smooth lobes that refract, if there are such.
    fn refraction(&self) -> Option<f32> {
        None
    }

    /// Whether surfaces need dp_du and dp_dv.
    fn needs_derivatives(&self) -> bool {
        false
    }
}

/// A local direction seen from the other side of the surface.
fn mirror(w: Vec3) -> Vec3 {
    vec3(w.x, w.y, -w.z)
}
