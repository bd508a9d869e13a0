//! A surface that is not there.

use std::sync::Arc;

use super::{Bsdf, BsdfSample, Delta, Eval, Lobe};
use crate::error::Result;
use crate::math::{Rgb, Vec2, Vec3};
use crate::scene::Surface;
use crate::scene::plugin::{Loader, Object, Plugin};

/// `null`. Shadow rays do not see through it, as for `mask`.
pub const PLUGIN: Plugin<Arc<dyn Bsdf>> = Plugin { name: "null", parameters: "none", make };

fn make(_object: &Object, _loader: &mut dyn Loader) -> Result<Arc<dyn Bsdf>> {
    Ok(Arc::new(Null))
}

struct Null;

impl Bsdf for Null {
    fn sample(&self, _surface: &Surface, wi: Vec3, _lobe: f32, _u: Vec2) -> Option<BsdfSample> {
        Some(BsdfSample { wo: -wi, weight: Rgb::ONE, pdf: 1.0, lobe: Lobe::Null, eta: 1.0 })
    }

    fn eval(&self, _surface: &Surface, _wi: Vec3, _wo: Vec3) -> Eval {
        Eval::default()
    }

    fn delta(&self, _surface: &Surface, wi: Vec3, lobe: Lobe) -> Option<Delta> {
        (lobe == Lobe::Null).then_some(Delta { wo: -wi, value: Rgb::ONE, probability: 1.0 })
    }

    fn roughness(&self, _surface: &Surface) -> Option<f32> {
        None
    }

    fn albedo(&self, _surface: &Surface) -> Rgb {
        Rgb::ONE
    }

    fn transmits(&self) -> bool {
        true
    }
}
