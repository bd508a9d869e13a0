//! The path tracer: follows the paths of a wave from vertex to vertex, all of them together.

use super::Sampler;
use super::camera::CameraSamples;
use super::continuation::shade;
use super::direct::DirectLight;
use super::paths::{Order, Packet, Paths};
use super::record::PathRecord;
use super::vertices::Vertices;
use crate::film::{Needs, Recorded};
use crate::math::Rgb;
use crate::math::lanes::{LANES, Lanes, Lanes3, Mask};
use crate::scene::closure::KINDS;
use crate::scene::packet::Hits;
use crate::scene::{Integrator, Purpose, Scene};

/// Traces waves of paths; keeps its memory between them.
pub struct PathTracer<'a> {
    /// The scene.
    pub scene: &'a Scene,
    needs: Needs,
    paths: Paths,
    next: Paths,
    order: Order,
    direct: DirectLight,
}

impl<'a> PathTracer<'a> {
    /// A tracer that computes what a film with these needs records.
    pub fn new(scene: &'a Scene, needs: Needs) -> Self {
        let (paths, next) = (Paths::default(), Paths::default());
        Self { scene, needs, paths, next, order: Order::default(), direct: DirectLight::default() }
    }

    /// Traces paths from the camera samples. `keep_all`: record the vertices of all depths instead of the latest only.
    pub fn trace(&mut self, camera: &CameraSamples, keep_all: bool, record: &mut PathRecord) {
        self.trace_from(camera, &[], keep_all, record);
    }

    /// Traces paths from as many pixels beside the camera samples as `steps` says, one for each.
    pub fn trace_beside(&mut self, camera: &CameraSamples, steps: &[(i32, i32)], record: &mut PathRecord) {
        self.trace_from(camera, steps, false, record);
    }

    fn trace_from(&mut self, camera: &CameraSamples, steps: &[(i32, i32)], keep_all: bool, record: &mut PathRecord) {
        // Light groups are not recorded on offset paths.
        let groups = if steps.is_empty() { self.needs.lights } else { 0 };
        record.start(camera.pixels.len(), usize::from(groups));
        self.start(camera, steps);
        let mut depth = 0;
        while self.paths.len() > 0 {
            record.packets.push(self.paths.len().div_ceil(LANES));
            record.work.paths += self.paths.len() as f32;
            let level = if keep_all { depth } else { 0 };
            self.advance(camera.sampler, depth as u32, (level, keep_all), record);
            std::mem::swap(&mut self.paths, &mut self.next);
            depth += 1;
        }
    }

    /// Starts a path at every camera sample, or beside it.
    fn start(&mut self, camera: &CameraSamples, steps: &[(i32, i32)]) {
        let count = camera.pixels.len();
        self.paths.clear();
        for first in (0..count).step_by(LANES) {
            let hash = camera.hashes(first);
            let rays = camera.rays(self.scene, first, hash, steps.get(first..).unwrap_or_default());
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

    /// Takes all paths to their next vertices, which become level `at` of the record, and scatters them there. Behind the
    /// camera's surfaces, paths are sorted by the kinds of material that they have come to.
    fn advance(&mut self, sampler: Sampler, depth: u32, (at, keep_all): (usize, bool), record: &mut PathRecord) {
        let Self { scene, needs, paths, next, order, direct } = self;
        if record.levels.len() == at {
            record.levels.push(Vec::new());
        }
        let mut level = std::mem::take(&mut record.levels[at]);
        level.resize_with(level.len().max(paths.len().div_ceil(LANES)), Vertices::default);
        next.clear();
        order.hits.clear();
        let purpose = if depth == 0 { Purpose::Camera } else { Purpose::Path };
        let hits = paths.packets().map(|(packet, active)| scene.hits_of_packet(&packet.rays, active, purpose));
        order.hits.extend(hits);
        let sorted = depth > 0 && order.sort(paths.len(), KINDS, |hits, lane| scene.kind_of_hit(hits, lane));
        let mut gathered = (Packet::EMPTY, order.hits[0]);
        for (k, (packet, active)) in paths.packets().enumerate() {
            let vertices = &mut level[k];
            let (packet, hits) = if sorted {
                order.gather(k, paths, &mut gathered);
                if keep_all {
                    record.link(at - 1, &gathered.0, active, (k * LANES) as u32);
                }
                (&gathered.0, &gathered.1)
            } else {
                (packet, &order.hits[k])
            };
            arrive((scene, *needs), depth, (packet, hits, active), (vertices, keep_all.then_some(at)), record);
            if !vertices.hit.any() {
                continue;
            }
            let shaded = shade((scene, &sampler), depth, packet, vertices, (k * LANES) as u32, next);
            direct.hold(scene, (k, vertices), shaded);
            if needs.has(Recorded::Alpha) || scene.integrator().hide_emitters {
                record.cover(packet, vertices.hit & !vertices.passed);
            }
            if needs.describe_surfaces() || needs.has(Recorded::Ambient) {
                record.update_after_scatter(vertices, needs.has(Recorded::Ambient));
            }
        }
        direct.add(scene, &mut level, record);
        record.levels[at] = level;
    }
}

/// Completes the hits of the active paths of a packet, records emission and features, and leaves in `vertices.hit` the surfaces that
/// paths may scatter at.
fn arrive(
    (scene, needs): (&Scene, Needs),
    depth: u32,
    (packet, hits, active): (&Packet, &Hits, Mask),
    (vertices, recorded): (&mut Vertices, Option<usize>),
    record: &mut PathRecord,
) {
    let Integrator { max_depth, hide_emitters, pass_emitters, .. } = scene.integrator();
    let mut hit = scene.surfaces_of_packet(&packet.rays, hits, active, &mut vertices.surfaces);
    if depth == 0 && pass_emitters {
        scene.pass_emitters(&packet.rays, &mut hit, &mut vertices.surfaces);
    }
    if max_depth > 0 {
        record.add_emission(scene, depth, packet, (vertices, active, hit), recorded);
    }
    vertices.materials.evaluate(scene, &vertices.surfaces, hit);
    if needs.describe_surfaces() {
        record.describe(scene, depth, packet, (vertices, active, hit));
    }
    if needs.has(Recorded::Alpha) && depth == 0 && scene.has_environment() && !hide_emitters {
        record.cover(packet, active);
    }
    vertices.hits_emitter = Mask::NONE;
    if depth + 1 >= max_depth {
        vertices.hit = Mask::NONE;
        if needs.has(Recorded::Alpha) {
            record.cover(packet, hit);
        }
        return;
    }
    (vertices.hit, vertices.id, vertices.throughput) = (hit, packet.id, packet.throughput);
}
