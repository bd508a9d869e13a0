//! Segments of sixteen base paths, with the offsets across one edge beside them.

use super::connection::Connected;
use super::extension::Extended;
use super::offsets::SurfacePacket;
use super::received::Received;
use super::states::{Kind, States};
use crate::math::lanes::{Lanes, Lanes3, Mask};
use crate::render::vertices::Vertices;
use crate::scene::Scene;
use crate::scene::bsdf::Lobe;
use crate::scene::closure::Evals;
use crate::scene::packet::Surfaces;

/// One depth of a wave's base paths.
pub struct ShiftContext<'a> {
    pub scene: &'a Scene,
    /// Least roughness of the smooth lobes above which a material counts as diffuse.
    pub threshold: f32,
    /// Whether differences of the ambient light are recorded.
    pub ambient: bool,
    /// Camera hits of all base paths.
    pub base: &'a [Vertices],
    /// Vertices at the next depth, and the light that they receive.
    pub below: (&'a [Vertices], &'a [Received]),
}

/// The vertices that the segments of a packet lead to, as far as light reaches.
pub struct NextVertices {
    /// Lanes whose segment leads to a vertex that receives light.
    pub exists: Mask,
    /// Throughput of the base paths there.
    pub throughput: Lanes3,
    /// Light that they receive there.
    pub received: Received,
    /// The surfaces there, where an offset is unconnected.
    pub surfaces: Surfaces,
    /// Lanes with sampled light or a continuation that is connected to; like all below, set only where an offset is unconnected.
    pub connects: Mask,
    /// Lanes with sampled light that is not connected to.
    pub glossy_light: Mask,
    /// Lanes with a continuation that is not connected to.
    pub glossy_scatter: Mask,
    /// Lanes that continue by a smooth lobe.
    pub smooth: Mask,
}

/// The offsets of sixteen base paths across a half-edge of each, on the way from one vertex to the next.
#[derive(Clone, Copy)]
pub struct Segment<'a> {
    pub vertices: &'a Vertices,
    pub next: &'a NextVertices,
    /// Surfaces of the unconnected offsets.
    pub offset: &'a SurfacePacket,
    pub states: &'a States,
    /// Lanes whose segment may contribute.
    pub leaving: Mask,
    /// Lanes among them whose offset is unconnected.
    pub unconnected: Mask,
    /// Offsets that are connected over the segments.
    pub connected: &'a Connected,
    /// Offsets that have left their vertices by half-vector copies.
    pub extended: &'a Extended,
    /// BSDF values and densities of just connected offsets, which leave the base paths' vertices in the same directions as
    /// these.
    pub moved: Evals,
}

impl ShiftContext<'_> {
    /// Lanes whose lobe of the given roughness counts as diffuse.
    #[inline(always)]
    pub fn diffuse(&self, roughness: Lanes) -> Mask {
        roughness.greater(Lanes::splat(self.threshold))
    }

    /// Lanes whose segment may contribute, of the active ones whose path goes on.
    #[inline(always)]
    pub fn leaving(&self, vertices: &Vertices, next: &NextVertices, active: Mask) -> Mask {
        let ambient = if self.ambient { active } else { Mask::NONE };
        active & vertices.scattered & (next.exists | vertices.hits_emitter | ambient)
    }
}

impl NextVertices {
    /// The vertices that paths lead to. `unconnected`: lanes with an offset that may have to be connected to them.
    pub fn new(context: &ShiftContext, vertices: &Vertices, unconnected: Mask) -> Self {
        let received = Received::next(vertices, context.below, context.ambient);
        let weight = vertices.scatters.weight * (Lanes::splat(1.0) / vertices.survival);
        let none = Mask::NONE;
        let mut next = Self {
            exists: received.any(),
            throughput: vertices.throughput.scale(weight),
            received,
            surfaces: Surfaces::default(),
            connects: none,
            glossy_light: none,
            glossy_scatter: none,
            smooth: none,
        };
        for (lane, packet, at) in vertices.followed_by(context.below.0) {
            if !unconnected.get(lane) || !next.exists.get(lane) {
                continue;
            }
            let there = &context.below.0[packet];
            next.surfaces.copy_place(lane, &there.surfaces, at);
            let diffuse = there.materials.roughness().0[at] > context.threshold;
            let (lit, scattered) = (there.lit.get(at), there.scattered.get(at));
            let smooth = there.scatters.lobe(at) == Lobe::Smooth;
            next.connects.set(lane, diffuse && (lit || (scattered && smooth)));
            next.glossy_light.set(lane, lit && !diffuse);
            next.glossy_scatter.set(lane, scattered && !(diffuse && smooth));
            next.smooth.set(lane, smooth);
        }
        next
    }
}

impl<'a> Segment<'a> {
    /// The segments that leave some vertices.
    #[inline(always)]
    pub fn new(
        context: &ShiftContext,
        (vertices, next): (&'a Vertices, &'a NextVertices),
        (offset, connected, extended): (&'a SurfacePacket, &'a Connected, &'a Extended),
        states: &'a States,
        leaving: Mask,
    ) -> Self {
        let unconnected = leaving & states.are(Kind::Unconnected);
        let moved = moved(context, vertices, states, leaving);
        Self { vertices, next, offset, states, leaving, unconnected, connected, extended, moved }
    }
}

/// BSDF values and densities of just connected offsets, which leave the base paths' vertices in the same directions as these.
#[inline(always)]
fn moved(context: &ShiftContext, vertices: &Vertices, states: &States, leaving: Mask) -> Evals {
    let Vertices { surfaces, materials, scatters, .. } = vertices;
    let just_connected = leaving & states.are(Kind::JustConnected);
    if !just_connected.any() {
        return Evals::ZERO;
    }
    materials.eval(context.scene, surfaces, (states.wi, scatters.wo), just_connected)
}
