//! Unsigned integers as a vector.

use super::{LANES, Lanes, Mask, copy_beside};

/// The integers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Bits<const N: usize = LANES>(pub [u32; N]);

impl<const N: usize> Bits<N> {
    /// All zero.
    pub const ZERO: Self = Self([0; N]);

    /// The same value everywhere.
    #[inline(always)]
    pub fn splat(value: u32) -> Self {
        Self([value; N])
    }

    /// [`Lanes::copy_beside`].
    #[inline(always)]
    pub fn copy_beside<const STEP: i32>(&mut self, from: &Self) {
        copy_beside::<STEP, _, N>(&mut self.0, &from.0);
    }

    /// A function of every one.
    #[inline(always)]
    pub fn map(self, f: impl Fn(u32) -> u32) -> Self {
        let mut out = self.0;
        for value in &mut out {
            *value = f(*value);
        }
        Self(out)
    }

    /// A function of every one and another.
    #[inline(always)]
    pub fn zip(self, other: Self, f: impl Fn(u32, u32) -> u32) -> Self {
        let mut out = self.0;
        for (a, b) in out.iter_mut().zip(other.0) {
            *a = f(*a, b);
        }
        Self(out)
    }

    /// Mask of the lanes that equal a value.
    #[inline(always)]
    pub fn equal(self, value: u32) -> Mask<N> {
        Mask(self.map(|lane| if lane == value { !0 } else { 0 }).0)
    }

    /// The top 24 bits as floats in [0, 1).
    #[inline(always)]
    pub fn unit(self) -> Lanes<N> {
        let mut out = [0.0; N];
        for (value, bits) in out.iter_mut().zip(self.0) {
            *value = (bits >> 8) as f32 * (1.0 / 16_777_216.0);
        }
        Lanes(out)
    }
}
