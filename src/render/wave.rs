//! The same sample of many pixels, traced together.

use super::features::{self, FeatureWalk};
use super::gradient::Gradient;
use super::path::Shaded;
use super::paths::{Packet, Paths};
use super::vertices::{Emission, Vertices};
use super::{Sampler, path};
use crate::film::{Needs, Sample};
use crate::math::lanes::{Bits, LANES, Lanes, Lanes3, Mask};
use crate::math::{Rgb, Vec2, vec2};
use crate::render::gradient::shift::Shift;
use crate::scene::packet::Rays;
use crate::scene::{Integrator, Scene};

/// Traces waves; keeps its room between them.
pub struct Wave<'a> {
    scene: &'a Scene,
    needs: Needs,
    gradient: Option<Gradient>,
    paths: Paths,
    onward: Paths,
    traced: Traced,
}

/// What paths have left behind.
#[derive(Default)]
pub struct Traced {
    /// Vertices by depth, sixteen by sixteen; without recording those of the latest depth alone.
    pub levels: Vec<Vec<Vertices>>,
    /// Number of packets on each level of the latest wave.
    pub packets: Vec<usize>,
    /// Samples, as far as they are known.
    pub samples: Vec<Sample>,
    /// Number of leading vertices that light reaches, of every sample's path.
    pub reach: Vec<u32>,
    walks: Vec<FeatureWalk>,
}

/// The pixels of a wave and the numbers they have in common.
#[derive(Clone, Copy)]
pub struct Views<'a> {
    /// The numbers.
    pub sampler: Sampler,
    /// Columns and rows.
    pub pixels: &'a [(usize, usize)],
    /// Position within the pixels.
    pub film: Vec2,
    /// Columns of the film.
    pub width: usize,
}

impl Views<'_> {
    /// What tells the random numbers of sixteen pixels from others', from number `first` on.
    pub fn hashes(&self, first: usize) -> Bits {
        let mut hashes = Bits::ZERO;
        for (hash, &(x, y)) in hashes.0.iter_mut().zip(&self.pixels[first..]) {
            *hash = self.sampler.hash((y * self.width + x) as u64);
        }
        hashes
    }

    /// Camera rays of those pixels, `step` pixels beside them.
    pub fn rays(&self, scene: &Scene, first: usize, hashes: Bits, step: Vec2) -> Rays {
        let mut at = [Lanes::ZERO; 2];
        for (lane, &(x, y)) in self.pixels[first..].iter().take(LANES).enumerate() {
            let film = vec2(x as f32, y as f32) + self.film + step;
            (at[0].0[lane], at[1].0[lane]) = film.into();
        }
        let sensor = scene.sensor();
        let lens = if sensor.has_lens() { self.sampler.lens(hashes) } else { [Lanes::ZERO; 2] };
        sensor.rays(at, lens)
    }
}

impl<'a> Wave<'a> {
    /// Waves that compute what a film needs.
    pub fn new(scene: &'a Scene, needs: Needs, shift: Shift) -> Self {
        let gradient = needs.edges.then(|| Gradient::new(shift, needs.ambient));
        Self { scene, needs, gradient, paths: Paths::default(), onward: Paths::default(), traced: Traced::default() }
    }

    /// Sample number `index` of some pixels, in their order.
    pub fn trace(&mut self, seed: u64, index: u32, pixels: &[(usize, usize)]) -> &[Sample] {
        let sampler = Sampler::new(seed, index);
        let views = Views { sampler, pixels, film: sampler.film(), width: self.scene.sensor().width };
        let record = self.gradient.as_ref().is_some_and(Gradient::needs_vertices);
        self.follow(&views, Vec2::ZERO, record);
        match self.gradient.take() {
            Some(mut gradient) if gradient.needs_vertices() => {
                gradient.shift(self.scene, &views, &mut self.traced);
                self.gradient = Some(gradient);
            }
            Some(gradient) => {
                self.replay(&views);
                self.gradient = Some(gradient);
            }
            None => {}
        }
        if self.needs.occlusion {
            for (first, samples) in self.traced.samples.chunks_mut(LANES).enumerate() {
                let [u, v] = sampler.occlusion(views.hashes(first * LANES));
                for (lane, sample) in samples.iter_mut().enumerate() {
                    let numbers = vec2(u.0[lane], v.0[lane]);
                    sample.features.occlusion = features::occlusion(self.scene, &sample.features, numbers);
                }
            }
        }
        &self.traced.samples
    }

    /// Differences to the neighbours' paths of the same random numbers. Both ends sample every pair: each counts half.
    fn replay(&mut self, views: &Views) {
        let mut samples = std::mem::take(&mut self.traced.samples);
        let (width, height) = (self.scene.sensor().width, self.scene.sensor().height);
        for (edge, step) in crate::film::EDGES.into_iter().enumerate() {
            self.follow(views, vec2(step.0 as f32, step.1 as f32), false);
            for ((sample, there), &(x, y)) in samples.iter_mut().zip(&self.traced.samples).zip(views.pixels) {
                if x.checked_add_signed(step.0 as isize).is_some_and(|x| x < width)
                    && y.checked_add_signed(step.1 as isize).is_some_and(|y| y < height)
                {
                    sample.edges[edge] = 0.5 * (there.color - sample.color);
                    sample.ambient.edges[edge] = 0.5 * (there.ambient.color - sample.ambient.color);
                }
            }
        }
        self.traced.samples = samples;
    }

    /// Traces the paths of pixels from `step` beside them. `record`: keep all vertices.
    fn follow(&mut self, views: &Views, step: Vec2, record: bool) {
        self.start(views, step);
        self.traced.packets.clear();
        let mut depth = 0;
        while self.paths.len() > 0 {
            self.traced.packets.push(self.paths.len().div_ceil(LANES));
            let at = if record { depth } else { 0 };
            self.advance(views.sampler, depth as u32, at, record);
            std::mem::swap(&mut self.paths, &mut self.onward);
            depth += 1;
        }
    }

    fn start(&mut self, views: &Views, step: Vec2) {
        let count = views.pixels.len();
        let traced = &mut self.traced;
        traced.samples.clear();
        traced.samples.resize(count, Sample::default());
        traced.reach.clear();
        traced.reach.resize(count, 0);
        traced.walks.clear();
        traced.walks.resize(count, FeatureWalk::default());
        self.paths.clear();
        for first in (0..count).step_by(LANES) {
            let hash = views.hashes(first);
            let rays = views.rays(self.scene, first, hash, step);
            for lane in 0..LANES.min(count - first) {
                let (packet, _) = self.paths.push();
                packet.id.0[lane] = (first + lane) as u32;
                if lane == 0 {
                    (packet.rays, packet.hash) = (rays, hash);
                    (packet.throughput, packet.eta) = (Lanes3::splat(Rgb::ONE), Lanes::splat(1.0));
                }
            }
        }
    }

    /// Takes all paths to their next vertices and chooses where they go on; vertices are kept as level `at`.
    fn advance(&mut self, sampler: Sampler, depth: u32, at: usize, record: bool) {
        let Self { scene, needs, paths, onward, traced, .. } = self;
        let Integrator { max_depth, hide_emitters, .. } = scene.integrator();
        let describes = needs.features || needs.occlusion || needs.position;
        if traced.levels.len() == at {
            traced.levels.push(Vec::new());
        }
        let mut level = std::mem::take(&mut traced.levels[at]);
        level.resize_with(level.len().max(paths.len().div_ceil(LANES)), Vertices::default);
        onward.clear();
        for (k, (packet, active)) in paths.packets().enumerate() {
            let vertices = &mut level[k];
            let mut met = scene.intersect_packet(&packet.rays, active, depth == 0, &mut vertices.surfaces);
            if depth == 0 && hide_emitters {
                scene.pass_emitters(&packet.rays, &mut met, &mut vertices.surfaces);
            }
            if max_depth > 0 {
                traced.end_on_emitters(scene, depth, packet, (vertices, active, met), record.then_some(at));
            }
            vertices.materials.look(scene, &vertices.surfaces, met);
            if describes {
                traced.describe(scene, depth, packet, (vertices, active, met));
            }
            vertices.emits = Mask::NONE;
            if depth + 1 >= max_depth {
                vertices.met = Mask::NONE;
                continue;
            }
            (vertices.met, vertices.id, vertices.throughput) = (met, packet.id, packet.throughput);
            let first_place = (k * LANES) as u32;
            let shaded = path::shade((scene, &sampler), depth, packet, vertices, first_place, onward);
            traced.keep(depth, vertices, &shaded);
            if describes || needs.ambient {
                traced.pass_on(vertices, needs.ambient);
            }
        }
        traced.levels[at] = level;
    }
}

impl Traced {
    /// Adds the emitters that the active ones of some paths have run into, by surfaces or, where none is met, by what is
    /// around the scene. `recorded` is the level of the vertices, where those before are kept.
    fn end_on_emitters(
        &mut self,
        scene: &Scene,
        depth: u32,
        packet: &Packet,
        (vertices, active, met): (&Vertices, Mask, Mask),
        recorded: Option<usize>,
    ) {
        let glows = met & vertices.surfaces.glows;
        let ends = if scene.has_environment() { active & (!met | glows) } else { active & glows };
        for lane in ends.lanes() {
            let id = packet.id.0[lane] as usize;
            let Some(found) = path::emission(scene, packet, vertices, lane, met.get(lane)) else { continue };
            if depth == 0 {
                let hidden = scene.integrator().hide_emitters;
                self.samples[id].direct = if hidden { Rgb::ZERO } else { found.radiance };
                continue;
            }
            self.samples[id].color += found.color;
            self.reach[id] = depth;
            if let Some(level) = recorded {
                let (place, lane) = (packet.parent.0[lane] as usize / LANES, packet.parent.0[lane] as usize % LANES);
                let parent = &mut self.levels[level - 1][place];
                parent.emits.set(lane, true);
                let Emission { points, radiance, light_pdf } = &mut parent.emission;
                scene.keep_light(points, lane, found.point, (found.radiance, found.light_pdf));
                radiance.set(lane, found.radiance);
                light_pdf.0[lane] = found.light_pdf;
            }
        }
    }

    /// Tells the features of what the active ones of some paths show.
    fn describe(
        &mut self,
        scene: &Scene,
        depth: u32,
        packet: &Packet,
        (vertices, active, met): (&Vertices, Mask, Mask),
    ) {
        for lane in active.lanes() {
            let id = packet.id.0[lane] as usize;
            let (walk, features) = (&mut self.walks[id], &mut self.samples[id].features);
            if depth == 0 {
                *features = features::far(scene, packet.rays.get(lane));
            }
            if met.get(lane) && !walk.is_done() {
                let surface = (&vertices.surfaces, &vertices.materials, lane);
                walk.visit(features, scene, surface, packet.rays.origin.get(lane));
            }
        }
    }

    /// Adds the light that has been chosen at some vertices.
    fn keep(&mut self, depth: u32, vertices: &Vertices, shaded: &Shaded) {
        for lane in vertices.lit.lanes() {
            let id = vertices.id.0[lane] as usize;
            self.samples[id].color += shaded.color.get(lane);
            self.reach[id] = depth + 1;
        }
        for lane in shaded.broken.lanes() {
            self.samples[vertices.id.0[lane] as usize].color = Rgb::NAN;
        }
    }

    /// Paths go on from some vertices: by what features see through, and to where an ambient light would be.
    fn pass_on(&mut self, vertices: &Vertices, ambient: bool) {
        for lane in vertices.scattered.lanes() {
            let id = vertices.id.0[lane] as usize;
            if ambient {
                let beyond = vertices.throughput.get(lane) * vertices.scatters.weight.get(lane);
                self.samples[id].ambient.color += beyond / vertices.survival.0[lane];
            }
            if !self.walks[id].is_done() {
                self.walks[id].pass(&vertices.scatters.get(lane));
            }
        }
    }
}
