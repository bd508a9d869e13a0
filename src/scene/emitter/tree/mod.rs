//! Choosing among many emitters by how much they may light a point: a tree whose nodes bound what their children send there
//! (Conty Estevez and Kulla 2018).

mod build;
mod extent;
mod node;

pub use self::build::Item;
pub use self::extent::Extent;
pub use self::node::Receiver;
use self::node::{Child, Node, WIDTH};

/// A tree over numbered items.
#[derive(Clone, Debug)]
pub struct Tree {
    nodes: Vec<Node>,
    /// Children that the nodes are; of the first one it means nothing.
    parents: Vec<Link>,
    /// Children that the items are.
    items: Vec<Link>,
}

/// A child of a node.
#[derive(Clone, Copy, Debug, Default)]
struct Link {
    node: u32,
    slot: u32,
}

impl Tree {
    /// The item that `u` in [0, 1) selects for a point, and its probability; `None` where no item reaches the point.
    #[inline(always)]
    pub fn choose(&self, from: &Receiver, mut u: f32) -> Option<(usize, f32)> {
        let (mut at, mut chance) = (0, 1.0);
        loop {
            let node = &self.nodes[at];
            let chances = node.chances(from).0;
            // Rounding may leave something of `u` behind the last child that can be chosen.
            let mut slot = chances.iter().rposition(|&chance| chance > 0.0)?;
            let mut below = 0.0;
            for (k, &chance) in chances[..slot].iter().enumerate() {
                if u < below + chance {
                    slot = k;
                    break;
                }
                below += chance;
            }
            u = ((u - below) / chances[slot]).clamp(0.0, 1.0 - f32::EPSILON / 2.0);
            chance *= chances[slot];
            match node.child(slot) {
                Child::Node(next) => at = next as usize,
                Child::Item(item) => return Some((item as usize, chance)),
                Child::Nothing => return None,
            }
        }
    }

    /// Probability of an item at a point.
    pub fn probability(&self, from: &Receiver, item: usize) -> f32 {
        probability(self, from, item)
    }
}

vectorized! {
    /// The product of the chances on the way to an item.
    fn probability(tree: &Tree, from: &Receiver, item: usize) -> f32 {
        let mut link = tree.items[item];
        let mut chance = 1.0;
        loop {
            chance *= tree.nodes[link.node as usize].chances(from).0[link.slot as usize];
            if link.node == 0 || chance == 0.0 {
                return chance;
            }
            link = tree.parents[link.node as usize];
        }
    }
}

#[cfg(test)]
mod tests {
    use std::f32::consts::PI;

    use super::*;
    use crate::math::{Vec3, rng, vec3};
    use crate::scene::Bounds;

    fn number(i: u64) -> f32 {
        rng::unit(rng::mix(i))
    }

    fn items(n: usize) -> Vec<Item> {
        let one = |i: usize| {
            let at = |k: u64| number(i as u64 * 16 + k);
            let p = vec3(at(0), at(1), at(2)) * 10.0;
            let bounds = Bounds { lower: p, upper: p + vec3(at(3), at(4), at(5)) * 0.2 };
            let axis = vec3(at(6) - 0.5, at(7) - 0.5, at(8) - 0.5).normalize();
            Item { extent: Extent { bounds, axis, spread: at(9), reach: 0.5 * PI }, power: 0.1 + at(10) }
        };
        (0..n).map(one).collect()
    }

    /// Points in and around the items, every other one with a normal.
    fn receivers(n: u64) -> impl Iterator<Item = Receiver> {
        (0..n).map(|i| {
            let p = vec3(number(i), number(i + 1000), number(i + 2000)) * 14.0 - 2.0;
            let n = vec3(number(i + 3000) - 0.5, number(i + 4000) - 0.5, number(i + 5000) - 0.5).normalize();
            Receiver { p, n: if i % 2 == 0 { n } else { Vec3::ZERO } }
        })
    }

    #[test]
    fn chances_add_up_and_are_those_of_the_choice() {
        for count in [1, 2, 7, 150] {
            let tree = Tree::new(&items(count)).unwrap();
            for from in receivers(20) {
                let chances: Vec<f32> = (0..count).map(|item| tree.probability(&from, item)).collect();
                let sum: f32 = chances.iter().sum();
                // Bounds of a group may promise light that none of its emitters sends.
                assert!((count < 100 || sum > 0.5) && sum < 1.0 + 1e-4, "{sum}");
                let n = 20_000;
                let mut counts = vec![0.0; count];
                for (item, chance) in (0..n).filter_map(|k| tree.choose(&from, k as f32 / n as f32)) {
                    assert!((chance / chances[item] - 1.0).abs() < 1e-4);
                    counts[item] += 1.0 / n as f32;
                }
                counts.iter().zip(&chances).for_each(|(count, chance)| assert!((count - chance).abs() < 2e-3));
            }
        }
        assert!(Tree::new(&[]).is_none());
    }

    #[test]
    fn whatever_shines_on_a_point_has_a_chance() {
        let all = items(150);
        let tree = Tree::new(&all).unwrap();
        for (i, from) in receivers(200).enumerate() {
            for (item, Item { extent: Extent { bounds, axis, .. }, .. }) in all.iter().enumerate() {
                let to = from.p - bounds.lower.lerp(bounds.upper, number(i as u64 + 6000));
                if axis.dot(to) > 0.0 && (from.n == Vec3::ZERO || from.n.dot(-to) > 0.0) {
                    assert!(tree.probability(&from, item) > 0.0);
                }
            }
        }
    }

    #[test]
    fn items_in_one_place_have_chances_by_their_power() {
        let same = Item {
            extent: Extent { bounds: Bounds::of([Vec3::ONE]), axis: Vec3::Z, spread: PI, reach: 0.5 * PI },
            power: 1.0,
        };
        let items: Vec<Item> = (0..20).map(|i| Item { power: 1.0 + i as f32, ..same }).collect();
        let tree = Tree::new(&items).unwrap();
        let from = Receiver { p: vec3(3.0, 0.0, 2.0), n: Vec3::ZERO };
        for (item, Item { power, .. }) in items.iter().enumerate() {
            assert!((tree.probability(&from, item) - power / 210.0).abs() < 1e-5);
        }
    }

    #[test]
    fn near_emitters_are_chosen_before_far_ones_and_those_behind_never() {
        let lamp = |x: f32, z: f32| Item {
            extent: Extent { bounds: Bounds::of([vec3(x, 0.0, z)]), axis: Vec3::Z, spread: PI, reach: 0.5 * PI },
            power: 1.0,
        };
        let tree = Tree::new(&[lamp(0.0, 1.0), lamp(0.0, 10.0), lamp(0.0, -1.0)]).unwrap();
        let [near, far, behind] = [0, 1, 2].map(|item| tree.probability(&Receiver { p: Vec3::ZERO, n: Vec3::Z }, item));
        assert!(
            (near - 100.0 / 101.0).abs() < 1e-4 && (far - 1.0 / 101.0).abs() < 1e-4 && behind == 0.0,
            "{near} {far} {behind}"
        );
    }
}
