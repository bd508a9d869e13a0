//! Offsets that leave their vertices by half-vector copies, across all half-edges of sixteen base paths together, so that
//! their rays fill packets.

use super::difference::LastSegments;
use super::half_vector::{Copies, Departures};
use super::offsets::{OffsetSurfaces, SurfacePacket};
use super::segment::{NextVertices, ShiftContext};
use super::states::{Kind, States};
use crate::math::lanes::{Bits, LANES, Lanes, Lanes3, Mask};
use crate::render::vertices::Vertices;
use crate::scene::bsdf::Lobe;
use crate::scene::packet::{Rays, Surfaces};
use crate::scene::{Purpose, Scene};

/// An offset that is to leave its vertex by a half-vector copy.
#[derive(Clone, Copy)]
struct Request {
    /// Number of the half-edge among those of its path.
    slot: usize,
    /// Lane of its base path.
    lane: usize,
    /// Index of the vertex that it leaves.
    vertex_index: u32,
}

/// Whatever base paths leave their vertices for.
#[derive(Clone, Copy, PartialEq)]
enum Aim {
    /// The sampled emitter points.
    Light,
    /// The sampled directions.
    Scatter,
}

/// Offsets across one half-edge of sixteen base paths behind half-vector copies.
#[derive(Clone)]
#[repr(align(64))]
pub struct Extended {
    /// Lanes whose offset's material scatters so.
    pub possible: Mask,
    /// f cos, or the factor of a delta lobe, times dω' / dω.
    pub value: Lanes3,
    /// Density per solid angle, or probability of a delta lobe, times dω' / dω.
    pub pdf: Lanes,
    /// Lanes whose offset reaches a vertex.
    pub hit: Mask,
    /// Index of that vertex.
    pub vertex_index: Bits,
    /// Lanes whose vertex counts as diffuse.
    pub diffuse: Mask,
    /// Light that is received from an emitter where the base path's segment ends on one.
    pub ends: LastSegments,
}

/// The extended offsets of sixteen base paths, by half-edge; keeps its memory.
#[derive(Default)]
pub struct Extensions {
    requests: Vec<Request>,
    /// Results by aim.
    extended: [Vec<Extended>; 2],
    offset: SurfacePacket,
    reached: SurfacePacket,
    /// Offsets that were extended so far.
    pub count: u32,
}

/// No offset is extended.
static NONE: Extended = Extended {
    possible: Mask::NONE,
    value: Lanes3::ZERO,
    pdf: Lanes::ZERO,
    hit: Mask::NONE,
    vertex_index: Bits::ZERO,
    diffuse: Mask::NONE,
    ends: LastSegments::NONE,
};

impl Extensions {
    /// Offsets across a half-edge, for light and for the continuation.
    pub fn get(&self, slot: usize) -> (&Extended, &Extended) {
        let [light, scatter] = &self.extended;
        (light.get(slot).unwrap_or(&NONE), scatter.get(slot).unwrap_or(&NONE))
    }

    /// Extends the offsets that do not connect to emitter points sampled at their base paths' vertices.
    pub fn extend_to_lights<'s>(
        &mut self,
        (context, vertices, active): (&ShiftContext, &Vertices, Mask),
        states: impl Iterator<Item = &'s States>,
        offsets: &mut OffsetSurfaces,
    ) {
        // Nothing but next-event estimation samples an emitter of a single point, whatever the materials.
        let lit = active & vertices.lit & !vertices.light.points.delta;
        let base_diffuse = context.diffuse(vertices.materials.roughness());
        for (slot, states) in states.enumerate() {
            let unconnected = lit & states.are(Kind::Unconnected);
            let connected = offsets.diffuse(context, states, unconnected & base_diffuse);
            self.request(slot, states, unconnected & !connected);
        }
        self.extend(context, vertices, Aim::Light, offsets);
    }

    /// Extends the offsets that do not connect to their base paths' next vertices, or not for everything there.
    pub fn extend_to_vertices<'s>(
        &mut self,
        (context, vertices, active): (&ShiftContext, &Vertices, Mask),
        next: &NextVertices,
        states: impl Iterator<Item = &'s States>,
        offsets: &mut OffsetSurfaces,
    ) {
        let leaving = context.leaving(vertices, next, active);
        let smooth = vertices.scatters.are(Lobe::Smooth);
        let base_diffuse = context.diffuse(vertices.materials.roughness()) & smooth;
        let glossy = next.glossy_light | next.glossy_scatter;
        for (slot, states) in states.enumerate() {
            let unconnected = leaving & states.are(Kind::Unconnected);
            let connectable = offsets.diffuse(context, states, unconnected & base_diffuse);
            self.request(slot, states, unconnected & (!connectable | glossy));
        }
        self.extend(context, vertices, Aim::Scatter, offsets);
    }

    fn request(&mut self, slot: usize, states: &States, lanes: Mask) {
        let requests = lanes.lanes().map(|lane| Request { slot, lane, vertex_index: states.vertex_index.0[lane] });
        self.requests.extend(requests);
    }

    /// Serves all requests, sixteen at a time.
    fn extend(&mut self, context: &ShiftContext, vertices: &Vertices, aim: Aim, offsets: &mut OffsetSurfaces) {
        let requests = std::mem::take(&mut self.requests);
        let extended = &mut self.extended[aim as usize];
        extended.clear();
        if let Some(last) = requests.last() {
            extended.resize(last.slot + 1, NONE.clone());
        }
        self.count += requests.len() as u32;
        for packet in requests.chunks(LANES) {
            self.extend_packet(context, vertices, (aim, packet), offsets);
        }
        self.requests = requests;
        self.requests.clear();
    }

    fn extend_packet(
        &mut self,
        context: &ShiftContext,
        vertices: &Vertices,
        (aim, requests): (Aim, &[Request]),
        offsets: &mut OffsetSurfaces,
    ) {
        let Self { offset, reached, .. } = self;
        let scene = context.scene;
        let mut lanes = [0; LANES];
        for (to, request) in requests.iter().enumerate() {
            offset.copy(to, offsets.at(context.base, request.vertex_index));
            lanes[to] = request.lane;
        }
        let lanes = &lanes[..requests.len()];
        let copies = Copies::new(scene, &departures(vertices, lanes, aim), offset);
        let rays = rays(&offset.surfaces, copies.wo);
        let (first, reached) = match aim {
            Aim::Light => (0, reached),
            Aim::Scatter => offsets.next_packet(context.base.len()),
        };
        let hit = scene.intersect_packet(&rays, copies.possible, Purpose::Extension, &mut reached.surfaces);
        let mut diffuse = Mask::NONE;
        if aim == Aim::Scatter {
            reached.materials.evaluate(scene, &reached.surfaces, hit);
            diffuse = context.diffuse(reached.materials.roughness());
        }
        let ends = ends(scene, (vertices, lanes, aim), (&offset.surfaces, &copies), (&rays, &reached.surfaces, hit));
        for (from, &Request { slot, lane: to, .. }) in requests.iter().enumerate() {
            let extended = &mut self.extended[aim as usize][slot];
            extended.possible.set(to, copies.possible.get(from));
            extended.value.set(to, copies.value.get(from));
            extended.pdf.0[to] = copies.pdf.0[from];
            extended.hit.set(to, hit.get(from));
            extended.vertex_index.0[to] = first + from as u32;
            extended.diffuse.set(to, diffuse.get(from));
            extended.ends.copy(to, &ends, from);
        }
    }
}

/// How some base paths leave their vertices.
fn departures<'a>(vertices: &'a Vertices, lanes: &'a [usize], aim: Aim) -> Departures<'a> {
    let Vertices { surfaces, materials, scatters, light, .. } = vertices;
    let mut left =
        Departures { surfaces, materials, lanes, wi: Lanes3::ZERO, wo: Lanes3::ZERO, lobes: [Lobe::Smooth; LANES] };
    for (to, &lane) in lanes.iter().enumerate() {
        left.wi.set(to, surfaces.wi.get(lane));
        match aim {
            Aim::Light => left.wo.set(to, light.wo.get(lane)),
            Aim::Scatter => {
                left.wo.set(to, scatters.wo.get(lane));
                left.lobes[to] = scatters.lobe(lane);
            }
        }
    }
    left
}

vectorized! {
    /// Rays that leave surfaces along local directions.
    fn rays(surfaces: &Surfaces, wo: Lanes3) -> Rays {
        let direction = surfaces.frame.to_world(wo).normalize_or(Lanes3::ZERO);
        Rays { origin: surfaces.leave(direction), direction, t_far: Lanes::splat(f32::INFINITY) }
    }
}

/// Light that offsets receive from emitters at their ends, where the segments of their base paths end on one: they have to end on
/// an emitter, too, and at infinity only if the base paths do.
fn ends(
    scene: &Scene,
    (vertices, lanes, aim): (&Vertices, &[usize], Aim),
    (from, copies): (&Surfaces, &Copies),
    (rays, surfaces, hit): (&Rays, &Surfaces, Mask),
) -> LastSegments {
    let (points, with_end) = match aim {
        Aim::Light => (&vertices.light.points, vertices.lit),
        Aim::Scatter => (&vertices.emission.points, vertices.hits_emitter),
    };
    let mut ends = LastSegments::NONE;
    let (mut on_surface, mut far) = (Mask::NONE, Mask::NONE);
    for (at, &lane) in lanes.iter().enumerate().filter(|&(at, &lane)| copies.possible.get(at) && with_end.get(lane)) {
        on_surface.set(at, !points.is_far(lane) && hit.get(at));
        far.set(at, points.is_far(lane) && !hit.get(at));
    }
    let envmap = scene.envmap_hits(rays, far);
    for lane in (on_surface | far).lanes() {
        let direction = rays.direction.get(lane);
        let (radiance, light_pdf) = match &envmap {
            Some(envmap) if far.get(lane) => (envmap.radiance.get(lane), envmap.pdf.0[lane]),
            _ => {
                let point =
                    if far.get(lane) { scene.environment(direction) } else { scene.light_point_of(surfaces, lane) };
                let Some(point) = point else { continue };
                (scene.radiance(&point, -direction), scene.emitter_pdf(&scene.receiver(from, lane), &point))
            }
        };
        let light_pdf = if copies.delta.get(lane) { 0.0 } else { light_pdf * copies.jacobian.0[lane] };
        ends.contribution.set(lane, copies.value.get(lane) * radiance);
        ends.density.0[lane] = copies.pdf.0[lane] + light_pdf;
    }
    ends
}
