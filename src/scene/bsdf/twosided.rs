//! A material that looks the same from behind, or a second one for the back.

use std::sync::Arc;

use super::{Bsdf, BsdfSample, Delta, Eval, Lobe, Whole, mirror};
use crate::error::Result;
use crate::math::{Rgb, Vec2, Vec3};
use crate::scene::Surface;
use crate::scene::closure::Closure;
use crate::scene::plugin::{Loader, Object, Plugin};
use crate::scene::texture::{Point, Texture};

/// `twosided`.
pub const PLUGIN: Plugin<Arc<dyn Bsdf>> =
    Plugin { name: "twosided", parameters: "one or two nested bsdfs without transmission", make };

fn make(object: &Object, loader: &mut dyn Loader) -> Result<Arc<dyn Bsdf>> {
    let nested = loader.nested_bsdfs(object)?;
    if nested.iter().any(|bsdf| bsdf.transmits()) {
        return Err(object.loc.invalid("`twosided` around a bsdf that transmits light; nest it the other way round"));
    }
    match nested.as_slice() {
        [both] => Ok(Arc::new(TwoSided { front: Arc::clone(both), back: Arc::clone(both) })),
        [front, back] => Ok(Arc::new(TwoSided { front: Arc::clone(front), back: Arc::clone(back) })),
        other => Err(object.loc.invalid(format!("`twosided` needs one or two nested bsdfs, not {}", other.len()))),
    }
}

struct TwoSided {
    front: Arc<dyn Bsdf>,
    back: Arc<dyn Bsdf>,
}

impl TwoSided {
    fn side(&self, wi: Vec3) -> &dyn Bsdf {
        if wi.z >= 0.0 { &*self.front } else { &*self.back }
    }
}

impl Bsdf for TwoSided {
    fn closure(&self, at: &Point, surface: Whole) -> Option<Closure> {
        let same = Arc::ptr_eq(&self.front, &self.back);
        self.front.closure(at, surface).filter(|_| same)?.on_both_sides()
    }

    fn textures(&self) -> Vec<&dyn Texture> {
        self.front.textures()
    }

    fn sample(&self, surface: &Surface, wi: Vec3, lobe: f32, u: Vec2) -> Option<BsdfSample> {
        if wi.z >= 0.0 {
            return self.front.sample(surface, wi, lobe, u);
        }
        let sample = self.back.sample(surface, mirror(wi), lobe, u)?;
        Some(BsdfSample { wo: mirror(sample.wo), ..sample })
    }

    fn eval(&self, surface: &Surface, wi: Vec3, wo: Vec3) -> Eval {
        if wi.z >= 0.0 {
            return self.front.eval(surface, wi, wo);
        }
        self.back.eval(surface, mirror(wi), mirror(wo))
    }

    fn delta(&self, surface: &Surface, wi: Vec3, lobe: Lobe) -> Option<Delta> {
        if wi.z >= 0.0 {
            return self.front.delta(surface, wi, lobe);
        }
        let delta = self.back.delta(surface, mirror(wi), lobe)?;
        Some(Delta { wo: mirror(delta.wo), ..delta })
    }

    fn roughness(&self, surface: &Surface) -> Option<f32> {
        self.side(surface.wi).roughness(surface)
    }

    fn albedo(&self, surface: &Surface) -> Rgb {
        self.side(surface.wi).albedo(surface)
    }

    fn needs_derivatives(&self) -> bool {
        self.front.needs_derivatives() || self.back.needs_derivatives()
    }
}
