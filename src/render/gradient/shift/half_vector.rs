//! Leaving the offset's vertex as the base path leaves its own: by the same delta lobe, or mirrored about the same
//! local half vector.

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

/// How `offset` is left when the base path leaves `base` along `wo` by `lobe`. `None` when its material cannot do
/// so.
pub fn copy(scene: &Scene, base: &Surface, wo: Vec3, lobe: Lobe, offset: &Surface) -> Option<Copied> {
    let bsdf = scene.bsdf(offset);
    if lobe.is_delta() {
        let delta = bsdf.delta(offset, offset.wi, lobe)?;
        return Some(Copied { wo: delta.wo, value: delta.value, pdf: delta.probability, jacobian: 1.0 });
    }
    let (wo, jacobian) = reflect(base.wi, wo, offset.wi)?;
    let eval = bsdf.eval(offset, offset.wi, wo);
    (eval.value != Rgb::ZERO && eval.pdf > 0.0).then_some(Copied { wo, value: eval.value, pdf: eval.pdf, jacobian })
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

/// The offset's last segment when the base path reaches the emitter point `target` along `wo`: its own way has to
/// meet an emitter too.
pub fn to_light(
    scene: &Scene,
    base: &Surface,
    wo: Vec3,
    lobe: Lobe,
    offset: &Surface,
    target: &LightPoint,
) -> Option<End> {
    let copied = copy(scene, base, wo, lobe, offset)?;
    let ray = offset.ray(copied.wo);
    end(scene, &copied, lobe.is_delta(), offset, ray.direction, scene.intersect(ray).as_ref(), target)
}

/// The same for a direction that is copied already and `hit` what it meets.
pub fn end(
    scene: &Scene,
    copied: &Copied,
    delta: bool,
    offset: &Surface,
    direction: Vec3,
    hit: Option<&Surface>,
    target: &LightPoint,
) -> Option<End> {
    let far = matches!(target.position, Position::Infinity { .. });
    let point = match hit {
        Some(hit) if !far => scene.light_point(hit)?,
        None if far => scene.environment(direction)?,
        _ => return None,
    };
    let light_pdf = if delta { 0.0 } else { scene.emitter_pdf(offset.p, &point) };
    let radiance = scene.radiance(&point, -direction);
    Some(End { value: copied.value, pdf: copied.pdf, light_pdf, radiance, jacobian: copied.jacobian })
}
