//! Shading normals bent by a height texture (Blinn 1978).

use std::sync::Arc;

use super::{Bsdf, BsdfSample, Delta, Eval, Lobe};
use crate::error::Result;
use crate::math::{Frame, Rgb, Vec2, Vec3, vec3};
use crate::scene::Surface;
use crate::scene::load::props::Object;
use crate::scene::load::{Loader, Plugin};
use crate::scene::texture::Texture;

/// `bumpmap`.
pub const PLUGIN: Plugin<Arc<dyn Bsdf>> = Plugin {
    name: "bumpmap",
    parameters: "scale, flip_invalid_normals, use_shadowing_function, one nested texture, one nested bsdf",
    make,
};

fn make(object: &Object, loader: &mut Loader) -> Result<Arc<dyn Bsdf>> {
    let scale = object.float("scale", 1.0)?;
    let flip_invalid = object.boolean("flip_invalid_normals", true)?;
    let shadowing = object.boolean("use_shadowing_function", true)?;
    let nested = loader.nested_bsdf(object)?;
    let mut height = None;
    for property in object.nested() {
        let child = loader.resolve(property)?;
        if child.class == "texture" {
            property.take();
            height = Some(loader.texture_object(&child)?);
        }
    }
    let height = height.ok_or_else(|| object.place.invalid("`bumpmap` needs a nested texture"))?;
    Ok(Arc::new(BumpMap { height, scale, flip_invalid, shadowing, nested }))
}

struct BumpMap {
    height: Arc<dyn Texture>,
    scale: f32,
    /// Mirror a bent normal that faces away from the viewer.
    flip_invalid: bool,
    /// Attenuate directions that the bumps would shadow, where the bent normal would otherwise cut light off.
    shadowing: bool,
    nested: Arc<dyn Bsdf>,
}

/// The bent frame, in coordinates of the unbent one.
struct Bent {
    frame: Frame,
    shadow_alpha2: f32,
}

impl BumpMap {
    fn bend(&self, surface: &Surface, wi: Vec3) -> Bent {
        let slope = self.height.gradient(surface.uv) * self.scale;
        let n = surface.frame.n;
        let du = surface.dp_du + n * (slope.x - n.dot(surface.dp_du));
        let dv = surface.dp_dv + n * (slope.y - n.dot(surface.dp_dv));
        let bent = du.cross(dv).normalize_or(n);
        let mut bent = surface.frame.to_local(bent * 1f32.copysign(surface.n.dot(bent)));
        if self.flip_invalid && wi.z * wi.dot(bent) <= 0.0 {
            bent = vec3(-bent.x, -bent.y, bent.z);
        }
        let tan2 = (bent.x * bent.x + bent.y * bent.y) / (bent.z * bent.z).max(1e-12);
        Bent {
            frame: Frame::along(bent, Vec3::X),
            shadow_alpha2: if self.shadowing { (0.125 * tan2).min(1.0) } else { 0.0 },
        }
    }
}

impl Bent {
    /// Both directions in the bent frame; `None` when the outgoing one changes sides.
    fn map(&self, wi: Vec3, wo: Vec3) -> Option<(Vec3, Vec3)> {
        let bent_wo = self.frame.to_local(wo);
        (wo.z * bent_wo.z > 0.0).then(|| (self.frame.to_local(wi), bent_wo))
    }

    fn shadow(&self, wo: Vec3) -> f32 {
        let tan2 = (wo.x * wo.x + wo.y * wo.y) / (wo.z * wo.z).max(1e-12);
        2.0 / (1.0 + (1.0 + self.shadow_alpha2 * tan2).sqrt())
    }
}

impl Bsdf for BumpMap {
    fn sample(&self, surface: &Surface, wi: Vec3, lobe: f32, u: Vec2) -> Option<BsdfSample> {
        let bent = self.bend(surface, wi);
        let sample = self.nested.sample(surface, bent.frame.to_local(wi), lobe, u)?;
        let wo = bent.frame.to_world(sample.wo);
        if wo.z * sample.wo.z <= 0.0 {
            return None;
        }
        Some(BsdfSample { wo, weight: sample.weight * bent.shadow(wo), ..sample })
    }

    fn eval(&self, surface: &Surface, wi: Vec3, wo: Vec3) -> Eval {
        let bent = self.bend(surface, wi);
        let Some((bent_wi, bent_wo)) = bent.map(wi, wo) else { return Eval::default() };
        let Eval { value, pdf } = self.nested.eval(surface, bent_wi, bent_wo);
        Eval { value: value * bent.shadow(wo), pdf }
    }

    fn delta(&self, surface: &Surface, wi: Vec3, lobe: Lobe) -> Option<Delta> {
        let bent = self.bend(surface, wi);
        let delta = self.nested.delta(surface, bent.frame.to_local(wi), lobe)?;
        let wo = bent.frame.to_world(delta.wo);
        (wo.z * delta.wo.z > 0.0).then(|| Delta { wo, value: delta.value * bent.shadow(wo), ..delta })
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

    fn needs_derivatives(&self) -> bool {
        true
    }
}
