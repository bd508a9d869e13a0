//! Connecting offsets to vertices and emitter points of their base paths. Jacobians are in solid angle at the vertex that is
//! left, so that they are the ratio of the solid angles under which the two paths see the same piece of surface.

use super::difference::LastSegments;
use super::offsets::SurfacePacket;
use super::segment::{NextVertices, ShiftContext};
use crate::math::lanes::{Lanes, Lanes3, Mask};
use crate::render::vertices::Vertices;
use crate::scene::Scene;
use crate::scene::bsdf::Lobe;
use crate::scene::packet::{Lights, ShadowRays, ShadowRequest, Surfaces};

/// Largest Jacobian, and the inverse of the smallest one: beyond them single precision is not enough, and the shift fails
/// in both directions.
const MAX_JACOBIAN: f32 = 1e6;

#[inline(always)]
fn in_range(jacobian: Lanes) -> Mask {
    jacobian.less(Lanes::splat(MAX_JACOBIAN)) & jacobian.greater(Lanes::splat(1.0 / MAX_JACOBIAN))
}

/// Offsets across one half-edge of sixteen base paths, connected to everything that these lead to and that can be connected
/// to. Nothing is known to be visible before the shadow rays are traced.
pub struct Connected {
    /// Connections to the emitter points that were sampled at the vertices.
    pub sampled: LightConnections,
    /// Lanes with an unconnected offset where both paths scatter diffusely, so that the offset can be connected to what the
    /// base path comes to next.
    pub connectable: Mask,
    /// Connections to the emitters there.
    pub hit: LightConnections,
    /// Connections to the vertices there.
    pub next: VertexConnections,
}

/// Segments from offsets' vertices to emitter points.
pub struct LightConnections {
    /// Lanes with a connection, be it occluded.
    pub lanes: Mask,
    /// Light that the offsets receive.
    pub ends: LastSegments,
    shadows: ShadowRequest,
}

/// Segments from offsets' vertices to the next vertices of the base paths.
#[repr(align(64))]
pub struct VertexConnections {
    /// Lanes whose connection carries light.
    pub possible: Mask,
    /// f cos at the offset's vertex, times dω' / dω.
    pub value: Lanes3,
    /// Density per solid angle of scattering there, times dω' / dω.
    pub pdf: Lanes,
    /// Local direction from the base path's next vertex back to the offset's vertex.
    pub wi: Lanes3,
    shadows: ShadowRequest,
}

impl Connected {
    /// No connections.
    pub const NONE: Self = Self {
        sampled: LightConnections::NONE,
        connectable: Mask::NONE,
        hit: LightConnections::NONE,
        next: VertexConnections::NONE,
    };

    /// Connects the offsets of the lanes that are unconnected in their states for light and for the continuation.
    #[inline(always)]
    pub fn new(
        context: &ShiftContext,
        (vertices, next): (&Vertices, &NextVertices),
        offset: &SurfacePacket,
        (for_light, for_scatter): (Mask, Mask),
        shadows: &mut ShadowRays,
    ) -> Self {
        let Vertices { surfaces, materials, light, scatters, emission, .. } = vertices;
        let mut connected = Self::NONE;
        let diffuse = context.diffuse(materials.roughness()) & context.diffuse(offset.materials.roughness());
        let to_points = for_light & vertices.lit & (light.points.delta | diffuse);
        let scene = context.scene;
        if to_points.any() {
            connected.sampled = LightConnections::new(scene, (surfaces.p, &light.points), offset, to_points, shadows);
        }
        connected.connectable = context.leaving(vertices, next, for_scatter) & diffuse & scatters.are(Lobe::Smooth);
        let to_emitters = connected.connectable & vertices.hits_emitter;
        if to_emitters.any() {
            let target = (surfaces.p, &emission.points);
            connected.hit = LightConnections::new(scene, target, offset, to_emitters, shadows);
        }
        let to_vertices = connected.connectable & next.connects;
        if to_vertices.any() {
            let target = (surfaces.p, &next.surfaces);
            connected.next = VertexConnections::new(scene, target, offset, to_vertices, shadows);
        }
        connected
    }

    /// Removes the connections that are occluded, once the shadow rays are traced.
    #[inline(always)]
    pub fn remove_occluded(&mut self, shadows: &ShadowRays) {
        for light in [&mut self.sampled, &mut self.hit] {
            if light.lanes.any() {
                let visible = shadows.unoccluded(&light.shadows);
                light.ends = LastSegments::NONE.replaced(&light.ends, visible);
            }
        }
        if self.next.possible.any() {
            self.next.possible = shadows.unoccluded(&self.next.shadows);
        }
    }
}

impl VertexConnections {
    const NONE: Self = Self {
        possible: Mask::NONE,
        value: Lanes3::ZERO,
        pdf: Lanes::ZERO,
        wi: Lanes3::ZERO,
        shadows: ShadowRequest::NONE,
    };

    /// Connects the active lanes of `offset` to `target`, which the base paths reach from `base`.
    #[inline(always)]
    fn new(
        scene: &Scene,
        (base, target): (Lanes3, &Surfaces),
        offset: &SurfacePacket,
        active: Mask,
        shadows: &mut ShadowRays,
    ) -> Self {
        let SurfacePacket { surfaces, materials } = offset;
        let jacobian = jacobian(base, surfaces.p, (target.p, target.n));
        let direction = (target.p - surfaces.p).normalize_or(Lanes3::ZERO);
        let in_range = active & in_range(jacobian);
        let evals = materials.eval(scene, surfaces, (surfaces.wi, surfaces.frame.to_local(direction)), in_range);
        let possible = in_range & evals.value.nonzero();
        let shadows = shadows.between(surfaces, target, possible);
        let wi = target.frame.to_local(-direction);
        Self { possible, value: evals.value * jacobian, pdf: evals.pdf * jacobian, wi, shadows }
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

impl LightConnections {
    const NONE: Self = Self { lanes: Mask::NONE, ends: LastSegments::NONE, shadows: ShadowRequest::NONE };

    /// Connects some lanes of `offset` to the emitter points that light `base`.
    #[inline(always)]
    fn new(
        scene: &Scene,
        (base, lights): (Lanes3, &Lights),
        offset: &SurfacePacket,
        lanes: Mask,
        shadows: &mut ShadowRays,
    ) -> Self {
        let SurfacePacket { surfaces, materials } = offset;
        let (direction, angle) = lights.seen_from(surfaces.p);
        let (_, base_angle) = lights.seen_from(base);
        let jacobian = angle / base_angle;
        let in_range = lanes & in_range(jacobian);
        let evals = materials.eval(scene, surfaces, (surfaces.wi, surfaces.frame.to_local(direction)), in_range);
        let radiance = scene.light_radiance(lights, direction, in_range & evals.value.nonzero());
        let value = evals.value.scale(radiance);
        let carried = in_range & value.nonzero();
        let density = scene.light_pdf(lights, (surfaces, angle), carried) + lights.scatter_pdf(evals.pdf);
        let ends = LastSegments { contribution: value * jacobian, density: density * jacobian };
        Self { lanes, ends, shadows: shadows.towards_lights(scene, surfaces, lights, carried) }
    }
}
