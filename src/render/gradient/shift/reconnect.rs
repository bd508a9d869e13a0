//! Joining the base path at its next vertex. Jacobians are in solid angle at the vertex that is left, so they are
//! the ratio of the solid angles under which the two paths see the same piece of surface.

use super::super::offsets::Packet;
use crate::math::lanes::{Lanes, Lanes3, Mask};
use crate::scene::Scene;
use crate::scene::packet::{Lights, Surfaces};

/// A Jacobian beyond this, or below its inverse, is a geometry that floats cannot hold; the shift then fails in
/// both directions.
const MAX_JACOBIAN: f32 = 1e6;

#[inline(always)]
fn in_range(jacobian: Lanes) -> Mask {
    jacobian.less(Lanes::splat(MAX_JACOBIAN)) & jacobian.greater(Lanes::splat(1.0 / MAX_JACOBIAN))
}

/// Segments from offsets' vertices to base paths' next surfaces.
pub struct Connections {
    /// Which are possible; the others carry nothing.
    pub possible: Mask,
    /// f cos at the offset's vertex, times dω' / dω.
    pub value: Lanes3,
    /// Density per solid angle of scattering there, times dω' / dω.
    pub pdf: Lanes,
    /// Local direction from the base path's next surface back to the offset's vertex.
    pub wi: Lanes3,
}

impl Connections {
    /// From `offset` to `target`, which the base paths reach from `base`, of the active ones.
    #[inline(always)]
    pub fn new(scene: &Scene, base: Lanes3, offset: &Packet, target: &Surfaces, active: Mask) -> Self {
        let Packet { surfaces, materials } = offset;
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

/// Solid angles of pieces of surfaces, given by points and normals, seen from `offset`, over those seen from `base`.
#[inline(always)]
pub fn jacobian(base: Lanes3, offset: Lanes3, (p, n): (Lanes3, Lanes3)) -> Lanes {
    let solid_angle = |from: Lanes3| {
        let to = from - p;
        let distance_squared = to.dot(to);
        n.dot(to).abs() / (distance_squared * distance_squared.sqrt())
    };
    solid_angle(offset) / solid_angle(base)
}

/// What offsets receive over last segments of their own.
#[derive(Clone, Copy)]
pub struct Ends {
    /// f cos at the offset's vertex times the radiance received, times dω' / dω; zero where nothing comes.
    pub value: Lanes3,
    /// Densities of choosing the point and of running into it, times dω' / dω.
    pub density: Lanes,
}

impl Ends {
    /// Nothing is received.
    pub const NONE: Self = Self { value: Lanes3::ZERO, density: Lanes::ZERO };

    /// From `offset` to the points that light `base`, of the active ones.
    #[inline(always)]
    pub fn to_lights(scene: &Scene, base: Lanes3, offset: &Packet, lights: &Lights, active: Mask) -> Self {
        let Packet { surfaces, materials } = offset;
        let (direction, angle) = lights.seen_from(surfaces.p);
        let (_, base_angle) = lights.seen_from(base);
        let jacobian = angle / base_angle;
        let in_range = active & in_range(jacobian);
        let evals = materials.eval(scene, surfaces, (surfaces.wi, surfaces.frame.to_local(direction)), in_range);
        let radiance = scene.light_radiance(lights, direction, in_range & evals.value.nonzero());
        let value = evals.value.scale(radiance);
        let carried = in_range & value.nonzero();
        let lit = if carried.any() { scene.visible_packet(surfaces, lights, carried) } else { carried };
        let density = scene.light_pdf(lights, (surfaces.p, angle), lit) + lights.scatter_pdf(evals.pdf);
        Self {
            value: lit.select3(value * jacobian, Lanes3::ZERO),
            density: lit.select(density * jacobian, Lanes::ZERO),
        }
    }

    /// Replaces one of them by what a single offset receives.
    pub fn set(&mut self, lane: usize, end: Option<super::End>) {
        let Some(end) = end else { return };
        self.value.set(lane, end.value * end.radiance * end.jacobian);
        self.density.0[lane] = (end.light_pdf + end.pdf) * end.jacobian;
    }
}
