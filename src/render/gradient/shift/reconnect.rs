//! Joining the base path at its next vertex. Jacobians are in solid angle at the vertex that is left, so they are
//! the ratio of the solid angles under which the two paths see the same piece of surface.

use super::End;
use crate::math::{Rgb, Vec3};
use crate::scene::emitter::LightPoint;
use crate::scene::{Scene, Surface};

/// A Jacobian beyond this, or below its inverse, is a geometry that floats cannot hold; the shift then fails in
/// both directions.
const MAX_JACOBIAN: f32 = 1e6;

fn in_range(jacobian: f32) -> bool {
    jacobian < MAX_JACOBIAN && jacobian > 1.0 / MAX_JACOBIAN
}

/// A segment from the offset's vertex to the base path's next surface.
pub struct Connection {
    /// f cos at the offset's vertex.
    pub value: Rgb,
    /// Density per solid angle of scattering there.
    pub pdf: f32,
    /// dω' / dω.
    pub jacobian: f32,
    /// Local direction from the base path's next surface back to the offset's vertex.
    pub wi: Vec3,
}

impl Connection {
    /// From `offset` to `target`, which the base path reaches from `base`. `None` when it is blocked or carries
    /// nothing.
    pub fn new(scene: &Scene, base: &Surface, offset: &Surface, target: &Surface) -> Option<Self> {
        let jacobian = jacobian(base.p, offset.p, target);
        let direction = (target.p - offset.p).normalize_or_zero();
        let eval = scene.bsdf(offset).eval(offset, offset.wi, offset.to_local(direction));
        if !in_range(jacobian) || eval.value == Rgb::ZERO || !scene.mutually_visible(offset, target) {
            return None;
        }
        Some(Self { value: eval.value, pdf: eval.pdf, jacobian, wi: target.to_local(-direction) })
    }
}

/// Solid angle of a piece of `target` seen from `offset`, over that seen from `base`.
pub fn jacobian(base: Vec3, offset: Vec3, target: &Surface) -> f32 {
    let solid_angle = |from: Vec3| {
        let to = from - target.p;
        let distance_squared = to.length_squared();
        target.n.dot(to).abs() / (distance_squared * distance_squared.sqrt())
    };
    solid_angle(offset) / solid_angle(base)
}

/// From `offset` to the point that lights `base`. `None` when it is blocked or carries nothing.
pub fn to_light(scene: &Scene, base: &Surface, offset: &Surface, point: &LightPoint) -> Option<End> {
    let jacobian = point.solid_angle(offset.p) / point.solid_angle(base.p);
    let direction = point.direction(offset.p);
    let eval = scene.bsdf(offset).eval(offset, offset.wi, offset.to_local(direction));
    let radiance = scene.radiance(point, -direction);
    if !in_range(jacobian) || eval.value * radiance == Rgb::ZERO || !scene.visible(offset, point) {
        return None;
    }
    let light_pdf = scene.emitter_pdf(offset.p, point);
    Some(End { value: eval.value, pdf: point.scatter_pdf(eval.pdf), light_pdf, radiance, jacobian })
}

/// From `offset` the way that `base` is left by, to an ambient light that nothing blocks. `None` when it carries nothing.
pub fn to_ambient(scene: &Scene, base: &Surface, wo: Vec3, offset: &Surface) -> Option<End> {
    let eval = scene.bsdf(offset).eval(offset, offset.wi, offset.to_local(base.frame.to_world(wo)));
    let end = End { value: eval.value, pdf: eval.pdf, light_pdf: 0.0, radiance: Rgb::ONE, jacobian: 1.0 };
    (eval.value != Rgb::ZERO).then_some(end)
}
