//! The record of a wave: contributions and features of its paths so far, and their vertices.

use super::continuation::Shaded;
use super::emission::{self, EmitterHit};
use super::features::{self, FeatureWalk};
use super::group_lights::GroupLights;
use super::paths::Packet;
use super::thinning::Work;
use super::vertices::{Emission, Vertices};
use crate::film::{Recorded, Sample};
use crate::math::Rgb;
use crate::math::lanes::{LANES, Mask};
use crate::scene::Scene;

/// The samples of a wave and their paths.
#[derive(Default)]
pub struct PathRecord {
    /// Vertices by depth, sixteen by sixteen. Unless all are kept, the first entry holds those of the latest depth.
    pub levels: Vec<Vec<Vertices>>,
    /// Number of packets on every level of the latest wave.
    pub packets: Vec<usize>,
    /// Contributions and features so far, one sample for each path.
    pub samples: Vec<Sample>,
    /// The contributions of groups of emitters, if they are asked for.
    pub lights: GroupLights,
    /// Work of the latest wave.
    pub work: Work,
    walks: Vec<FeatureWalk>,
}

impl PathRecord {
    /// Starts a wave of `count` paths, with so many groups of emitters.
    pub fn start(&mut self, count: usize, groups: usize) {
        fn reset<T: Default + Clone>(list: &mut Vec<T>, count: usize) {
            list.clear();
            list.resize(count, T::default());
        }
        reset(&mut self.samples, count);
        reset(&mut self.walks, count);
        self.lights.start(count, groups);
        self.packets.clear();
        self.work = Work::default();
    }

    /// Adds the radiance of emitters that paths have hit by scattering, or seen from the camera: surfaces, or the
    /// environment where a path has hit nothing. `recorded` is the level of the vertices if all levels are kept.
    pub fn add_emission(
        &mut self,
        scene: &Scene,
        depth: u32,
        packet: &Packet,
        (vertices, active, hit): (&Vertices, Mask, Mask),
        recorded: Option<usize>,
    ) {
        let emissive = hit & vertices.surfaces.emissive;
        let ends = if scene.has_environment() { active & (!hit | emissive) } else { active & emissive };
        let envmap = scene.envmap_hits(&packet.rays, ends & !hit);
        for lane in ends.lanes() {
            let id = packet.id.0[lane] as usize;
            let Some(found) = emission::emitter_hit(scene, packet, (vertices, lane), (hit.get(lane), envmap.as_ref()))
            else {
                continue;
            };
            if depth == 0 {
                let hidden = scene.integrator().hide_emitters;
                self.samples[id].direct = if hidden { Rgb::ZERO } else { found.radiance };
                self.lights.add_direct(scene, id, (found.point.emitter, self.samples[id].direct));
                continue;
            }
            // Through holes the camera sees the environment as it sees it beside them.
            if scene.integrator().hide_emitters
                && !hit.get(lane)
                && self.samples[id].values.get(Recorded::Alpha) == [0.0]
            {
                continue;
            }
            self.samples[id].color += found.color;
            self.lights.add(scene, id, (found.point.emitter, found.color));
            if let Some(level) = recorded {
                let parent = packet.parent.0[lane] as usize;
                let vertices = &mut self.levels[level - 1][parent / LANES];
                keep_emission(scene, vertices, parent % LANES, found);
            }
        }
    }

    /// Says where the vertices of level `at` lead to: `packet` becomes the vertices from number `first` on of the next level.
    pub fn link(&mut self, at: usize, packet: &Packet, active: Mask, first: u32) {
        for lane in active.lanes() {
            let parent = packet.parent.0[lane] as usize;
            self.levels[at][parent / LANES].next.0[parent % LANES] = first + lane as u32;
        }
    }

    /// Marks the samples of paths that have met something, be it the environment.
    pub fn cover(&mut self, packet: &Packet, lanes: Mask) {
        lanes.lanes().for_each(|lane| self.samples[packet.id.0[lane] as usize].values.set(Recorded::Alpha, [1.0]));
    }

    /// Updates the features by the surfaces that active paths have come to.
    pub fn describe(
        &mut self,
        scene: &Scene,
        depth: u32,
        packet: &Packet,
        (vertices, active, hit): (&Vertices, Mask, Mask),
    ) {
        for lane in active.lanes() {
            let id = packet.id.0[lane] as usize;
            let (walk, sample) = (&mut self.walks[id], &mut self.samples[id]);
            if depth == 0 {
                features::set_far(sample, scene, packet.rays.get(lane));
            }
            if hit.get(lane) && !walk.is_done() {
                let surface = (&vertices.surfaces, &vertices.materials, lane);
                walk.visit(sample, scene, surface, packet.rays.origin.get(lane));
            }
        }
    }

    /// Adds the direct light of some vertices, from next-event estimation, to the colour.
    pub fn add_direct(&mut self, scene: &Scene, vertices: &Vertices, shaded: &Shaded) {
        for lane in vertices.lit.lanes() {
            let (id, color) = (vertices.id.0[lane] as usize, shaded.color.get(lane));
            self.samples[id].color += color;
            self.lights.add(scene, id, (vertices.light.points.emitter(lane), color));
        }
        for lane in shaded.non_finite.lanes() {
            self.samples[vertices.id.0[lane] as usize].color = Rgb::NAN;
        }
    }

    /// Updates features and ambient light of the paths that continue from some vertices.
    pub fn update_after_scatter(&mut self, vertices: &Vertices, ambient: bool) {
        for lane in vertices.scattered.lanes() {
            let id = vertices.id.0[lane] as usize;
            if ambient {
                let throughput = vertices.throughput.get(lane) * vertices.scatters.weight.get(lane);
                self.samples[id].ambient += throughput / vertices.survival.0[lane];
            }
            let same_side = vertices.surfaces.wi.z.0[lane] * vertices.scatters.wo.z.0[lane] > 0.0;
            self.walks[id].leave(&mut self.samples[id].features, same_side);
            if !self.walks[id].is_done() {
                self.walks[id].pass(&vertices.scatters.get(lane));
            }
        }
    }
}

/// Records the emitter that a path has hit with the vertex that it was scattered from.
fn keep_emission(scene: &Scene, parent: &mut Vertices, lane: usize, hit: EmitterHit) {
    parent.hits_emitter.set(lane, true);
    let Emission { points, radiance, light_pdf } = &mut parent.emission;
    scene.keep_light(points, lane, hit.point, (hit.radiance, hit.light_pdf));
    radiance.set(lane, hit.radiance);
    light_pdf.0[lane] = hit.light_pdf;
}
