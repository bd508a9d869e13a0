//! Several vectors or colours, coordinate by coordinate.

use std::ops::{Add, AddAssign, Mul, Neg, Sub};

use super::{LANES, Lanes, Mask};
use crate::math::{Vec3, vec3};

/// The vectors, by coordinate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lanes3<const N: usize = LANES> {
    /// First coordinates.
    pub x: Lanes<N>,
    /// Second coordinates.
    pub y: Lanes<N>,
    /// Third coordinates.
    pub z: Lanes<N>,
}

impl<const N: usize> Lanes3<N> {
    /// All zero.
    pub const ZERO: Self = Self { x: Lanes::ZERO, y: Lanes::ZERO, z: Lanes::ZERO };

    /// The same vector everywhere.
    #[inline(always)]
    pub fn splat(value: Vec3) -> Self {
        Self { x: Lanes::splat(value.x), y: Lanes::splat(value.y), z: Lanes::splat(value.z) }
    }

    /// The vector of a lane.
    #[inline(always)]
    pub fn get(&self, lane: usize) -> Vec3 {
        vec3(self.x.0[lane], self.y.0[lane], self.z.0[lane])
    }

    /// Replaces the vector of a lane.
    #[inline(always)]
    pub fn set(&mut self, lane: usize, value: Vec3) {
        (self.x.0[lane], self.y.0[lane], self.z.0[lane]) = value.into();
    }

    /// [`Lanes::copy_beside`].
    #[inline(always)]
    pub fn copy_beside<const STEP: i32>(&mut self, from: &Self) {
        self.x.copy_beside::<STEP>(&from.x);
        self.y.copy_beside::<STEP>(&from.y);
        self.z.copy_beside::<STEP>(&from.z);
    }

    /// All one.
    pub const ONE: Self = Self { x: Lanes::ONE, y: Lanes::ONE, z: Lanes::ONE };

    /// The normals of flat surfaces in their own frames.
    pub const UP: Self = Self { x: Lanes::ZERO, y: Lanes::ZERO, z: Lanes::ONE };

    /// The same colour in all channels.
    #[inline(always)]
    pub fn grey(value: Lanes<N>) -> Self {
        Self { x: value, y: value, z: value }
    }

    /// Part way to another.
    #[inline(always)]
    pub fn lerp(self, other: Self, share: Lanes<N>) -> Self {
        self + (other - self) * share
    }

    /// A function of every coordinate.
    #[inline(always)]
    pub fn map(self, f: impl Fn(Lanes<N>) -> Lanes<N>) -> Self {
        Self { x: f(self.x), y: f(self.y), z: f(self.z) }
    }

    /// The vectors seen from the other sides of their surfaces, in the given lanes.
    #[inline(always)]
    pub fn mirror(self, lanes: Mask<N>) -> Self {
        Self { z: lanes.select(-self.z, self.z), ..self }
    }

    /// Inner products.
    #[inline(always)]
    pub fn dot(self, other: Self) -> Lanes<N> {
        self.x * other.x + self.y * other.y + self.z * other.z
    }

    /// Outer products.
    #[inline(always)]
    pub fn cross(self, other: Self) -> Self {
        Self {
            x: self.y * other.z - self.z * other.y,
            y: self.z * other.x - self.x * other.z,
            z: self.x * other.y - self.y * other.x,
        }
    }

    /// Coordinate by coordinate.
    #[inline(always)]
    pub fn scale(self, other: Self) -> Self {
        Self { x: self.x * other.x, y: self.y * other.y, z: self.z * other.z }
    }

    /// The vectors at length one; those without a direction are `other`.
    #[inline(always)]
    pub fn normalize_or(self, other: Self) -> Self {
        let inverse = Lanes::splat(1.0) / self.dot(self).sqrt();
        let possible = inverse.greater(Lanes::ZERO) & inverse.less(Lanes::splat(f32::INFINITY));
        possible.select3(self * inverse, other)
    }

    /// Largest coordinates.
    #[inline(always)]
    pub fn max_element(self) -> Lanes<N> {
        self.x.max(self.y).max(self.z)
    }

    /// Absolute values.
    #[inline(always)]
    pub fn abs(self) -> Self {
        Self { x: self.x.abs(), y: self.y.abs(), z: self.z.abs() }
    }

    /// Mask of the lanes in which the same coordinates are zero as in others.
    #[inline(always)]
    pub fn same_zeros(self, other: Self) -> Mask<N> {
        let alike = |a: Lanes<N>, b: Lanes<N>| {
            let (a, b) = (a.abs().greater(Lanes::ZERO), b.abs().greater(Lanes::ZERO));
            (a & b) | !(a | b)
        };
        alike(self.x, other.x) & alike(self.y, other.y) & alike(self.z, other.z)
    }

    /// Mask of the lanes with a coordinate other than zero.
    #[inline(always)]
    pub fn nonzero(self) -> Mask<N> {
        self.abs().max_element().greater(Lanes::ZERO)
    }
}

impl<const N: usize> Add for Lanes3<N> {
    type Output = Self;
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Self { x: self.x + other.x, y: self.y + other.y, z: self.z + other.z }
    }
}

impl<const N: usize> AddAssign for Lanes3<N> {
    #[inline(always)]
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}

impl<const N: usize> Sub for Lanes3<N> {
    type Output = Self;
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Self { x: self.x - other.x, y: self.y - other.y, z: self.z - other.z }
    }
}

impl<const N: usize> Neg for Lanes3<N> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Self { x: -self.x, y: -self.y, z: -self.z }
    }
}

impl<const N: usize> Mul<Lanes<N>> for Lanes3<N> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, factor: Lanes<N>) -> Self {
        Self { x: self.x * factor, y: self.y * factor, z: self.z * factor }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn vectors_are_as_single_ones() {
        let (a, b) = (vec3(1.0, -2.0, 0.5), vec3(0.25, 3.0, -1.0));
        let (many_a, many_b) = (<Lanes3>::splat(a), <Lanes3>::splat(b));
        assert_eq!((many_a + many_b).get(3), a + b);
        assert_eq!((many_a - many_b).get(4), a - b);
        assert_eq!((-many_a * Lanes::splat(2.0)).get(4), a * -2.0);
        assert_eq!(many_a.cross(many_b).get(5), a.cross(b));
        assert_eq!(many_a.scale(many_b).get(6), a * b);
        assert_eq!((many_a.dot(many_b).0[7], many_a.abs().max_element().0[8]), (a.dot(b), 2.0));
        assert!(many_a.normalize_or(many_b).get(9).distance(a.normalize()) < 1e-6);
        assert_eq!(<Lanes3>::ZERO.normalize_or(many_b).get(10), b);
        assert!(many_a.nonzero().get(0) && !<Lanes3>::ZERO.nonzero().any());
        let mut one = <Lanes3>::ZERO;
        one.set(2, a);
        assert_eq!((one.get(1), one.get(2)), (Vec3::ZERO, a));
    }
}
