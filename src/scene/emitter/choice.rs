//! Which emitter lights a point.

use super::Emitter;
use crate::math::Vec3;
use crate::math::alias::Alias;

/// The chances of a scene's emitters.
pub struct Choice {
    table: Alias,
}

impl Choice {
    /// Half of the choices go by power and half are even, so that a weak emitter close by is not starved. `None` when
    /// nothing emits.
    pub fn new(emitters: &[Box<dyn Emitter>]) -> Option<Self> {
        let powers: Vec<f32> = emitters.iter().map(|emitter| emitter.power()).collect();
        let total: f32 = powers.iter().sum();
        let lit = powers.iter().filter(|&&power| power > 0.0).count() as f32;
        let share = |power: f32| if power > 0.0 { 0.5 / lit + 0.5 * (power / total) } else { 0.0 };
        let weights: Vec<_> = powers.into_iter().map(share).collect();
        Some(Self { table: Alias::new(&weights)? })
    }

    /// The emitter that `u` in [0, 1) stands for at a point, and its chance.
    #[inline]
    pub fn choose(&self, _from: Vec3, u: f32) -> (usize, f32) {
        let (index, _) = self.table.sample(u);
        (index, self.table.probability(index))
    }

    /// Chance of an emitter at a point.
    #[inline]
    pub fn probability(&self, _from: Vec3, emitter: usize) -> f32 {
        self.table.probability(emitter)
    }

    /// The chance of an emitter, where it is the same everywhere.
    pub fn constant(&self, emitter: usize) -> Option<f32> {
        Some(self.table.probability(emitter))
    }
}
