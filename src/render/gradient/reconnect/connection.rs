//! Connecting offsets to the next vertex of their base paths. Jacobians are in solid angle at the vertex that is left, so
//! that they are the ratio of the solid angles under which the two paths see the same piece of surface.

use super::difference::LastSegments;
use super::offsets::SurfacePacket;
use crate::math::lanes::{Lanes, Lanes3, Mask};
use crate::scene::packet::{Lights, Surfaces};
use crate::scene::{Purpose, Scene};

/// Largest Jacobian, and the inverse of the smallest one: beyond them single precision is not enough, and the shift fails
/// in both directions.
const MAX_JACOBIAN: f32 = 1e6;

#[inline(always)]
fn in_range(jacobian: Lanes) -> Mask {
    jacobian.less(Lanes::splat(MAX_JACOBIAN)) & jacobian.greater(Lanes::splat(1.0 / MAX_JACOBIAN))
}

/// Segments from the offsets' vertices to the base paths' next vertices.
#[repr(align(64))]
pub struct Connections {
    /// Lanes whose connection carries light and is unoccluded.
    pub possible: Mask,
    /// f cos at the offset's vertex, times dω' / dω.
    pub value: Lanes3,
    /// Density per solid angle of scattering there, times dω' / dω.
    pub pdf: Lanes,
    /// Local direction from the base path's next vertex back to the offset's vertex.
    pub wi: Lanes3,
}

impl Connections {
    /// Connects the active lanes of `offset` to `target`, which the base paths reach from `base`.
    #[inline(always)]
    pub fn new(scene: &Scene, base: Lanes3, offset: &SurfacePacket, target: &Surfaces, active: Mask) -> Self {
        let SurfacePacket { surfaces, materials } = offset;
        let jacobian = jacobian(base, surfaces.p, (target.p, target.n));
        let direction = (target.p - surfaces.p).normalize_or(Lanes3::ZERO);
        let in_range = active & in_range(jacobian);
        let evals = materials.eval(scene, surfaces, (surfaces.wi, surfaces.frame.to_local(direction)), in_range);
        let carried = in_range & evals.value.nonzero();
        let possible = if carried.any() { scene.mutually_visible_packet(surfaces, target, carried) } else { carried };
        let wi = target.frame.to_local(-direction);
        Self { possible, value: evals.value * jacobian, pdf: evals.pdf * jacobian, wi }
    }
}

/// Solid angle of a piece of surface, given by its point and normal, seen from `offset`, over that seen from `base`.
#[inline(always)]
pub fn jacobian(base: Lanes3, offset: Lanes3, (p, n): (Lanes3, Lanes3)) -> Lanes {
    let solid_angle = |from: Lanes3| {
        let to = from - p;
        let distance_squared = to.dot(to);
        n.dot(to).abs() / (distance_squared * distance_squared.sqrt())
    };
    solid_angle(offset) / solid_angle(base)
}

impl LastSegments {
    /// Connects the active lanes of `offset` to the emitter points that light `base`.
    #[inline(always)]
    pub fn to_lights(scene: &Scene, base: Lanes3, offset: &SurfacePacket, lights: &Lights, active: Mask) -> Self {
        let SurfacePacket { surfaces, materials } = offset;
        let (direction, angle) = lights.seen_from(surfaces.p);
        let (_, base_angle) = lights.seen_from(base);
        let jacobian = angle / base_angle;
        let in_range = active & in_range(jacobian);
        let evals = materials.eval(scene, surfaces, (surfaces.wi, surfaces.frame.to_local(direction)), in_range);
        let radiance = scene.light_radiance(lights, direction, in_range & evals.value.nonzero());
        let value = evals.value.scale(radiance);
        let carried = in_range & value.nonzero();
        let lit =
            if carried.any() { scene.visible_packet(surfaces, lights, carried, Purpose::OffsetLight) } else { carried };
        let density = scene.light_pdf(lights, (surfaces.p, angle), lit) + lights.scatter_pdf(evals.pdf);
        Self {
            contribution: lit.select3(value * jacobian, Lanes3::ZERO),
            density: lit.select(density * jacobian, Lanes::ZERO),
        }
    }
}
