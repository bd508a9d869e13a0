//! Light of groups of emitters in the samples of a wave.

use crate::film::GroupLight;
use crate::math::Rgb;
use crate::scene::Scene;

/// Light of every group in every sample, sample by sample; nothing where no groups are asked for.
#[derive(Default)]
pub struct GroupLights {
    groups: usize,
    all: Vec<GroupLight>,
}

impl GroupLights {
    /// Starts a wave of so many samples.
    pub fn start(&mut self, samples: usize, groups: usize) {
        self.groups = groups;
        self.all.clear();
        self.all.resize(samples * groups, GroupLight::default());
    }

    /// The light, sample by sample.
    pub fn all(&self) -> &[GroupLight] {
        &self.all
    }

    /// The light of an emitter's group in a sample; none where there are no groups.
    #[inline(always)]
    fn of(&mut self, scene: &Scene, sample: usize, emitter: u32) -> Option<&mut GroupLight> {
        if self.groups == 0 {
            return None;
        }
        self.all.get_mut(self.groups * sample + scene.light_groups().of(emitter))
    }

    /// Adds scattered light of an emitter.
    #[inline(always)]
    pub fn add(&mut self, scene: &Scene, sample: usize, (emitter, color): (u32, Rgb)) {
        if let Some(light) = self.of(scene, sample, emitter) {
            light.color += color;
        }
    }

    /// Adds directly seen light of an emitter.
    #[inline(always)]
    pub fn add_direct(&mut self, scene: &Scene, sample: usize, (emitter, color): (u32, Rgb)) {
        if let Some(light) = self.of(scene, sample, emitter) {
            light.direct += color;
        }
    }

    /// Takes the directly seen light of a sample out.
    pub fn clear_direct(&mut self, sample: usize) {
        let groups = &mut self.all[self.groups * sample..self.groups * (sample + 1)];
        groups.iter_mut().for_each(|light| light.direct = Rgb::ZERO);
    }
}
