//! How emitters are put into groups: those close to each other that shine the same way belong together.

use super::{Child, Extent, Link, Node, Tree, WIDTH};
use crate::scene::Bounds;

/// An emitter, or a part of one, as a tree sees it.
#[derive(Clone, Copy, Debug)]
pub struct Item {
    /// Positions and directions of emission.
    pub extent: Extent,
    /// Power that it emits.
    pub power: f32,
}

/// Intervals of an axis between which groups may be cut.
const BUCKETS: usize = 12;

/// An item and its number.
type Numbered = (u32, Item);

impl Tree {
    /// A tree over items, which are numbered in their order. `None` without any.
    pub fn new(items: &[Item]) -> Option<Self> {
        if items.is_empty() {
            return None;
        }
        let mut tree = Self { nodes: Vec::new(), parents: Vec::new(), items: vec![Link::default(); items.len()] };
        let mut numbered: Vec<Numbered> = (0u32..).zip(items.iter().copied()).collect();
        tree.add(&mut numbered, Link::default());
        Some(tree)
    }

    /// Adds a node for items below a child of another; returns its number.
    fn add(&mut self, items: &mut [Numbered], parent: Link) -> u32 {
        let number = self.nodes.len() as u32;
        self.nodes.push(Node::EMPTY);
        self.parents.push(parent);
        for (slot, Group { items, whole: Item { extent, power } }) in Group::new(items).cut().into_iter().enumerate() {
            let link = Link { node: number, slot: slot as u32 };
            let child = if let [(item, _)] = *items {
                self.items[item as usize] = link;
                Child::Item(item)
            } else {
                Child::Node(self.add(items, link))
            };
            self.nodes[number as usize].set(slot, child, &extent, power);
        }
        number
    }
}

/// Items that lie together.
struct Group<'a> {
    items: &'a mut [Numbered],
    /// All of them as one.
    whole: Item,
}

impl<'a> Group<'a> {
    fn new(items: &'a mut [Numbered]) -> Self {
        let whole = items.iter().map(|&(_, item)| item).reduce(both).expect("a group is never empty");
        Self { items, whole }
    }

    /// As many groups as a node has room for: those are cut first that cost most as they are.
    fn cut(self) -> Vec<Self> {
        let mut groups = vec![self];
        while groups.len() < WIDTH {
            let costs = groups.iter().enumerate().filter(|(_, group)| group.items.len() > 1);
            let dearest = costs.max_by(|(_, a), (_, b)| cost(&a.whole).total_cmp(&cost(&b.whole)));
            let Some((at, _)) = dearest else { break };
            let (first, second) = halves(groups.swap_remove(at).items);
            groups.extend([first, second].map(Self::new));
        }
        groups
    }
}

/// Items in two parts, where these cost least together.
fn halves(group: &mut [Numbered]) -> (&mut [Numbered], &mut [Numbered]) {
    let centre = |item: &Item| item.extent.bounds.sphere().0;
    let around = Bounds::of(group.iter().map(|(_, item)| centre(item)));
    let size = around.upper - around.lower;
    let bucket = |item: &Item, axis: usize| {
        let at = (centre(item)[axis] - around.lower[axis]) / size[axis];
        ((at * BUCKETS as f32) as usize).min(BUCKETS - 1)
    };
    let mut best: Option<(f32, usize, usize)> = None;
    for axis in (0..3).filter(|&axis| size[axis] > 0.0) {
        let mut buckets = [None; BUCKETS];
        for (_, item) in &*group {
            let bucket = &mut buckets[bucket(item, axis)];
            *bucket = Some(bucket.map_or(*item, |others| both(others, *item)));
        }
        // Long thin groups are worse than their boxes tell.
        let long = size.max_element() / size[axis];
        for end in 1..BUCKETS {
            let [before, after] = [&buckets[..end], &buckets[end..]]
                .map(|part| part.iter().flatten().copied().reduce(both).map(|whole| cost(&whole)));
            let (Some(before), Some(after)) = (before, after) else { continue };
            let total = long * (before + after);
            if best.is_none_or(|(least, ..)| total < least) {
                best = Some((total, axis, end));
            }
        }
    }
    let Some((_, axis, end)) = best else { return group.split_at_mut(group.len() / 2) };
    group.sort_by_key(|(_, item)| bucket(item, axis) >= end);
    let middle = group.partition_point(|(_, item)| bucket(item, axis) < end);
    group.split_at_mut(middle)
}

/// Cost of a group: its power, by how much of space and of directions it takes.
fn cost(whole: &Item) -> f32 {
    let size = whole.extent.bounds.upper - whole.extent.bounds.lower;
    let area = size.x * size.y + size.y * size.z + size.z * size.x;
    // Something is left of boxes without a surface.
    let area = area + 1e-3 * size.length_squared();
    whole.power * whole.extent.directions() * area
}

fn both(a: Item, b: Item) -> Item {
    Item { extent: a.extent.union(&b.extent), power: a.power + b.power }
}
