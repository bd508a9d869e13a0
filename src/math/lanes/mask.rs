//! Sets of lanes.

use std::ops::{BitAnd, BitOr, Not};

use super::{Bits, LANES, Lanes, Lanes3, copy_beside};

/// A set of lanes: all bits of a lane are set or none.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Mask<const N: usize = LANES>(pub [u32; N]);

impl<const N: usize> Mask<N> {
    /// No lane.
    pub const NONE: Self = Self([0; N]);

    /// The first `n` lanes.
    pub fn first(n: usize) -> Self {
        Self(std::array::from_fn(|i| if i < n { !0 } else { 0 }))
    }

    /// Whether it holds for a lane.
    #[inline(always)]
    pub fn get(self, lane: usize) -> bool {
        self.0[lane] != 0
    }

    /// Says whether it holds for a lane.
    #[inline(always)]
    pub fn set(&mut self, lane: usize, holds: bool) {
        self.0[lane] = if holds { !0 } else { 0 };
    }

    /// [`Lanes::copy_beside`].
    #[inline(always)]
    pub fn copy_beside<const STEP: i32>(&mut self, from: &Self) {
        copy_beside::<STEP, _, N>(&mut self.0, &from.0);
    }

    /// Whether it holds for any lane.
    #[inline(always)]
    pub fn any(self) -> bool {
        self.0.iter().fold(0, |all, lane| all | lane) != 0
    }

    /// Number of lanes it holds for.
    #[inline(always)]
    pub fn count(self) -> u32 {
        self.0.iter().map(|lane| lane & 1).sum()
    }

    /// The lanes it holds for.
    #[inline(always)]
    pub fn lanes(self) -> impl Iterator<Item = usize> {
        let mut left = 0u32;
        for (i, lane) in self.0.iter().enumerate() {
            left |= (lane & 1) << i;
        }
        std::iter::from_fn(move || {
            let lane = left.trailing_zeros() as usize;
            left &= left.wrapping_sub(1);
            (lane < N).then_some(lane)
        })
    }

    /// `a` where it holds, `b` elsewhere.
    #[inline(always)]
    pub fn select(self, a: Lanes<N>, b: Lanes<N>) -> Lanes<N> {
        let mut out = b.0;
        for (i, value) in out.iter_mut().enumerate() {
            *value = if self.0[i] != 0 { a.0[i] } else { *value };
        }
        Lanes(out)
    }

    /// `a` where it holds, `b` elsewhere.
    #[inline(always)]
    pub fn select_bits(self, a: Bits<N>, b: Bits<N>) -> Bits<N> {
        let mut out = b.0;
        for (i, value) in out.iter_mut().enumerate() {
            *value = (a.0[i] & self.0[i]) | (*value & !self.0[i]);
        }
        Bits(out)
    }

    /// `a` where it holds, `b` elsewhere.
    #[inline(always)]
    pub fn select3(self, a: Lanes3<N>, b: Lanes3<N>) -> Lanes3<N> {
        Lanes3 { x: self.select(a.x, b.x), y: self.select(a.y, b.y), z: self.select(a.z, b.z) }
    }

    #[inline(always)]
    fn zip(self, other: Self, f: impl Fn(u32, u32) -> u32) -> Self {
        let mut out = self.0;
        for (a, b) in out.iter_mut().zip(other.0) {
            *a = f(*a, b);
        }
        Self(out)
    }
}

impl<const N: usize> BitAnd for Mask<N> {
    type Output = Self;
    #[inline(always)]
    fn bitand(self, other: Self) -> Self {
        self.zip(other, |a, b| a & b)
    }
}

impl<const N: usize> BitOr for Mask<N> {
    type Output = Self;
    #[inline(always)]
    fn bitor(self, other: Self) -> Self {
        self.zip(other, |a, b| a | b)
    }
}

impl<const N: usize> Not for Mask<N> {
    type Output = Self;
    #[inline(always)]
    fn not(self) -> Self {
        self.zip(self, |a, _| !a)
    }
}
