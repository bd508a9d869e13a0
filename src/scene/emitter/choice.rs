//! Choice of the emitter that next-event estimation samples for a point.

use super::Emitter;
use super::tree::Tree;
use crate::math::Vec3;
use crate::math::alias::Alias;

/// Largest number of emitters that are chosen by power alone; among more, distance counts, too.
const MANY: usize = 100;

/// The chances of a scene's emitters.
pub struct Choice {
    /// Every emitter; of many only those without a position (infinitely far), then the tree of all others.
    table: Alias,
    /// Numbers of the table's emitters, where it has not all.
    listed: Vec<u32>,
    tree: Option<Tree>,
}

impl Choice {
    /// Half of the choices go by power and half are even, so that a weak emitter close by is not starved. `None` when
    /// nothing emits. `factors` are those of the chances of single emitters; one of zero is never chosen.
    pub fn new(emitters: &[Box<dyn Emitter>], factors: &[f32]) -> Option<Self> {
        // Only their ratios count.
        let most = factors.iter().copied().fold(f32::MIN_POSITIVE, f32::max);
        let factors: Vec<f32> = factors.iter().map(|factor| factor / most).collect();
        let powers: Vec<f32> =
            emitters.iter().zip(&factors).map(|(emitter, factor)| emitter.power() * factor).collect();
        let total: f32 = powers.iter().sum();
        let lit: f32 = powers.iter().zip(&factors).filter(|(power, _)| **power > 0.0).map(|(_, factor)| factor).sum();
        let share = |(&power, factor): (&f32, &f32)| {
            if power > 0.0 { 0.5 * factor / lit + 0.5 * (power / total) } else { 0.0 }
        };
        let weights: Vec<_> = powers.iter().zip(&factors).map(share).collect();
        if emitters.len() <= MANY {
            return Some(Self { table: Alias::new(&weights)?, listed: Vec::new(), tree: None });
        }
        let placed = |i: usize| Some((i, emitters[i].extent()?, powers[i])).filter(|&(_, _, power)| power > 0.0);
        let in_tree: Vec<_> = (0..emitters.len()).filter_map(placed).collect();
        let of_tree = in_tree.iter().map(|&(i, ..)| weights[i]).sum();
        let listed: Vec<u32> =
            (0..emitters.len()).filter(|&i| emitters[i].extent().is_none()).map(|i| i as u32).collect();
        let weights: Vec<_> = listed.iter().map(|&i| weights[i as usize]).chain([of_tree]).collect();
        Some(Self { table: Alias::new(&weights)?, listed, tree: Tree::new(in_tree, emitters.len()) })
    }

    /// The emitter that `u` in [0, 1) selects for a point, and its probability.
    #[inline]
    pub fn choose(&self, from: Vec3, u: f32) -> (usize, f32) {
        let (index, rest) = self.table.sample(u);
        let chance = self.table.probability(index);
        let Some(tree) = &self.tree else { return (index, chance) };
        if let Some(&emitter) = self.listed.get(index) {
            return (emitter as usize, chance);
        }
        let (emitter, of_tree) = tree.choose(from, rest);
        (emitter, chance * of_tree)
    }

    /// Chance of an emitter at a point.
    #[inline]
    pub fn probability(&self, from: Vec3, emitter: usize) -> f32 {
        let Some(tree) = &self.tree else { return self.table.probability(emitter) };
        match tree.probability(from, emitter) {
            Some(of_tree) => self.table.probability(self.listed.len()) * of_tree,
            None => {
                let at = self.listed.iter().position(|&listed| listed as usize == emitter);
                at.map_or(0.0, |at| self.table.probability(at))
            }
        }
    }

    /// The chance of an emitter, where it is the same everywhere.
    pub fn constant(&self, emitter: usize) -> Option<f32> {
        self.tree.is_none().then(|| self.table.probability(emitter))
    }
}
