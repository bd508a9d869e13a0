//! Choice of the emitter that next-event estimation samples for a point, and of the triangle of a mesh that emits.

use super::Emitter;
use super::tree::{Extent, Item, Receiver, Tree};
use crate::math::Vec3;
use crate::math::alias::Alias;
use crate::scene::Bounds;

/// Numbers of triangles of a mesh that are chosen one by one: fewer lie close together, more take too much memory.
const TRIANGLES: std::ops::RangeInclusive<usize> = 3..=1 << 16;

/// Emitters and triangles up to which chances do not depend on the place: what a tree gains among few it loses by its time.
const FEW: usize = 16;

/// Share of the choices of emitters in the tree that does not go by place, since what is near may be hidden.
const BLIND: f32 = 0.2;

/// The chances of a scene's emitters.
pub struct Choice {
    /// Every emitter.
    table: Alias,
    near: Option<Near>,
}

/// An emitter as chances see it.
pub struct Candidate<'a> {
    /// The emitter.
    pub emitter: &'a dyn Emitter,
    /// Factor of its chance; one of zero is never chosen.
    pub factor: f32,
    /// Its triangles and their choice by area, if it is a mesh of uniform radiance.
    pub triangles: Option<(&'a [LightTriangle], &'a Alias)>,
}

/// An emissive triangle.
#[derive(Clone, Copy)]
pub struct LightTriangle {
    /// A corner.
    pub corner: Vec3,
    /// Edges from that corner to the other two.
    pub sides: [Vec3; 2],
    /// Unit normal on the emissive side.
    pub n: Vec3,
}

/// An emitter that was chosen.
#[derive(Clone, Copy, Debug)]
pub struct Chosen {
    /// Number of the emitter.
    pub emitter: usize,
    /// Number of its triangle, if these are chosen one by one.
    pub triangle: Option<u32>,
    /// Probability of the emitter; of a triangle as it would be of a whole emitter that is sampled by area with the same density.
    pub chance: f32,
}

/// Emitters that have a place, where these are many.
struct Near {
    /// Chance that one of them is chosen.
    chance: f32,
    /// Emitters that have none.
    others: Option<Alias>,
    /// Emitters that have one, by power alone.
    blind: Alias,
    tree: Tree,
    /// Emitter and triangle of each item of the tree.
    items: Vec<(u32, Option<u32>)>,
    /// Every emitter in the tree, by its number.
    emitters: Vec<Option<Placed>>,
}

/// An emitter in the tree.
struct Placed {
    /// Its item, or that of its first triangle.
    first: u32,
    /// Its triangles by area, if these are chosen one by one.
    areas: Option<Alias>,
}

impl Choice {
    /// Half of the choices go by power and half are even, so that a weak emitter is not starved; of emitters that have a place most go
    /// by what they may send to a point. `None` when nothing emits.
    pub fn new(candidates: &[Candidate]) -> Option<Self> {
        // Only their ratios count.
        let most = candidates.iter().map(|candidate| candidate.factor).fold(f32::MIN_POSITIVE, f32::max);
        let factors: Vec<f32> = candidates.iter().map(|candidate| candidate.factor / most).collect();
        let powers: Vec<f32> =
            candidates.iter().zip(&factors).map(|(candidate, factor)| candidate.emitter.power() * factor).collect();
        let total: f32 = powers.iter().sum();
        let lit: f32 = powers.iter().zip(&factors).filter(|(power, _)| **power > 0.0).map(|(_, factor)| factor).sum();
        let share = |(&power, factor): (&f32, &f32)| {
            if power > 0.0 { 0.5 * factor / lit + 0.5 * (power / total) } else { 0.0 }
        };
        let weights: Vec<f32> = powers.iter().zip(&factors).map(share).collect();
        Some(Self { table: Alias::new(&weights)?, near: Near::new(candidates, &powers, &weights) })
    }

    /// The emitter that `u` in [0, 1) selects for a point; `None` where none shines.
    #[inline(always)]
    pub fn choose(&self, from: &Receiver, u: f32) -> Option<Chosen> {
        match &self.near {
            Some(near) => near.choose(&self.table, from, u),
            None => {
                let (emitter, _) = self.table.sample(u);
                Some(Chosen { emitter, triangle: None, chance: self.table.probability(emitter) })
            }
        }
    }

    /// [`Chosen::chance`] of an emitter at a point, and of the triangle there.
    #[inline]
    pub fn probability(&self, from: &Receiver, emitter: usize, triangle: u32) -> f32 {
        let blind = self.table.probability(emitter);
        match &self.near {
            Some(near) => near.probability(blind, from, emitter, triangle),
            None => blind,
        }
    }

    /// Number of emitters and triangles that are chosen by what they may send to a point.
    pub fn in_tree(&self) -> usize {
        self.near.as_ref().map_or(0, |near| near.items.len())
    }

    /// The chance of an emitter that is the same everywhere.
    pub fn constant(&self, emitter: usize) -> Option<f32> {
        let placed = self.near.as_ref().is_some_and(|near| near.emitters[emitter].is_some());
        (!placed).then(|| self.table.probability(emitter))
    }
}

impl Near {
    /// `None` where these are few.
    fn new(candidates: &[Candidate], powers: &[f32], weights: &[f32]) -> Option<Self> {
        let (mut items, mut owners) = (Vec::new(), Vec::new());
        let mut emitters = Vec::with_capacity(candidates.len());
        for ((number, candidate), &power) in (0u32..).zip(candidates).zip(powers) {
            let Some(extent) = candidate.emitter.extent().filter(|_| power > 0.0) else {
                emitters.push(None);
                continue;
            };
            let first = items.len() as u32;
            let apart = candidate.triangles.as_ref().filter(|(triangles, _)| TRIANGLES.contains(&triangles.len()));
            emitters.push(Some(Placed { first, areas: apart.map(|&(_, areas)| areas.clone()) }));
            let Some((triangles, areas)) = apart else {
                items.push(Item { extent, power });
                owners.push((number, None));
                continue;
            };
            for (k, triangle) in triangles.iter().enumerate() {
                let power = power * areas.probability(k);
                items.push(Item { extent: triangle.extent(extent.reach), power });
                owners.push((number, Some(k as u32)));
            }
        }
        if items.len() <= FEW {
            return None;
        }
        let part = |placed: bool| -> Vec<f32> {
            let weight =
                |(weight, emitter): (&f32, &Option<_>)| if emitter.is_some() == placed { *weight } else { 0.0 };
            weights.iter().zip(&emitters).map(weight).collect()
        };
        let (placed, others) = (part(true), part(false));
        let chance = placed.iter().sum::<f32>() / weights.iter().sum::<f32>();
        Some(Self {
            chance,
            others: Alias::new(&others),
            blind: Alias::new(&placed)?,
            tree: Tree::new(&items)?,
            items: owners,
            emitters,
        })
    }

    #[inline(always)]
    fn choose(&self, table: &Alias, from: &Receiver, u: f32) -> Option<Chosen> {
        if let Some(others) = self.others.as_ref().filter(|_| u >= self.chance) {
            let (emitter, _) = others.sample((u - self.chance) / (1.0 - self.chance));
            return Some(Chosen { emitter, triangle: None, chance: table.probability(emitter) });
        }
        let u = (u / self.chance).min(1.0 - f32::EPSILON / 2.0);
        let (item, of_tree) = if u < BLIND {
            let (emitter, rest) = self.blind.sample(u / BLIND);
            let Placed { first, areas } = self.emitters[emitter].as_ref()?;
            let item = *first as usize + areas.as_ref().map_or(0, |areas| areas.sample(rest).0);
            (item, self.tree.probability(from, item))
        } else {
            self.tree.choose(from, (u - BLIND) / (1.0 - BLIND))?
        };
        let (emitter, triangle) = self.items[item];
        let emitter = emitter as usize;
        Some(Chosen { emitter, triangle, chance: self.mixed(table.probability(emitter), emitter, triangle, of_tree) })
    }

    #[inline]
    fn probability(&self, blind: f32, from: &Receiver, emitter: usize, triangle: u32) -> f32 {
        let Some(Placed { first, areas }) = &self.emitters[emitter] else { return blind };
        let triangle = areas.as_ref().map(|_| triangle);
        let of_tree = self.tree.probability(from, (first + triangle.unwrap_or(0)) as usize);
        self.mixed(blind, emitter, triangle, of_tree)
    }

    /// The chance by both ways, from the one that goes by power over all emitters and the one of the tree.
    #[inline(always)]
    fn mixed(&self, blind: f32, emitter: usize, triangle: Option<u32>, of_tree: f32) -> f32 {
        let areas = self.emitters[emitter].as_ref().and_then(|placed| placed.areas.as_ref());
        // The share of its emitter's area.
        let share = areas.zip(triangle).map_or(1.0, |(areas, triangle)| areas.probability(triangle as usize));
        let by_place = if share > 0.0 { self.chance * of_tree / share } else { 0.0 };
        BLIND * blind + (1.0 - BLIND) * by_place
    }
}

impl LightTriangle {
    fn extent(&self, reach: f32) -> Extent {
        let Self { corner, sides: [a, b], n } = *self;
        Extent { bounds: Bounds::of([corner, corner + a, corner + b]), axis: n, spread: 0.0, reach }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::vec3;
    use crate::scene::Scene;

    /// Four cubes, a bulb and an environment that emit.
    fn scene() -> Scene {
        let cube = |x: i32| {
            format!(
                r#"<shape type="cube"><transform name="to_world"><scale value="0.2"/><translate x="{x}" y="{}"/></transform>
                <emitter type="area"><rgb name="radiance" value="{}"/></emitter></shape>"#,
                x % 3,
                1 + x
            )
        };
        let cubes: String = (1..5).map(cube).collect();
        let text = format!(
            r#"<scene version="3.0.0"><sensor type="perspective"/>{cubes}
            <emitter type="point"><point name="position" x="1" y="1" z="1"/></emitter><emitter type="constant"/></scene>"#
        );
        crate::mitsuba::load_text(&text, &Default::default()).unwrap()
    }

    #[test]
    fn every_triangle_is_chosen_as_often_as_its_density_says() {
        let scene = scene();
        let choice = scene.emitter_choice.as_ref().unwrap();
        let near = choice.near.as_ref().unwrap();
        let mut all: Vec<_> = near.items.iter().map(|&(emitter, triangle)| (emitter as usize, triangle)).collect();
        assert_eq!(all.len(), 4 * 12 + 1);
        all.push((scene.emitters.iter().position(|emitter| emitter.is_environment()).unwrap(), None));
        for (p, n) in
            [(vec3(0.0, 0.0, 0.5), Vec3::ZERO), (vec3(2.0, 1.0, 0.0), Vec3::X), (vec3(-3.0, 5.0, 4.0), -Vec3::Z)]
        {
            let from = Receiver { p, n };
            let share = |&(emitter, triangle): &(usize, Option<u32>)| {
                let areas = near.emitters[emitter].as_ref().and_then(|placed| placed.areas.as_ref());
                let of_emitter =
                    areas.zip(triangle).map_or(1.0, |(areas, triangle)| areas.probability(triangle as usize));
                choice.probability(&from, emitter, triangle.unwrap_or(0)) * of_emitter
            };
            let (draws, mut counts) = (1 << 16, vec![0u32; all.len()]);
            for chosen in (0..draws).filter_map(|k| choice.choose(&from, k as f32 / draws as f32)) {
                assert_eq!(chosen.chance, choice.probability(&from, chosen.emitter, chosen.triangle.unwrap_or(0)));
                counts[all.iter().position(|one| *one == (chosen.emitter, chosen.triangle)).unwrap()] += 1;
            }
            for (one, count) in all.iter().zip(counts) {
                assert!((count as f32 / draws as f32 - share(one)).abs() < 1e-3, "{one:?} {count}");
            }
        }
    }
}
