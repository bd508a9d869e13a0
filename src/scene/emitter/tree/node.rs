//! Up to eight groups of emitters side by side, and what each of them may send to a point. Angles are never computed: their sums and
//! differences are of sines and cosines.

use std::f32::consts::PI;

use super::Extent;
use crate::math::Vec3;
use crate::math::lanes::{Lanes, Lanes3, Mask};

/// Most children of a node.
pub const WIDTH: usize = 8;

/// Cosines are this much too small before light is ruled out: rounding must not hide emission along a rim.
const SLACK: f32 = 1e-3;

/// Least square of a distance.
const NEAREST: f32 = 1e-20;

/// Least cosine that counts where light is not ruled out.
const LEAST_COSINE: f32 = 0.01;

/// Cosine of the spread of normals that are parallel: these see no point below their plane.
const PARALLEL: f32 = 1.0 - 1e-6;

/// In place of the cosine of a reach, of what shines to all sides alike.
const EVERYWHERE: f32 = -2.0;

/// A point that light is chosen for.
#[derive(Clone, Copy, Debug)]
pub struct Receiver {
    /// Position.
    pub p: Vec3,
    /// Normal on the side that scatters light, zero where all sides do.
    pub n: Vec3,
}

impl Receiver {
    /// For emitters whose chance is the same everywhere.
    pub const NOWHERE: Self = Self { p: Vec3::ZERO, n: Vec3::ZERO };
}

/// A child of a node.
#[derive(Clone, Copy, Debug)]
pub enum Child {
    /// Number of a node.
    Node(u32),
    /// Number of what emits.
    Item(u32),
    /// Nothing, which is never chosen.
    Nothing,
}

/// Children with their bounds, side by side.
#[derive(Clone, Debug)]
pub struct Node {
    /// Middles of their boxes.
    centre: Lanes3<WIDTH>,
    /// Halves of the sides of these.
    half: Lanes3<WIDTH>,
    /// Radii of the spheres around these, and the inverses of their squares.
    radius: Lanes<WIDTH>,
    per_squared_radius: Lanes<WIDTH>,
    axis: Lanes3<WIDTH>,
    spread: Angles,
    cos_reach: Lanes<WIDTH>,
    power: Lanes<WIDTH>,
    children: [Child; WIDTH],
}

impl Node {
    /// No children.
    pub const EMPTY: Self = Self {
        centre: Lanes3::ZERO,
        half: Lanes3::ZERO,
        radius: Lanes::ZERO,
        per_squared_radius: Lanes::ZERO,
        axis: Lanes3::ZERO,
        spread: Angles { cos: Lanes::ONE, sin: Lanes::ZERO },
        cos_reach: Lanes::ZERO,
        power: Lanes::ZERO,
        children: [Child::Nothing; WIDTH],
    };

    /// Sets a child.
    pub fn set(&mut self, slot: usize, child: Child, extent: &Extent, power: f32) {
        let ((centre, _), size) = (extent.bounds.sphere(), extent.bounds.upper - extent.bounds.lower);
        self.centre.set(slot, centre);
        let half = 0.5 * size.max(Vec3::ZERO);
        self.half.set(slot, half);
        self.radius.0[slot] = half.length();
        self.per_squared_radius.0[slot] = half.length_squared().max(NEAREST).recip();
        self.axis.set(slot, extent.axis);
        (self.spread.sin.0[slot], self.spread.cos.0[slot]) = extent.spread.sin_cos();
        let everywhere = extent.spread >= PI && matches!(child, Child::Item(_));
        self.cos_reach.0[slot] = if everywhere { EVERYWHERE } else { extent.reach.cos() };
        (self.power.0[slot], self.children[slot]) = (power, child);
    }

    /// A child.
    pub fn child(&self, slot: usize) -> Child {
        self.children[slot]
    }

    /// Chances of the children, by the most that they may send if nothing hides them: power, over the squared distance, times the
    /// largest cosines at both ends. All are zero where none shines on the receiver.
    #[inline(always)]
    pub fn chances(&self, from: &Receiver) -> Lanes<WIDTH> {
        let (zero, slack) = (Lanes::ZERO, Lanes::splat(-SLACK));
        let counted = |cosine: Lanes<WIDTH>, least: Lanes<WIDTH>| {
            cosine.greater(least).select(cosine.max(Lanes::splat(LEAST_COSINE)), zero)
        };
        let to = Lanes3::splat(from.p) - self.centre;
        let per_centre = Lanes::ONE / to.dot(to).max(Lanes::splat(NEAREST)).sqrt();
        // Cosines are heights over distances, of which the box allows no smaller ones.
        let beyond = (to.abs() - self.half).map(|side| side.max(zero));
        let per_distance = Lanes::ONE / beyond.dot(beyond).max(Lanes::splat(NEAREST)).sqrt();
        // How wide the sphere around the box is seen.
        let sine = self.radius * per_centre;
        let width = Angles::select(sine.less(Lanes::ONE), Angles::of_sine(sine), Angles::STRAIGHT);

        let height = self.axis.dot(to);
        let in_plane = height + self.axis.abs().dot(self.half);
        let cone = Angles::of_cosine(height * per_centre).minus(self.spread.plus(width));
        let parallel = self.spread.cos.greater(Lanes::splat(PARALLEL));
        let cosine = parallel.select(cone.min(in_plane * per_distance), cone);
        let everywhere = self.cos_reach.less(Lanes::splat(-1.0));
        let shines = everywhere.select(Lanes::ONE, counted(cosine, self.cos_reach + slack));

        let normal = Lanes3::splat(from.n);
        let height = -normal.dot(to);
        let above = height + normal.abs().dot(self.half);
        let cosine = Angles::of_cosine(height * per_centre).minus(width).min(above * per_distance);
        let receives = if from.n == Vec3::ZERO { Lanes::ONE } else { counted(cosine, slack) };

        let most = self.power * shines * receives * (per_centre * per_centre).min(self.per_squared_radius);
        let total = most.sum();
        if total > 0.0 { most * Lanes::splat(1.0 / total) } else { zero }
    }
}

/// Angles from zero to π.
#[derive(Clone, Copy, Debug)]
struct Angles {
    cos: Lanes<WIDTH>,
    sin: Lanes<WIDTH>,
}

impl Angles {
    const STRAIGHT: Self = Self { cos: Lanes([-1.0; WIDTH]), sin: Lanes::ZERO };

    #[inline(always)]
    fn of_cosine(cos: Lanes<WIDTH>) -> Self {
        let cos = cos.max(Lanes::splat(-1.0)).min(Lanes::ONE);
        Self { cos, sin: (Lanes::ONE - cos * cos).sqrt() }
    }

    /// Angles of at most a right one.
    #[inline(always)]
    fn of_sine(sin: Lanes<WIDTH>) -> Self {
        Self { cos: (Lanes::ONE - sin * sin).max(Lanes::ZERO).sqrt(), sin }
    }

    /// The sums, at most π.
    #[inline(always)]
    fn plus(self, other: Self) -> Self {
        let sum =
            Self { cos: self.cos * other.cos - self.sin * other.sin, sin: self.sin * other.cos + self.cos * other.sin };
        Self::select((self.cos + other.cos).greater(Lanes::ZERO), sum, Self::STRAIGHT)
    }

    /// Cosines of the differences, which are zero at least.
    #[inline(always)]
    fn minus(self, other: Self) -> Lanes<WIDTH> {
        self.cos.greater(other.cos).select(Lanes::ONE, self.cos * other.cos + self.sin * other.sin)
    }

    #[inline(always)]
    fn select(mask: Mask<WIDTH>, a: Self, b: Self) -> Self {
        Self { cos: mask.select(a.cos, b.cos), sin: mask.select(a.sin, b.sin) }
    }
}
