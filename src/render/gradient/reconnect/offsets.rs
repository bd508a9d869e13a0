//! Surfaces of offset paths: their camera hits, most of which are those of neighbouring base paths, and the hits of
//! unconnected offsets.

use super::segment::ShiftContext;
use super::states::States;
use crate::math::lanes::{Bits, LANES, Lanes, Mask};
use crate::render::camera::CameraSamples;
use crate::render::half_edges::HalfEdges;
use crate::render::vertices::Vertices;
use crate::scene::packet::{Materials, Rays, Surfaces};
use crate::scene::{Purpose, Scene};

/// Vertex index of an offset that hits nothing, and of pixels of the window without an index yet.
pub const MISS: u32 = u32::MAX;
/// Vertex index of an offset whose pixel lies outside the film.
pub const OUT_OF_FILM: u32 = u32::MAX - 1;

/// Sixteen surfaces with their materials.
#[derive(Clone, Default)]
pub struct SurfacePacket {
    /// The surfaces.
    pub surfaces: Surfaces,
    /// Their materials.
    pub materials: Materials,
}

impl SurfacePacket {
    /// Copies one lane of others.
    #[inline(always)]
    pub fn copy(&mut self, to: usize, (surfaces, materials, lane): (&Surfaces, &Materials, usize)) {
        self.surfaces.copy(to, surfaces, lane);
        self.materials.copy(to, materials, lane);
    }

    /// [`Lanes::copy_beside`](crate::math::lanes::Lanes::copy_beside).
    #[inline(always)]
    fn copy_beside<const STEP: i32>(&mut self, (surfaces, materials): (&Surfaces, &Materials)) {
        self.surfaces.copy_beside::<STEP>(surfaces);
        self.materials.copy_beside::<STEP>(materials);
    }
}

/// Surfaces of the offsets of a wave at one depth. A vertex index counts the camera hits of the base paths first, then those that
/// were traced for offsets, then the surfaces that offsets were extended to.
#[derive(Default)]
pub struct OffsetSurfaces {
    /// Camera hits, and which lanes of them there are.
    camera: Vec<SurfacePacket>,
    hits: Vec<Mask>,
    camera_used: usize,
    /// Vertices of extended offsets at this depth and at the next.
    extended: Vec<SurfacePacket>,
    next: Vec<SurfacePacket>,
    next_used: usize,
    /// Whether all vertices of this depth count as diffuse.
    all_diffuse: bool,
    /// Vertex indices of the camera hits, by sample and number of the half-edge.
    first: Vec<u32>,
    /// Half-edges that there is room for at every sample.
    slots: usize,
    /// Vertex indices of the pixels in a window around the wave's, row by row.
    window: Vec<u32>,
    /// Pixels of the window that the wave has no sample of.
    rim_pixels: Vec<(usize, usize)>,
}

impl OffsetSurfaces {
    /// Finds the camera hits of all offsets of a wave; `level` holds those of the base paths.
    pub fn start(
        &mut self,
        (scene, threshold): (&Scene, f32),
        camera: &CameraSamples,
        edges: &HalfEdges,
        level: &[Vertices],
    ) {
        (self.camera_used, self.next_used) = (0, 0);
        self.slots = edges.most();
        self.first.clear();
        self.first.resize(camera.pixels.len() * self.slots, OUT_OF_FILM);
        if scene.sensor().has_lens() {
            self.trace_all(scene, camera, edges);
        } else {
            self.reuse_camera_hits(scene, camera, edges, level);
        }
        let threshold = Lanes::splat(threshold);
        let glossy = |hit: Mask, materials: &Materials| (hit & !materials.roughness().greater(threshold)).any();
        let camera = self.camera.iter().zip(&self.hits).take(self.camera_used);
        self.all_diffuse = !level.iter().any(|vertices| glossy(vertices.hit, &vertices.materials))
            && !camera.into_iter().any(|(packet, hit)| glossy(*hit, &packet.materials));
    }

    /// Vertex index of an offset's camera hit, [`MISS`] or [`OUT_OF_FILM`].
    pub fn first(&self, sample: usize, slot: usize) -> u32 {
        self.first[sample * self.slots + slot]
    }

    /// Goes on to the next depth: the vertices that offsets were extended to are now theirs.
    pub fn advance(&mut self) {
        std::mem::swap(&mut self.extended, &mut self.next);
        (self.next_used, self.all_diffuse) = (0, false);
    }

    /// Sixteen vertices for extended offsets, and the index of the first; `base` is the number of packets of base paths.
    pub fn next_packet(&mut self, base: usize) -> (u32, &mut SurfacePacket) {
        let packet = self.next_used;
        if packet == self.next.len() {
            self.next.push(SurfacePacket::default());
        }
        self.next_used += 1;
        (((base + self.camera_used + packet) * LANES) as u32, &mut self.next[packet])
    }

    /// Lanes whose offset's vertex counts as diffuse.
    pub fn diffuse(&self, context: &ShiftContext, states: &States, lanes: Mask) -> Mask {
        if self.all_diffuse {
            return lanes;
        }
        let mut diffuse = Mask::NONE;
        for lane in lanes.lanes() {
            let (_, materials, at) = self.at(context.base, states.vertex_index.0[lane]);
            diffuse.set(lane, materials.roughness().0[at] > context.threshold);
        }
        diffuse
    }

    /// Loads the surfaces at some vertex indices; `level` holds the camera hits of the base paths.
    pub fn load(&self, level: &[Vertices], vertex_index: Bits, lanes: Mask, to: &mut SurfacePacket) {
        load(self, level, (vertex_index, lanes), to);
    }

    /// The surface at a vertex index, as packet and lane.
    #[inline(always)]
    pub fn at<'a>(&'a self, level: &'a [Vertices], vertex_index: u32) -> (&'a Surfaces, &'a Materials, usize) {
        let (surfaces, materials) = self.packet(level, vertex_index as usize / LANES);
        (surfaces, materials, vertex_index as usize % LANES)
    }

    #[inline(always)]
    fn packet<'a>(&'a self, level: &'a [Vertices], packet: usize) -> (&'a Surfaces, &'a Materials) {
        let Some(traced) = packet.checked_sub(level.len()) else {
            return (&level[packet].surfaces, &level[packet].materials);
        };
        let SurfacePacket { surfaces, materials } = match traced.checked_sub(self.camera_used) {
            None => &self.camera[traced],
            Some(extended) => &self.extended[extended],
        };
        (surfaces, materials)
    }

    /// With a pinhole the camera ray of an offset is that of the neighbour's base path: only those of the pixels around the
    /// wave's are traced.
    fn reuse_camera_hits(&mut self, scene: &Scene, camera: &CameraSamples, edges: &HalfEdges, level: &[Vertices]) {
        let least = |of: fn(&(usize, usize)) -> usize| camera.pixels.iter().map(of).min().unwrap_or(0);
        let most = |of: fn(&(usize, usize)) -> usize| camera.pixels.iter().map(of).max().unwrap_or(0);
        let (left, top) = (least(|p| p.0), least(|p| p.1));
        // The window starts before them, maybe outside the film.
        let rim = edges.reach();
        let columns = most(|p| p.0) - left + 1 + 2 * rim;
        let rows = most(|p| p.1) - top + 1 + 2 * rim;
        let cell = |x: usize, y: usize| (y + rim - top) * columns + x + rim - left;
        self.window.clear();
        self.window.resize(columns * rows, MISS);
        for (number, &(x, y)) in camera.pixels.iter().enumerate() {
            self.window[cell(x, y)] = number as u32;
        }
        self.rim_pixels.clear();
        let first_traced = (level.len() * LANES) as u32;
        for (sample, &pixel) in camera.pixels.iter().enumerate() {
            for slot in 0..edges.degree(sample) {
                let step = edges.step(sample, slot);
                let Some(there) = step.and_then(|step| camera.neighbour(pixel, step)) else { continue };
                let number = &mut self.window[cell(there.0, there.1)];
                if *number == MISS {
                    *number = first_traced + self.rim_pixels.len() as u32;
                    self.rim_pixels.push(there);
                }
                self.first[sample * self.slots + slot] = *number;
            }
        }
        let rim_pixels = std::mem::take(&mut self.rim_pixels);
        let camera = CameraSamples { pixels: &rim_pixels, ..*camera };
        for first in (0..rim_pixels.len()).step_by(LANES) {
            let rays = camera.rays(scene, first, camera.hashes(first), &[]);
            self.intersect(scene, &rays, LANES.min(rim_pixels.len() - first));
        }
        self.rim_pixels = rim_pixels;
        for index in self.first.iter_mut().filter(|index| **index < OUT_OF_FILM) {
            let (packet, lane) = (*index as usize / LANES, *index as usize % LANES);
            let hit = level.get(packet).map_or_else(|| self.hits[packet - level.len()], |vertices| vertices.hit);
            if !hit.get(lane) {
                *index = MISS;
            }
        }
    }

    /// Behind a lens every pixel has its own ray origin, so offsets need camera rays of their own.
    fn trace_all(&mut self, scene: &Scene, camera: &CameraSamples, edges: &HalfEdges) {
        let base = camera.pixels.len().div_ceil(LANES);
        for first in (0..camera.pixels.len()).step_by(LANES) {
            let hashes = camera.hashes(first);
            let count = LANES.min(camera.pixels.len() - first);
            for slot in 0..self.slots {
                let step = |lane: usize| edges.step(first + lane, slot);
                let steps: Vec<_> = (0..count).map(|lane| step(lane).unwrap_or_default()).collect();
                let rays = camera.rays(scene, first, hashes, &steps);
                let packet = base + self.camera_used;
                let hit = self.intersect(scene, &rays, count);
                for (lane, &pixel) in camera.pixels[first..].iter().take(count).enumerate() {
                    let index = if hit.get(lane) { (packet * LANES + lane) as u32 } else { MISS };
                    let inside = step(lane).is_some_and(|step| camera.neighbour(pixel, step).is_some());
                    self.first[(first + lane) * self.slots + slot] = if inside { index } else { OUT_OF_FILM };
                }
            }
        }
    }

    fn intersect(&mut self, scene: &Scene, rays: &Rays, count: usize) -> Mask {
        if self.camera_used == self.camera.len() {
            self.camera.push(SurfacePacket::default());
            self.hits.push(Mask::NONE);
        }
        let packet = &mut self.camera[self.camera_used];
        let mut hit = scene.intersect_packet(rays, Mask::first(count), Purpose::OffsetCamera, &mut packet.surfaces);
        if scene.integrator().pass_emitters {
            scene.pass_emitters(rays, &mut hit, &mut packet.surfaces);
        }
        packet.materials.evaluate(scene, &packet.surfaces, hit);
        self.hits[self.camera_used] = hit;
        self.camera_used += 1;
        hit
    }
}

vectorized! {
    /// Loads surfaces lane by lane, but all at once those that lie side by side as the lanes do: neighbours in a row of pixels, or the
    /// rows above and below.
    fn load(
        offsets: &OffsetSurfaces,
        level: &[Vertices],
        (vertex_index, lanes): (Bits, Mask),
        to: &mut SurfacePacket,
    ) {
        let mut left = lanes;
        // A lane that is neither the first nor the last lies in one packet with its neighbours.
        let middle = LANES / 2;
        let (packet, at) = (vertex_index.0[middle] / LANES as u32, vertex_index.0[middle] % LANES as u32);
        let step = at as i32 - middle as i32;
        if lanes.get(middle) && step.abs() <= 1 {
            let steps = Bits(std::array::from_fn(|lane| vertex_index.0[lane].wrapping_sub(lane as u32)));
            let packets = vertex_index.map(|index| index / LANES as u32);
            left = lanes & !(steps.equal(steps.0[middle]) & packets.equal(packet));
            let from = offsets.packet(level, packet as usize);
            match step {
                0 => to.copy_beside::<0>(from),
                1 => to.copy_beside::<1>(from),
                _ => to.copy_beside::<-1>(from),
            }
        }
        for lane in left.lanes() {
            to.copy(lane, offsets.at(level, vertex_index.0[lane]));
        }
    }
}
