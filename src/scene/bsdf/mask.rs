//! A material with holes: where it is not opaque, light goes straight through.

use std::sync::Arc;

use super::{Bsdf, BsdfSample, Delta, Eval, Lobe, Whole};
use crate::error::Result;
use crate::math::{Rgb, Vec2, Vec3};
use crate::scene::Surface;
use crate::scene::closure::Closure;
use crate::scene::plugin::{Loader, Object, Plugin};
use crate::scene::texture::{Point, Texture};

/// `mask`. Shadow rays do not pass it: emitters behind it are hit by the paths that do.
pub const PLUGIN: Plugin<Arc<dyn Bsdf>> = Plugin { name: "mask", parameters: "opacity = 0.5, one nested bsdf", make };

fn make(object: &Object, loader: &mut dyn Loader) -> Result<Arc<dyn Bsdf>> {
    let opacity = loader.texture(object, "opacity", Rgb::splat(0.5))?;
    Ok(Arc::new(Masked { opacity, nested: loader.nested_bsdf(object)? }))
}

struct Masked {
    opacity: Arc<dyn Texture>,
    nested: Arc<dyn Bsdf>,
}

impl Masked {
    fn opacity(&self, surface: &Surface) -> f32 {
        self.opacity.scalar(&surface.at).clamp(0.0, 1.0)
    }
}

impl Bsdf for Masked {
    fn closure(&self, at: &Point, surface: Whole) -> Option<Closure> {
        self.nested.closure(at, surface)?.with_holes(self.opacity.scalar(at).clamp(0.0, 1.0))
    }

    fn textures(&self) -> Vec<&dyn Texture> {
        self.nested.textures().into_iter().chain([&*self.opacity]).collect()
    }

    fn sample(&self, surface: &Surface, wi: Vec3, lobe: f32, u: Vec2) -> Option<BsdfSample> {
        let opacity = self.opacity(surface);
        if lobe < opacity {
            let sample = self.nested.sample(surface, wi, lobe / opacity, u)?;
            if sample.lobe != Lobe::Null {
                return Some(BsdfSample { pdf: sample.pdf * opacity, ..sample });
            }
        }
        // Through a hole or through the nested material: the same direction.
        let Delta { wo, value, probability } = self.delta(surface, wi, Lobe::Null)?;
        Some(BsdfSample { wo, weight: value / probability, pdf: probability, lobe: Lobe::Null, eta: 1.0 })
    }

    fn eval(&self, surface: &Surface, wi: Vec3, wo: Vec3) -> Eval {
        let opacity = self.opacity(surface);
        let Eval { value, pdf } = self.nested.eval(surface, wi, wo);
        Eval { value: value * opacity, pdf: pdf * opacity }
    }

    fn delta(&self, surface: &Surface, wi: Vec3, lobe: Lobe) -> Option<Delta> {
        let opacity = self.opacity(surface);
        let nested = self.nested.delta(surface, wi, lobe).filter(|_| opacity > 0.0);
        let nested = nested.map(|delta| (delta.wo, delta.value * opacity, delta.probability * opacity));
        let hole = if lobe == Lobe::Null { 1.0 - opacity } else { 0.0 };
        let (wo, value, probability) = nested.unwrap_or((-wi, Rgb::ZERO, 0.0));
        let (value, probability) = (value + hole, probability + hole);
        (probability > 0.0).then_some(Delta { wo, value, probability })
    }

    fn roughness(&self, surface: &Surface) -> Option<f32> {
        self.nested.roughness(surface).filter(|_| self.opacity(surface) > 0.0)
    }

    fn albedo(&self, surface: &Surface) -> Rgb {
        self.nested.albedo(surface)
    }

    fn transmits(&self) -> bool {
        true
    }

    fn refraction(&self) -> Option<f32> {
        self.nested.refraction()
    }

    fn needs_derivatives(&self) -> bool {
        self.nested.needs_derivatives()
    }
}
