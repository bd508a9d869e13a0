//! Leaving the offset's vertex as the base path leaves its own: by the same delta lobe, or mirrored or refracted about
//! the same local half vector.

use super::End;
use crate::math::{Rgb, Vec3, fresnel};
use crate::scene::bsdf::Lobe;
use crate::scene::emitter::{LightPoint, Position};
use crate::scene::{Scene, Surface};

/// The offset's direction.
#[derive(Clone, Copy)]
pub struct Copied {
    /// Local direction.
    pub wo: Vec3,
    /// f cos, or the factor of a delta lobe.
    pub value: Rgb,
    /// Density per solid angle, or probability of a delta lobe.
    pub pdf: f32,
    /// dω' / dω; 1 for delta lobes.
    pub jacobian: f32,
}

/// The offset's direction and what it leads to.
#[derive(Clone, Copy)]
pub struct Extended {
    /// The direction.
    pub copied: Copied,
    /// What the offset meets.
    pub hit: Option<Surface>,
    direction: Vec3,
    delta: bool,
}

/// How `offset` is left when the base path leaves `base` along the direction and by the lobe given. `None` when its
/// material cannot do so.
fn copy(scene: &Scene, base: &Surface, (wo, lobe): (Vec3, Lobe), offset: &Surface) -> Option<Copied> {
    let bsdf = scene.bsdf(offset);
    if lobe.is_delta() {
        let delta = bsdf.delta(offset, offset.wi, lobe)?;
        // Where the base's material cannot tell its lobes apart, the way back fails, and so this one has to.
        scene.bsdf(base).delta(base, base.wi, lobe)?;
        return Some(Copied { wo: delta.wo, value: delta.value, pdf: delta.probability, jacobian: 1.0 });
    }
    let (wo, jacobian) = if base.wi.z * wo.z > 0.0 {
        reflect(base.wi, wo, offset.wi)?
    } else {
        // The way back refracts at the base's material, so both must bend alike.
        let eta = bsdf.refraction().filter(|&eta| scene.bsdf(base).refraction() == Some(eta))?;
        refract(base.wi, wo, offset.wi, if base.wi.z > 0.0 { eta } else { 1.0 / eta })?
    };
    let eval = bsdf.eval(offset, offset.wi, wo);
    (eval.value != Rgb::ZERO && eval.pdf > 0.0).then_some(Copied { wo, value: eval.value, pdf: eval.pdf, jacobian })
}

/// Copies a direction and follows it to what the offset meets.
pub fn extend(scene: &Scene, base: &Surface, left_by: (Vec3, Lobe), offset: &Surface) -> Option<Extended> {
    let copied = copy(scene, base, left_by, offset)?;
    let ray = offset.ray(copied.wo);
    let (_, lobe) = left_by;
    Some(Extended { copied, hit: scene.intersect(ray), direction: ray.direction, delta: lobe.is_delta() })
}

/// Mirrors `offset_wi` about the half vector of `wi` and `wo`, and the change of solid angle dω' / dω. `None` when
/// either pair of directions is on different sides of the surface.
pub fn reflect(wi: Vec3, wo: Vec3, offset_wi: Vec3) -> Option<(Vec3, f32)> {
    let h = (wi + wo).try_normalize()?;
    let offset_wo = fresnel::reflect_about(offset_wi, h);
    let jacobian = offset_wo.dot(h).abs() / wo.dot(h).abs();
    let same_side = wi.z * wo.z > 0.0 && offset_wi.z * offset_wo.z > 0.0;
    (same_side && jacobian > 0.0 && jacobian.is_finite()).then_some((offset_wo, jacobian))
}

/// Refracts `offset_wi` at the half vector that refracts `wi` into `wo`, and the change of solid angle dω' / dω. `eta` is
/// the index of refraction on the side of `wo` over that on the side of `wi`. `None` under total reflection, and when
/// the sides are not the same.
pub fn refract(wi: Vec3, wo: Vec3, offset_wi: Vec3, eta: f32) -> Option<(Vec3, f32)> {
    let sum = wi + wo * eta;
    let h = sum.try_normalize()?;
    let cos_i = offset_wi.dot(h);
    let cos_t = (1.0 - (1.0 - cos_i * cos_i) / (eta * eta)).max(0.0).sqrt().copysign(cos_i);
    let offset_wo = (h * (cos_i / eta - cos_t) - offset_wi / eta).try_normalize()?;
    let growth = (offset_wi + offset_wo * eta).length_squared() / sum.length_squared();
    let jacobian = growth * (wo.dot(h) / offset_wo.dot(h)).abs();
    let same_sides = wi.z * offset_wi.z > 0.0 && wo.z * offset_wo.z > 0.0 && wi.z * wo.z < 0.0;
    let refracts = wi.dot(h) * wo.dot(h) < 0.0;
    let possible = same_sides && refracts && cos_t != 0.0 && cos_i * wi.dot(h) > 0.0;
    (possible && jacobian > 0.0 && jacobian.is_finite()).then_some((offset_wo, jacobian))
}

impl Extended {
    /// The offset's last segment to an ambient light that nothing blocks.
    pub fn to_ambient(&self) -> End {
        let Copied { value, pdf, jacobian, .. } = self.copied;
        End { value, pdf, light_pdf: 0.0, radiance: Rgb::ONE, jacobian }
    }

    /// The offset's last segment when the base path's leads to the emitter point `target`: its own way has to lead
    /// to an emitter too, and to infinity only with the base's.
    pub fn end(&self, scene: &Scene, offset: &Surface, target: &LightPoint) -> Option<End> {
        let far = matches!(target.position, Position::Infinity { .. });
        let point = match &self.hit {
            Some(hit) if !far => scene.light_point(hit)?,
            None if far => scene.environment(self.direction)?,
            _ => return None,
        };
        let light_pdf = if self.delta { 0.0 } else { scene.emitter_pdf(offset.p, &point) };
        let radiance = scene.radiance(&point, -self.direction);
        let Copied { value, pdf, jacobian, .. } = self.copied;
        Some(End { value, pdf, light_pdf, radiance, jacobian })
    }
}
