//! A material whose shading normal is perturbed by a texture: the common part of bump maps and normal maps.

use std::sync::Arc;

use super::{Bsdf, BsdfSample, Delta, Eval, Lobe};
use crate::error::Result;
use crate::math::{Frame, Rgb, Vec2, Vec3, vec3};
use crate::scene::Surface;
use crate::scene::load::Loader;
use crate::scene::load::props::Object;

/// Source of the perturbed normal.
pub trait NormalMap: Send + Sync {
    /// The perturbed normal in the shading frame, of length one.
    fn normal(&self, surface: &Surface) -> Vec3;
}

/// The nested material under perturbed normals.
pub struct Perturbed<B> {
    map: B,
    /// Mirror a perturbed normal that faces away from the viewer.
    flip_invalid: bool,
    /// Attenuate directions that the bumps would shadow, where the perturbed normal would otherwise cut light off.
    shadowing: bool,
    nested: Arc<dyn Bsdf>,
}

/// The perturbed frame, in coordinates of the unperturbed one.
struct BentFrame {
    frame: Frame,
    shadow_alpha2: f32,
}

impl<B: NormalMap> Perturbed<B> {
    /// Reads the parameters that all perturbed materials share.
    pub fn load(object: &Object, loader: &mut Loader, map: B) -> Result<Self> {
        Ok(Self {
            map,
            flip_invalid: object.boolean("flip_invalid_normals", true)?,
            shadowing: object.boolean("use_shadowing_function", true)?,
            nested: loader.nested_bsdf(object)?,
        })
    }

    fn frame(&self, surface: &Surface, wi: Vec3) -> BentFrame {
        let mut n = self.map.normal(surface);
        if self.flip_invalid && wi.z * wi.dot(n) <= 0.0 {
            n = vec3(-n.x, -n.y, n.z);
        }
        let tan2 = (n.x * n.x + n.y * n.y) / (n.z * n.z).max(1e-12);
        BentFrame {
            frame: Frame::along(n, Vec3::X),
            shadow_alpha2: if self.shadowing { (0.125 * tan2).min(1.0) } else { 0.0 },
        }
    }
}

impl BentFrame {
    /// Both directions in the perturbed frame; `None` when the outgoing one changes sides.
    fn map(&self, wi: Vec3, wo: Vec3) -> Option<(Vec3, Vec3)> {
        let perturbed_wo = self.frame.to_local(wo);
        (wo.z * perturbed_wo.z > 0.0).then(|| (self.frame.to_local(wi), perturbed_wo))
    }

    fn shadow(&self, wo: Vec3) -> f32 {
        let tan2 = (wo.x * wo.x + wo.y * wo.y) / (wo.z * wo.z).max(1e-12);
        2.0 / (1.0 + (1.0 + self.shadow_alpha2 * tan2).sqrt())
    }
}

impl<B: NormalMap> Bsdf for Perturbed<B> {
    fn sample(&self, surface: &Surface, wi: Vec3, lobe: f32, u: Vec2) -> Option<BsdfSample> {
        let perturbed = self.frame(surface, wi);
        let sample = self.nested.sample(surface, perturbed.frame.to_local(wi), lobe, u)?;
        let wo = perturbed.frame.to_world(sample.wo);
        if wo.z * sample.wo.z <= 0.0 {
            return None;
        }
        Some(BsdfSample { wo, weight: sample.weight * perturbed.shadow(wo), ..sample })
    }

    fn eval(&self, surface: &Surface, wi: Vec3, wo: Vec3) -> Eval {
        let perturbed = self.frame(surface, wi);
        let Some((perturbed_wi, perturbed_wo)) = perturbed.map(wi, wo) else { return Eval::default() };
        let Eval { value, pdf } = self.nested.eval(surface, perturbed_wi, perturbed_wo);
        Eval { value: value * perturbed.shadow(wo), pdf }
    }

    fn delta(&self, surface: &Surface, wi: Vec3, lobe: Lobe) -> Option<Delta> {
        let perturbed = self.frame(surface, wi);
        let delta = self.nested.delta(surface, perturbed.frame.to_local(wi), lobe)?;
        let wo = perturbed.frame.to_world(delta.wo);
        (wo.z * delta.wo.z > 0.0).then(|| Delta { wo, value: delta.value * perturbed.shadow(wo), ..delta })
    }

    fn roughness(&self, surface: &Surface) -> Option<f32> {
        self.nested.roughness(surface)
    }

    fn albedo(&self, surface: &Surface) -> Rgb {
        self.nested.albedo(surface)
    }

    fn transmits(&self) -> bool {
        self.nested.transmits()
    }

    fn refraction(&self) -> Option<f32> {
        self.nested.refraction()
    }

    fn needs_derivatives(&self) -> bool {
        true
    }
}
