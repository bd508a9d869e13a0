//! Half-vector copies: the offset leaves its vertex as the base path leaves its own, by the same delta lobe, or mirrored or
//! refracted about the same local half vector.

use crate::math::{Rgb, Vec3, fresnel};
use crate::scene::bsdf::Lobe;
use crate::scene::emitter::{LightPoint, Position};
use crate::scene::{Scene, Surface};

/// The direction that an offset leaves its vertex by.
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

/// A segment of an offset that is not connected to its base path.
#[derive(Clone, Copy)]
pub struct Extension {
    /// The direction.
    pub copied: Copied,
    /// The surface that the offset hits.
    pub hit: Option<Surface>,
    direction: Vec3,
    delta: bool,
}

/// The direction by which `offset` is left when the base path leaves `base` along `wo` by the given lobe. `None` if the
/// offset's material cannot scatter so.
fn copy(scene: &Scene, base: &Surface, (wo, lobe): (Vec3, Lobe), offset: &Surface) -> Option<Copied> {
    let bsdf = scene.bsdf(offset);
    if lobe.is_delta() {
        let delta = bsdf.delta(offset, offset.wi, lobe)?;
        // If the base's material has several lobes of this kind (a blend), the inverse shift fails, so this one has to.
        scene.bsdf(base).delta(base, base.wi, lobe)?;
        return Some(Copied { wo: delta.wo, value: delta.value, pdf: delta.probability, jacobian: 1.0 });
    }
    let (wo, jacobian) = if base.wi.z * wo.z > 0.0 {
        reflect(base.wi, wo, offset.wi)?
    } else {
        // The inverse shift refracts at the base's material, so both must have the same index of refraction.
        let eta = bsdf.refraction().filter(|&eta| scene.bsdf(base).refraction() == Some(eta))?;
        refract(base.wi, wo, offset.wi, if base.wi.z > 0.0 { eta } else { 1.0 / eta })?
    };
    let eval = bsdf.eval(offset, offset.wi, wo);
    (eval.value != Rgb::ZERO && eval.pdf > 0.0).then_some(Copied { wo, value: eval.value, pdf: eval.pdf, jacobian })
}

/// Copies a direction and traces the offset's ray along it.
pub fn extend(scene: &Scene, base: &Surface, left_by: (Vec3, Lobe), offset: &Surface) -> Option<Extension> {
    let copied = copy(scene, base, left_by, offset)?;
    let ray = offset.ray(copied.wo);
    let (_, lobe) = left_by;
    Some(Extension { copied, hit: scene.intersect(ray), direction: ray.direction, delta: lobe.is_delta() })
}

/// Mirrors `offset_wi` about the half vector of `wi` and `wo`; with the Jacobian dω' / dω. `None` when
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

/// The last segment of an offset, to an emitter.
pub struct LastSegment {
    /// f cos at the offset's vertex.
    pub scattering: Rgb,
    /// Density per solid angle of scattering along it, or probability of a delta lobe.
    pub pdf: f32,
    /// Density per solid angle of sampling the emitter point by next-event estimation; 0 after a delta lobe.
    pub light_pdf: f32,
    /// Radiance that the offset's vertex receives.
    pub radiance: Rgb,
    /// dω' / dω.
    pub jacobian: f32,
}

impl Extension {
    /// The offset's last segment to the unoccluded ambient light.
    pub fn to_ambient(&self) -> LastSegment {
        let Copied { value, pdf, jacobian, .. } = self.copied;
        LastSegment { scattering: value, pdf, light_pdf: 0.0, radiance: Rgb::ONE, jacobian }
    }

    /// The offset's last segment when the base path's ends on the emitter point `target`: it has to end on an emitter, too,
    /// and at infinity only if the base path does.
    pub fn end(&self, scene: &Scene, offset: &Surface, target: &LightPoint) -> Option<LastSegment> {
        let far = matches!(target.position, Position::Infinity { .. });
        let point = match &self.hit {
            Some(hit) if !far => scene.light_point(hit)?,
            None if far => scene.environment(self.direction)?,
            _ => return None,
        };
        let light_pdf = if self.delta { 0.0 } else { scene.emitter_pdf(offset.p, &point) };
        let radiance = scene.radiance(&point, -self.direction);
        let Copied { value, pdf, jacobian, .. } = self.copied;
        Some(LastSegment { scattering: value, pdf, light_pdf, radiance, jacobian })
    }
}
