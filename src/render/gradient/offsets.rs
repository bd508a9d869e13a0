//! Surfaces of offset paths: the camera's first ones, which neighbours share with base paths, and those that offsets
//! have found by themselves.

use crate::film::EDGES;
use crate::math::lanes::{LANES, Mask};
use crate::math::{Vec2, vec2};
use crate::render::vertices::Vertices;
use crate::render::wave::Views;
use crate::scene::packet::{Materials, Rays, Surfaces};
use crate::scene::{Scene, Surface};

/// Place of an offset without a surface.
pub const NOTHING: u32 = u32::MAX;
/// Place of an offset beyond the image's border.
pub const OUTSIDE: u32 = u32::MAX - 1;

/// Sixteen surfaces with their materials.
#[derive(Clone, Default)]
pub struct Packet {
    /// The surfaces.
    pub surfaces: Surfaces,
    /// Their materials.
    pub materials: Materials,
}

/// All surfaces of offsets in a wave.
#[derive(Default)]
pub struct Offsets {
    own: Vec<Packet>,
    met: Vec<Mask>,
    count: usize,
    /// Places of the first surfaces, by sample and edge.
    first: Vec<[u32; 4]>,
    /// Numbers of pixels in a window around the wave's, row by row: its samples, then what is traced for edges alone.
    window: Vec<u32>,
    beside: Vec<(usize, usize)>,
}

impl Offsets {
    /// Finds the first surfaces of all offsets of a wave whose base paths start in `level`.
    pub fn start(&mut self, scene: &Scene, views: &Views, level: &[Vertices]) {
        self.count = 0;
        self.first.clear();
        if scene.sensor().has_lens() {
            self.trace_all(scene, views);
        } else {
            self.share(scene, views, level);
        }
    }

    /// Where the first surface of an offset is.
    pub fn first(&self, sample: usize, edge: usize) -> u32 {
        self.first[sample][edge]
    }

    /// Keeps another surface; returns its place.
    pub fn push(&mut self, scene: &Scene, base: usize, surface: &Surface) -> u32 {
        let lane = self.count % LANES;
        let packet = self.room();
        packet.surfaces.set(lane, surface);
        let (mut one, mut materials) = (Mask::NONE, Materials::default());
        one.set(lane, true);
        materials.look(scene, &packet.surfaces, one);
        packet.materials.copy(lane, &materials, lane);
        self.count += 1;
        (base * LANES + self.count - 1) as u32
    }

    /// The packet and lane of a place; the base paths' own first vertices are in `level`.
    #[inline(always)]
    pub fn at<'a>(&'a self, level: &'a [Vertices], place: u32) -> (&'a Surfaces, &'a Materials, usize) {
        let (packet, lane) = (place as usize / LANES, place as usize % LANES);
        match level.get(packet) {
            Some(vertices) => (&vertices.surfaces, &vertices.materials, lane),
            None => {
                let Packet { surfaces, materials } = &self.own[packet - level.len()];
                (surfaces, materials, lane)
            }
        }
    }

    fn room(&mut self) -> &mut Packet {
        let packet = self.count / LANES;
        if packet == self.own.len() {
            self.own.push(Packet::default());
            self.met.push(Mask::NONE);
        }
        &mut self.own[packet]
    }

    /// Pinholes look through the same point of all pixels: neighbours' rays are those of the wave's own paths, and a rim of
    /// others.
    fn share(&mut self, scene: &Scene, views: &Views, level: &[Vertices]) {
        let (width, height) = (scene.sensor().width, scene.sensor().height);
        let least = |of: fn(&(usize, usize)) -> usize| views.pixels.iter().map(of).min().unwrap_or(0);
        let most = |of: fn(&(usize, usize)) -> usize| views.pixels.iter().map(of).max().unwrap_or(0);
        let (left, top) = (least(|p| p.0), least(|p| p.1));
        // The window begins one pixel before them, which may be outside the image.
        let columns = most(|p| p.0) - left + 3;
        let rows = most(|p| p.1) - top + 3;
        let cell = |x: usize, y: usize| (y + 1 - top) * columns + x + 1 - left;
        self.window.clear();
        self.window.resize(columns * rows, NOTHING);
        for (number, &(x, y)) in views.pixels.iter().enumerate() {
            self.window[cell(x, y)] = number as u32;
        }
        self.beside.clear();
        let first_own = (level.len() * LANES) as u32;
        for &(x, y) in views.pixels {
            let mut places = [OUTSIDE; 4];
            for (place, (dx, dy)) in places.iter_mut().zip(EDGES) {
                let there = (x as i64 + i64::from(dx), y as i64 + i64::from(dy));
                if there.0 < 0 || there.1 < 0 || there.0 >= width as i64 || there.1 >= height as i64 {
                    continue;
                }
                let there = (there.0 as usize, there.1 as usize);
                let number = &mut self.window[cell(there.0, there.1)];
                if *number == NOTHING {
                    *number = first_own + self.beside.len() as u32;
                    self.beside.push(there);
                }
                *place = *number;
            }
            self.first.push(places);
        }
        let beside = std::mem::take(&mut self.beside);
        let views = Views { pixels: &beside, ..*views };
        for first in (0..beside.len()).step_by(LANES) {
            let rays = views.rays(scene, first, views.hashes(first), Vec2::ZERO);
            self.intersect(scene, &rays, LANES.min(beside.len() - first));
        }
        self.beside = beside;
        for place in self.first.iter_mut().flatten().filter(|place| **place < OUTSIDE) {
            let (packet, lane) = (*place as usize / LANES, *place as usize % LANES);
            let met = level.get(packet).map_or_else(|| self.met[packet - level.len()], |vertices| vertices.met);
            if !met.get(lane) {
                *place = NOTHING;
            }
        }
    }

    /// Through a lens every pixel looks from its own point: offsets need rays of their own.
    fn trace_all(&mut self, scene: &Scene, views: &Views) {
        let (width, height) = (scene.sensor().width as i64, scene.sensor().height as i64);
        let base = views.pixels.len().div_ceil(LANES);
        self.first.resize(views.pixels.len(), [OUTSIDE; 4]);
        for first in (0..views.pixels.len()).step_by(LANES) {
            let hashes = views.hashes(first);
            let count = LANES.min(views.pixels.len() - first);
            for (edge, (dx, dy)) in EDGES.into_iter().enumerate() {
                let rays = views.rays(scene, first, hashes, vec2(dx as f32, dy as f32));
                let packet = base + self.count / LANES;
                let met = self.intersect(scene, &rays, count);
                for (lane, &(x, y)) in views.pixels[first..].iter().take(count).enumerate() {
                    let there = (x as i64 + i64::from(dx), y as i64 + i64::from(dy));
                    let inside = there.0 >= 0 && there.1 >= 0 && there.0 < width && there.1 < height;
                    let place = if met.get(lane) { (packet * LANES + lane) as u32 } else { NOTHING };
                    self.first[first + lane][edge] = if inside { place } else { OUTSIDE };
                }
            }
        }
    }

    fn intersect(&mut self, scene: &Scene, rays: &Rays, count: usize) -> Mask {
        let packet = self.room();
        let mut met = scene.intersect_packet(rays, Mask::first(count), true, &mut packet.surfaces);
        if scene.integrator().hide_emitters {
            scene.pass_emitters(rays, &mut met, &mut packet.surfaces);
        }
        packet.materials.look(scene, &packet.surfaces, met);
        let at = self.count / LANES;
        self.met[at] = met;
        self.count += LANES;
        met
    }
}
