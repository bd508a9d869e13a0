//! Choosing among many emitters by how much they may light a point: a binary tree whose nodes bound what their emitters
//! send there (Conty Estevez and Kulla 2018).

use std::f32::consts::PI;

use crate::math::Vec3;
use crate::scene::Bounds;

/// Bounds of an emitter's positions and directions of emission.
#[derive(Clone, Copy, Debug)]
pub struct Extent {
    /// The box around it.
    pub bounds: Bounds,
    /// Middle of its normals.
    pub axis: Vec3,
    /// Largest angle from there to a normal, at most π.
    pub spread: f32,
    /// Largest angle from a normal that it shines at.
    pub reach: f32,
}

/// An emitter or two groups of them.
#[derive(Clone, Copy, Debug)]
struct Node {
    extent: Extent,
    power: f32,
    parent: u32,
    /// Number of the second child, the first being the next node; of the emitter, if it is one.
    second: u32,
    is_emitter: bool,
}

/// A tree over emitters.
#[derive(Clone, Debug)]
pub struct Tree {
    nodes: Vec<Node>,
    /// Nodes of the emitters by their number; none for those that are not in the tree.
    leaves: Vec<Option<u32>>,
}

impl Tree {
    /// Emitters by number, extent and power; `count` is the number of all in the scene. `None` without any.
    pub fn new(mut emitters: Vec<(usize, Extent, f32)>, count: usize) -> Option<Self> {
        let mut tree = Self { nodes: Vec::with_capacity(2 * emitters.len()), leaves: vec![None; count] };
        if emitters.is_empty() {
            return None;
        }
        tree.build(&mut emitters, u32::MAX);
        Some(tree)
    }

    /// Adds a group, which splits in the middle of its widest direction; returns its number.
    fn build(&mut self, emitters: &mut [(usize, Extent, f32)], parent: u32) -> u32 {
        let number = self.nodes.len() as u32;
        if let [(emitter, extent, power)] = *emitters {
            self.nodes.push(Node { extent, power, parent, second: emitter as u32, is_emitter: true });
            self.leaves[emitter] = Some(number);
            return number;
        }
        let centre = |extent: &Extent| extent.bounds.sphere().0;
        let size = Bounds::of(emitters.iter().map(|(_, extent, _)| centre(extent)));
        let size = size.upper - size.lower;
        let axis = (0..3).fold(0, |widest, axis| if size[axis] > size[widest] { axis } else { widest });
        let middle = emitters.len() / 2;
        emitters.select_nth_unstable_by(middle, |a, b| centre(&a.1)[axis].total_cmp(&centre(&b.1)[axis]));
        let (first, second) = emitters.split_at_mut(middle);
        self.nodes.push(Node { extent: first[0].1, power: 0.0, parent, second: 0, is_emitter: false });
        let first = self.build(first, number);
        let second = self.build(second, number);
        let [a, b] = [first, second].map(|child| self.nodes[child as usize]);
        let node = &mut self.nodes[number as usize];
        (node.extent, node.power, node.second) = (a.extent.union(&b.extent), a.power + b.power, second);
        number
    }

    /// The emitter that `u` in [0, 1) selects for a point, and its probability; zero where no emitter reaches the point.
    pub fn choose(&self, from: Vec3, mut u: f32) -> (usize, f32) {
        let (mut at, mut chance) = (0, 1.0);
        while !self.nodes[at].is_emitter {
            let first = self.first_chance(at, from);
            let Some(first) = first else { return (0, 0.0) };
            (at, u, chance) = if u < first {
                (at + 1, u / first, chance * first)
            } else {
                (self.nodes[at].second as usize, (u - first) / (1.0 - first), chance * (1.0 - first))
            };
            u = u.clamp(0.0, 1.0 - f32::EPSILON / 2.0);
        }
        (self.nodes[at].second as usize, chance)
    }

    /// Chance of an emitter of the tree at a point; `None` for others.
    pub fn probability(&self, from: Vec3, emitter: usize) -> Option<f32> {
        let (mut at, mut chance) = (self.leaves[emitter]?, 1.0);
        while at > 0 {
            let parent = self.nodes[at as usize].parent;
            let first = self.first_chance(parent as usize, from);
            chance *= first.map_or(0.0, |first| if at == parent + 1 { first } else { 1.0 - first });
            at = parent;
        }
        Some(chance)
    }

    /// Chance of a node's first child; `None` when neither shines on the point.
    fn first_chance(&self, node: usize, from: Vec3) -> Option<f32> {
        let [first, second] =
            [node + 1, self.nodes[node].second as usize].map(|child| self.nodes[child].importance(from));
        (first + second > 0.0).then(|| first / (first + second))
    }
}

impl Node {
    /// Power, over the distance squared, times the largest cosine that a normal can have to the point. Inside the sphere
    /// around the emitters distances count as its radius.
    fn importance(&self, from: Vec3) -> f32 {
        let Extent { bounds, axis, spread, reach } = self.extent;
        let (centre, radius) = bounds.sphere();
        let distance = from.distance(centre);
        let width = if distance > radius { (radius / distance).asin() } else { PI };
        let angle = axis.dot((from - centre).normalize_or(axis)).clamp(-1.0, 1.0).acos();
        // Rounding must not hide emission along the cone's rim.
        let closest = (angle - spread - width - 1e-3).max(0.0);
        // Something is left of every distance, so that chances are numbers even at the light itself.
        let squared = distance.max(radius).powi(2).max(1e-20);
        if closest >= reach { 0.0 } else { self.power * closest.min(1.5).cos() / squared }
    }
}

impl Extent {
    fn union(&self, other: &Self) -> Self {
        let (wide, narrow) = if self.spread >= other.spread { (self, other) } else { (other, self) };
        let apart = wide.axis.dot(narrow.axis).clamp(-1.0, 1.0).acos();
        let bounds = self.bounds.union(other.bounds);
        let reach = self.reach.max(other.reach);
        if apart + narrow.spread <= wide.spread {
            return Self { bounds, reach, ..*wide };
        }
        let spread = 0.5 * (wide.spread + apart + narrow.spread);
        let across = wide.axis.cross(narrow.axis).try_normalize();
        match across.filter(|_| spread < PI) {
            Some(across) => {
                let axis = glam::Quat::from_axis_angle(across, spread - wide.spread) * wide.axis;
                Self { bounds, axis, spread, reach }
            }
            None => Self { bounds, axis: wide.axis, spread: PI, reach },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::{rng, vec3};

    fn number(i: u64) -> f32 {
        rng::unit(rng::mix(i))
    }

    fn emitters(n: usize) -> Vec<(usize, Extent, f32)> {
        let one = |i: usize| {
            let at = |k: u64| number(i as u64 * 16 + k);
            let p = vec3(at(0), at(1), at(2)) * 10.0;
            let bounds = Bounds { lower: p, upper: p + vec3(at(3), at(4), at(5)) * 0.2 };
            let axis = vec3(at(6) - 0.5, at(7) - 0.5, at(8) - 0.5).normalize();
            (i, Extent { bounds, axis, spread: at(9), reach: 0.5 * PI }, 0.1 + at(10))
        };
        (0..n).map(one).collect()
    }

    #[test]
    fn chances_add_up_and_are_those_of_the_choice() {
        let tree = Tree::new(emitters(150), 151).unwrap();
        assert!(tree.probability(Vec3::ZERO, 150).is_none());
        for i in 0..20 {
            let from = vec3(number(i), number(i + 100), number(i + 200)) * 12.0 - 1.0;
            let sum: f32 = (0..150).map(|emitter| tree.probability(from, emitter).unwrap()).sum();
            // Bounds of a group may promise light that none of its emitters sends.
            assert!(sum > 0.9 && sum < 1.0 + 1e-4, "{sum}");
            let n = 20_000;
            let mut counts = vec![0.0; 150];
            for k in 0..n {
                let (emitter, chance) = tree.choose(from, k as f32 / n as f32);
                if chance == 0.0 {
                    continue;
                }
                assert!((chance / tree.probability(from, emitter).unwrap() - 1.0).abs() < 1e-4);
                counts[emitter] += 1.0 / n as f32;
            }
            for (emitter, count) in counts.iter().enumerate() {
                assert!((count - tree.probability(from, emitter).unwrap()).abs() < 2e-3);
            }
        }
    }

    #[test]
    fn whatever_shines_on_a_point_has_a_chance() {
        let all = emitters(150);
        let tree = Tree::new(all.clone(), 150).unwrap();
        for i in 0..200 {
            let from = vec3(number(i), number(i + 1000), number(i + 2000)) * 14.0 - 2.0;
            for &(emitter, Extent { bounds, axis, .. }, _) in &all {
                let p = bounds.lower.lerp(bounds.upper, number(i + 3000));
                if axis.dot(from - p) > 0.0 {
                    assert!(tree.probability(from, emitter).unwrap() > 0.0);
                }
            }
        }
    }
}
