//! Leaving the offset's vertex as the base path leaves its own: by the same delta lobe, or mirrored about the same
//! local half vector.

use crate::math::{Rgb, Vec3, fresnel};
use crate::scene::bsdf::BsdfSample;
use crate::scene::{Scene, Surface};

/// The offset's direction.
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

/// How `offset` is left when the base path leaves `base` by `sample`. `None` when its material cannot do so.
pub fn copy(scene: &Scene, base: &Surface, sample: &BsdfSample, offset: &Surface) -> Option<Copied> {
    let bsdf = scene.bsdf(offset);
    if sample.lobe.is_delta() {
        let delta = bsdf.delta(offset, offset.wi, sample.lobe)?;
        return Some(Copied { wo: delta.wo, value: delta.value, pdf: delta.probability, jacobian: 1.0 });
    }
    let (wo, jacobian) = reflect(base.wi, sample.wo, offset.wi)?;
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
