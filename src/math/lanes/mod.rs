//! Several floats as a vector, in plain Rust that compilers turn into vector instructions of whatever width the enclosing
//! function is compiled for; the bits are the same for all widths. Vectors of one serve single paths by the same code as
//! those of sixteen serve packets.

mod bits;
mod functions;
mod mask;
mod vector;

use std::ops::{Add, AddAssign, Div, Mul, Neg, Sub};

pub use self::bits::Bits;
pub use self::mask::Mask;
pub use self::vector::Lanes3;

/// Number of floats in a packet.
pub const LANES: usize = 16;

/// Copies to every lane the one that is `STEP` lanes behind it, or before it if that is negative; lanes that have none stay as they
/// are.
#[inline(always)]
fn copy_beside<const STEP: i32, T: Copy, const N: usize>(to: &mut [T; N], from: &[T; N]) {
    let step = STEP.unsigned_abs() as usize;
    if STEP >= 0 {
        to[..N - step].copy_from_slice(&from[step..]);
    } else {
        to[step..].copy_from_slice(&from[..N - step]);
    }
}

/// The floats.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lanes<const N: usize = LANES>(pub [f32; N]);

impl<const N: usize> Lanes<N> {
    /// All zero.
    pub const ZERO: Self = Self([0.0; N]);

    /// All one.
    pub const ONE: Self = Self([1.0; N]);

    /// The same value everywhere.
    #[inline(always)]
    pub fn splat(value: f32) -> Self {
        Self([value; N])
    }

    /// The first values of a slice.
    #[inline(always)]
    pub fn load(from: &[f32]) -> Self {
        let mut lanes = [0.0; N];
        lanes.copy_from_slice(&from[..N]);
        Self(lanes)
    }

    /// Writes to the front of a slice.
    #[inline(always)]
    pub fn store(self, to: &mut [f32]) {
        to[..N].copy_from_slice(&self.0);
    }

    /// Copies to every lane the one that is `STEP` lanes behind it, or before it if that is negative; lanes that have none stay
    /// as they are.
    #[inline(always)]
    pub fn copy_beside<const STEP: i32>(&mut self, from: &Self) {
        copy_beside::<STEP, _, N>(&mut self.0, &from.0);
    }

    #[inline(always)]
    fn map(self, f: impl Fn(f32) -> f32) -> Self {
        let mut out = self.0;
        for value in &mut out {
            *value = f(*value);
        }
        Self(out)
    }

    #[inline(always)]
    fn zip(self, other: Self, f: impl Fn(f32, f32) -> f32) -> Self {
        let mut out = self.0;
        for (a, b) in out.iter_mut().zip(other.0) {
            *a = f(*a, b);
        }
        Self(out)
    }

    /// Mask of the lanes that are smaller than the other's.
    #[inline(always)]
    pub fn less(self, other: Self) -> Mask<N> {
        let mut out = [0; N];
        for (i, lane) in out.iter_mut().enumerate() {
            *lane = if self.0[i] < other.0[i] { !0 } else { 0 };
        }
        Mask(out)
    }

    /// Mask of the lanes that are larger than the other's.
    #[inline(always)]
    pub fn greater(self, other: Self) -> Mask<N> {
        other.less(self)
    }

    /// Absolute values.
    #[inline(always)]
    pub fn abs(self) -> Self {
        self.map(f32::abs)
    }

    /// The absolute values with the other's signs.
    #[inline(always)]
    pub fn copysign(self, sign: Self) -> Self {
        self.zip(sign, f32::copysign)
    }

    /// The smaller ones; those of `other` where this is NaN.
    #[inline(always)]
    pub fn min(self, other: Self) -> Self {
        self.zip(other, |a, b| if a < b { a } else { b })
    }

    /// The larger ones; those of `other` where this is NaN.
    #[inline(always)]
    pub fn max(self, other: Self) -> Self {
        self.zip(other, |a, b| if a > b { a } else { b })
    }

    /// The sum of all.
    #[inline(always)]
    pub fn sum(self) -> f32 {
        let mut sums = [0.0; 4];
        for (i, value) in self.0.into_iter().enumerate() {
            sums[i % 4] += value;
        }
        (sums[0] + sums[1]) + (sums[2] + sums[3])
    }

    /// Square roots.
    #[inline(always)]
    pub fn sqrt(self) -> Self {
        self.map(f32::sqrt)
    }

    /// Mask of the lanes that are neither infinite nor NaN.
    #[inline(always)]
    pub fn finite(self) -> Mask<N> {
        self.abs().less(Self::splat(f32::INFINITY))
    }

    /// These where `a > b`, and `other` elsewhere.
    #[inline(always)]
    pub fn where_greater(self, a: Self, b: Self, other: Self) -> Self {
        let mut out = self.0;
        for (i, value) in out.iter_mut().enumerate() {
            *value = if a.0[i] > b.0[i] { *value } else { other.0[i] };
        }
        Self(out)
    }
}

macro_rules! operator {
    ($trait:ident, $name:ident, $operator:tt) => {
        impl<const N: usize> $trait for Lanes<N> {
            type Output = Self;
            #[inline(always)]
            fn $name(self, other: Self) -> Self {
                self.zip(other, |a, b| a $operator b)
            }
        }
    };
}

operator!(Add, add, +);
operator!(Sub, sub, -);
operator!(Mul, mul, *);
operator!(Div, div, /);

impl<const N: usize> Neg for Lanes<N> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        self.map(|value| -value)
    }
}

impl<const N: usize> AddAssign for Lanes<N> {
    #[inline(always)]
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn operations_work_on_every_lane() {
        let a = Lanes(std::array::from_fn(|i| i as f32));
        let b = <Lanes>::splat(4.0);
        for i in 0..LANES {
            let x = i as f32;
            assert_eq!((a + b).0[i], x + 4.0);
            assert_eq!((a - b).0[i], x - 4.0);
            assert_eq!((a * b / b).0[i], x);
            assert_eq!((a.min(b).0[i], a.max(b).0[i]), (x.min(4.0), x.max(4.0)));
            assert_eq!(a.where_greater(a, b, b).0[i], x.max(4.0));
            assert_eq!(a.sqrt().0[i], x.sqrt());
        }
        let odd = Mask(std::array::from_fn(|i| if i % 2 == 1 { !0 } else { 0 }));
        assert_eq!((odd & a.less(b)).lanes().collect::<Vec<_>>(), [1, 3]);
        assert_eq!((a.greater(b) | odd).lanes().count(), 13);
        assert_eq!(odd.select(a, -b).0[..4], [-4.0, 1.0, -4.0, 3.0]);
        assert!(odd.any() && !(odd & !odd).any() && odd.get(3) && !odd.get(4));
        assert_eq!(<Mask>::first(2).lanes().collect::<Vec<_>>(), [0, 1]);
        assert_eq!(a.sum(), 120.0);
        assert_eq!(<Lanes>::splat(f32::NAN).max(b), b);
    }
}
