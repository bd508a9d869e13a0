//! Surfaces of offset paths: their camera hits, most of which are those of neighbouring base paths, and the hits of
//! unconnected offsets.

use crate::math::lanes::{LANES, Mask};
use crate::render::camera::CameraSamples;
use crate::render::half_edges::HalfEdges;
use crate::render::vertices::Vertices;
use crate::scene::packet::{Materials, Rays, Surfaces};
use crate::scene::{Scene, Surface};

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

/// All surfaces of the offsets of a wave. A vertex index counts the camera hits of the base paths first, then the surfaces
/// that were traced for offsets.
#[derive(Default)]
pub struct OffsetSurfaces {
    traced: Vec<SurfacePacket>,
    hits: Vec<Mask>,
    /// Lanes of `traced` that are in use, including those of packets that are not full.
    lanes_used: usize,
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
    pub fn start(&mut self, scene: &Scene, camera: &CameraSamples, edges: &HalfEdges, level: &[Vertices]) {
        self.lanes_used = 0;
        self.slots = edges.most();
        self.first.clear();
        self.first.resize(camera.pixels.len() * self.slots, OUT_OF_FILM);
        if scene.sensor().has_lens() {
            self.trace_all(scene, camera, edges);
        } else {
            self.reuse_camera_hits(scene, camera, edges, level);
        }
    }

    /// Vertex index of an offset's camera hit, [`MISS`] or [`OUT_OF_FILM`].
    pub fn first(&self, sample: usize, slot: usize) -> u32 {
        self.first[sample * self.slots + slot]
    }

    /// Keeps the hit of an unconnected offset and returns its vertex index; `base` is the number of packets of camera hits.
    pub fn push(&mut self, scene: &Scene, base: usize, surface: &Surface) -> u32 {
        let lane = self.lanes_used % LANES;
        let packet = self.next_packet();
        packet.surfaces.set(lane, surface);
        let (mut one, mut materials) = (Mask::NONE, Materials::default());
        one.set(lane, true);
        materials.evaluate(scene, &packet.surfaces, one);
        packet.materials.copy(lane, &materials, lane);
        self.lanes_used += 1;
        (base * LANES + self.lanes_used - 1) as u32
    }

    /// The surface at a vertex index, as packet and lane; `level` holds the camera hits of the base paths.
    #[inline(always)]
    pub fn at<'a>(&'a self, level: &'a [Vertices], vertex_index: u32) -> (&'a Surfaces, &'a Materials, usize) {
        let (packet, lane) = (vertex_index as usize / LANES, vertex_index as usize % LANES);
        match level.get(packet) {
            Some(vertices) => (&vertices.surfaces, &vertices.materials, lane),
            None => {
                let SurfacePacket { surfaces, materials } = &self.traced[packet - level.len()];
                (surfaces, materials, lane)
            }
        }
    }

    fn next_packet(&mut self) -> &mut SurfacePacket {
        let packet = self.lanes_used / LANES;
        if packet == self.traced.len() {
            self.traced.push(SurfacePacket::default());
            self.hits.push(Mask::NONE);
        }
        &mut self.traced[packet]
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
                let packet = base + self.lanes_used / LANES;
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
        let packet = self.next_packet();
        let mut hit = scene.intersect_packet(rays, Mask::first(count), true, &mut packet.surfaces);
        if scene.integrator().pass_emitters {
            scene.pass_emitters(rays, &mut hit, &mut packet.surfaces);
        }
        packet.materials.evaluate(scene, &packet.surfaces, hit);
        let at = self.lanes_used / LANES;
        self.hits[at] = hit;
        self.lanes_used += LANES;
        hit
    }
}
