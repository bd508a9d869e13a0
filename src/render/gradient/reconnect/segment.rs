//! Segments of sixteen base paths, with the offsets across one edge beside them.

use super::half_vector::{self, Extension};
use super::offsets::{OffsetSurfaces, SurfacePacket};
use super::states::{Kind, States};
use crate::math::lanes::{LANES, Lanes, Mask};
use crate::render::vertices::Vertices;
use crate::scene::bsdf::{BsdfSample, Lobe};
use crate::scene::closure::Evals;
use crate::scene::packet::Surfaces;
use crate::scene::{Scene, Surface};

/// One depth of a wave's base paths.
pub struct ShiftContext<'a> {
    pub scene: &'a Scene,
    /// Least roughness of the smooth lobes above which a material counts as diffuse.
    pub threshold: f32,
    /// Whether differences of the ambient light are recorded.
    pub ambient: bool,
    /// Camera hits of all base paths.
    pub base: &'a [Vertices],
    /// Vertices at the next depth.
    pub below: &'a [Vertices],
}

/// The vertices that the segments of a packet lead to, as far as light reaches.
pub struct NextVertices {
    /// Lanes whose segment leads to another vertex.
    pub exists: Mask,
    /// The surfaces there, where an offset is unconnected.
    pub surfaces: Surfaces,
    /// Lanes whose light is connected to.
    pub connects_light: Mask,
    /// Lanes that receive light from a sampled emitter point; like all below, set only where an offset is unconnected.
    pub lit: Mask,
    /// Lanes whose continuation is connected to.
    pub connects_scatter: Mask,
    /// Lanes that continue.
    pub scattered: Mask,
}

/// Surfaces of the offsets of a packet, and the extensions of those that are not connected; memory for reuse.
#[derive(Default)]
pub struct Scratch {
    offset: SurfacePacket,
    extensions: Vec<(usize, Option<Extension>)>,
    /// Offsets that were connected so far, and that were extended: each takes a ray.
    pub connected: u32,
    pub extended: u32,
}

impl ShiftContext<'_> {
    /// Lanes whose lobe of the given roughness counts as diffuse.
    #[inline(always)]
    pub fn diffuse(&self, roughness: Lanes) -> Mask {
        roughness.greater(Lanes::splat(self.threshold))
    }

    /// Extends an offset by the half-vector copy of a sampled direction.
    pub fn extend(&self, base: &Surface, sampled: &BsdfSample, offset: &Surface) -> Option<Extension> {
        half_vector::extend(self.scene, base, (sampled.wo, sampled.lobe), offset)
    }
}

impl NextVertices {
    /// The vertices that `active` paths lead to. `unconnected`: lanes with an offset that may have to be connected to
    /// them. `reaches` says whether light reaches the next vertex of a sample's path.
    pub fn new(
        context: &ShiftContext,
        vertices: &Vertices,
        active: Mask,
        unconnected: Mask,
        reaches: impl Fn(u32) -> bool,
    ) -> Self {
        let none = Mask::NONE;
        let mut next = Self {
            exists: none,
            surfaces: Surfaces::default(),
            connects_light: none,
            lit: none,
            connects_scatter: none,
            scattered: none,
        };
        for lane in (active & vertices.scattered).lanes().filter(|&lane| reaches(vertices.id.0[lane])) {
            let (packet, at) = (vertices.next.0[lane] as usize / LANES, vertices.next.0[lane] as usize % LANES);
            let Some(there) = context.below.get(packet).filter(|there| there.hit.get(at)) else { continue };
            next.exists.set(lane, true);
            if unconnected.get(lane) {
                next.surfaces.copy(lane, &there.surfaces, at);
                let diffuse = there.materials.roughness().0[at] > context.threshold;
                let smooth = there.scatters.are(Lobe::Smooth).get(at);
                next.connects_light.set(lane, diffuse);
                next.lit.set(lane, there.lit.get(at));
                next.scattered.set(lane, there.scattered.get(at));
                next.connects_scatter.set(lane, diffuse && smooth && there.scattered.get(at));
            }
        }
        next
    }
}

impl Scratch {
    /// Loads the surfaces of the unconnected offsets among the active lanes.
    #[inline(always)]
    pub fn load_offsets(
        &mut self,
        context: &ShiftContext,
        offsets: &OffsetSurfaces,
        (for_light, for_scatter): (&States, &States),
        active: Mask,
    ) {
        let (light, scatter) = (for_light.are(Kind::Unconnected), for_scatter.are(Kind::Unconnected));
        for lane in (active & (light | scatter)).lanes() {
            let states = if light.get(lane) { for_light } else { for_scatter };
            let (surfaces, materials, from) = offsets.at(context.base, states.vertex_index.0[lane]);
            self.offset.surfaces.copy(lane, surfaces, from);
            self.offset.materials.copy(lane, materials, from);
        }
    }

    /// The surfaces that were loaded.
    pub fn offset(&self) -> &SurfacePacket {
        &self.offset
    }
}

/// The segments that leave some vertices, with the offsets across one edge.
pub struct OffsetSegment<'a> {
    pub vertices: &'a Vertices,
    /// Surfaces of the unconnected offsets.
    pub offset: &'a SurfacePacket,
    pub states: &'a States,
    /// Lanes whose segment may contribute.
    pub leaving: Mask,
    /// Lanes among them whose offset is unconnected.
    pub unconnected: Mask,
    /// BSDF values and densities of connected and just connected offsets, which leave the base paths' vertices in the same
    /// directions as these.
    pub base_scatter: Evals,
    /// Lanes with an unconnected offset where both paths scatter diffusely, so that the offset can be connected.
    pub connectable: Mask,
    /// Extensions of the other unconnected offsets.
    pub extensions: &'a [(usize, Option<Extension>)],
}

impl<'a> OffsetSegment<'a> {
    #[inline(always)]
    pub fn new(
        context: &ShiftContext,
        vertices: &'a Vertices,
        scratch: &'a mut Scratch,
        states: &'a States,
        leaving: Mask,
    ) -> Self {
        let Scratch { offset, extensions, connected, extended } = scratch;
        let unconnected = leaving & states.are(Kind::Unconnected);
        let diffuse = context.diffuse(vertices.materials.roughness()) & context.diffuse(offset.materials.roughness());
        let connectable = unconnected & diffuse & vertices.scatters.are(Lobe::Smooth);
        extensions.clear();
        for lane in (unconnected & !connectable).lanes() {
            let (base, offset) = (vertices.surfaces.get(lane), offset.surfaces.get(lane));
            extensions.push((lane, context.extend(&base, &vertices.scatters.get(lane), &offset)));
        }
        *connected += connectable.count();
        *extended += extensions.len() as u32;
        let base_scatter = base_scatter(context.scene, vertices, states, leaving);
        Self { vertices, offset, states, leaving, unconnected, base_scatter, connectable, extensions }
    }
}

/// BSDF values and densities of offsets that leave the base paths' vertices in the same directions as these: the base
/// paths' own, unless the offset arrives from another direction.
#[inline(always)]
fn base_scatter(scene: &Scene, vertices: &Vertices, states: &States, leaving: Mask) -> Evals {
    let Vertices { surfaces, materials, scatters, .. } = vertices;
    let mut evals = Evals { value: scatters.weight * scatters.pdf, pdf: scatters.pdf };
    let just_connected = leaving & states.are(Kind::JustConnected);
    if just_connected.any() {
        let moved = materials.eval(scene, surfaces, (states.wi, scatters.wo), just_connected);
        evals.value = just_connected.select3(moved.value, evals.value);
        evals.pdf = just_connected.select(moved.pdf, evals.pdf);
    }
    evals
}
