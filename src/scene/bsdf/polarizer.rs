//! Filters of polarised light, for light that is not: they let a share of it pass straight through.

use std::sync::Arc;

use super::{Bsdf, BsdfSample, Delta, Eval, Lobe};
use crate::error::Result;
use crate::math::{Rgb, Vec2, Vec3};
use crate::scene::Surface;
use crate::scene::plugin::{Loader, Object, Plugin};
use crate::scene::texture::Texture;

/// `polarizer`.
pub const LINEAR: Plugin<Arc<dyn Bsdf>> = Plugin {
    name: "polarizer",
    parameters: "transmittance = 1, of which half passes; theta, polarizing (ignored)",
    make: make_polarizer,
};

/// `circular`.
pub const CIRCULAR: Plugin<Arc<dyn Bsdf>> = Plugin {
    name: "circular",
    parameters: "transmittance = 1, of which half passes; theta, left_handed (ignored)",
    make: make_polarizer,
};

/// `retarder`.
pub const RETARDER: Plugin<Arc<dyn Bsdf>> =
    Plugin { name: "retarder", parameters: "transmittance = 1; theta, delta (ignored)", make: make_retarder };

fn make_polarizer(object: &Object, loader: &mut dyn Loader) -> Result<Arc<dyn Bsdf>> {
    make(object, loader, 0.5)
}

fn make_retarder(object: &Object, loader: &mut dyn Loader) -> Result<Arc<dyn Bsdf>> {
    make(object, loader, 1.0)
}

fn make(object: &Object, loader: &mut dyn Loader, share: f32) -> Result<Arc<dyn Bsdf>> {
    object.ignore(&["theta", "polarizing", "left_handed", "delta"]);
    Ok(Arc::new(Filter { transmittance: loader.texture(object, "transmittance", Rgb::ONE)?, share }))
}

struct Filter {
    transmittance: Arc<dyn Texture>,
    share: f32,
}

impl Bsdf for Filter {
    fn sample(&self, surface: &Surface, wi: Vec3, _lobe: f32, _u: Vec2) -> Option<BsdfSample> {
        let Delta { wo, value, probability } = self.delta(surface, wi, Lobe::Null)?;
        Some(BsdfSample { wo, weight: value, pdf: probability, lobe: Lobe::Null, eta: 1.0 })
    }

    fn eval(&self, _surface: &Surface, _wi: Vec3, _wo: Vec3) -> Eval {
        Eval::default()
    }

    fn delta(&self, surface: &Surface, wi: Vec3, lobe: Lobe) -> Option<Delta> {
        let value = self.transmittance.color(&surface.at) * self.share;
        (lobe == Lobe::Null).then_some(Delta { wo: -wi, value, probability: 1.0 })
    }

    fn roughness(&self, _surface: &Surface) -> Option<f32> {
        None
    }

    fn albedo(&self, surface: &Surface) -> Rgb {
        (self.transmittance.color(&surface.at) * self.share).clamp(Rgb::ZERO, Rgb::ONE)
    }

    fn transmits(&self) -> bool {
        true
    }
}
