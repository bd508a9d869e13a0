//! Several floats as a vector, in plain Rust that compilers turn into vector instructions of whatever width the enclosing
//! function is compiled for; the bits are the same for all widths. Vectors of one serve single paths by the same code as
//! those of sixteen serve packets.

mod bits;
mod vector;

use std::ops::{Add, AddAssign, BitAnd, BitOr, Div, Mul, Neg, Not, Sub};

pub use self::bits::Bits;
pub use self::vector::Lanes3;

/// Number of floats in a packet.
pub const LANES: usize = 16;

/// Adding 1.5 * 2^23 leaves the nearest integer in the low bits.
const ROUND: f32 = 12_582_912.0;

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

    /// Natural logarithms of positive numbers, to a relative 3e-7.
    #[inline(always)]
    pub fn ln(self) -> Self {
        // The mantissa is taken from √½ to √2, where the series in (m - 1) / (m + 1) is short.
        const ROOT_HALF: u32 = 0x3f35_04f3;
        let bits = Bits(self.0.map(f32::to_bits)).map(|bits| bits.wrapping_sub(ROOT_HALF));
        let mut exponent = [0.0; N];
        for (to, from) in exponent.iter_mut().zip(bits.0) {
            *to = ((from as i32) >> 23) as f32;
        }
        let mut mantissa = [0.0; N];
        for (to, from) in mantissa.iter_mut().zip(bits.0) {
            *to = f32::from_bits((from & 0x007f_ffff) + ROOT_HALF);
        }
        let m = Self(mantissa);
        let t = (m - Self::ONE) / (m + Self::ONE);
        let squared = t * t;
        let terms = [2.0 / 9.0, 2.0 / 7.0, 0.4, 2.0 / 3.0, 2.0];
        let series = terms.into_iter().fold(Self::ZERO, |sum, term| sum * squared + Self::splat(term));
        Self(exponent) * Self::splat(std::f32::consts::LN_2) + t * series
    }

    /// Angles in [0, π] of cosines, to 7e-5 (Abramowitz and Stegun 4.4.45).
    #[inline(always)]
    pub fn acos(self) -> Self {
        let x = self.abs().min(Self::ONE);
        let terms = [-0.018_729_3, 0.074_261, -0.212_114_4, 1.570_728_8];
        let angle = (Self::ONE - x).sqrt()
            * terms.into_iter().fold(Self::ZERO, |sum, term| sum * x + Self::splat(term));
        self.less(Self::ZERO).select(Self::splat(std::f32::consts::PI) - angle, angle)
    }

    /// Error functions of numbers that are not negative, to 2e-7 (Abramowitz and Stegun 7.1.26).
    #[inline(always)]
    pub fn erf_positive(self) -> Self {
        let t = Self::ONE / (Self::ONE + Self::splat(0.327_591_1) * self);
        let terms = [1.061_405_4, -1.453_152, 1.421_413_7, -0.284_496_74, 0.254_829_6];
        let series = terms.into_iter().fold(Self::ZERO, |sum, term| sum * t + Self::splat(term)) * t;
        Self::ONE - series * (-(self * self)).exp_negative()
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

    /// Cosines and sines of angles from -π/4 to π/4.
    #[inline(always)]
    pub fn cos_sin_small(self) -> (Self, Self) {
        let squared = self * self;
        let series = |[first, rest @ ..]: [f32; 5]| {
            rest.into_iter().fold(Self::splat(first), |sum, term| sum * squared + Self::splat(term))
        };
        let cosine = series([1.0 / 40_320.0, -1.0 / 720.0, 1.0 / 24.0, -0.5, 1.0]);
        let sine = self * series([1.0 / 362_880.0, -1.0 / 5_040.0, 1.0 / 120.0, -1.0 / 6.0, 1.0]);
        (cosine, sine)
    }

    /// Cosines and sines of angles in turns, from 0 to 1.
    #[inline(always)]
    pub fn cos_sin_turns(self) -> (Self, Self) {
        let shifted = self * Self::splat(4.0) + Self::splat(ROUND);
        let quarter = shifted - Self::splat(ROUND);
        let (cosine, sine) =
            ((self - quarter * Self::splat(0.25)) * Self::splat(std::f32::consts::TAU)).cos_sin_small();
        let number = Bits(shifted.0.map(f32::to_bits));
        let odd = number.map(|bits| bits & 1).equal(1);
        let negative_sine = number.map(|bits| bits & 2).equal(2);
        let negative_cosine = number.map(|bits| (bits + 1) & 2).equal(2);
        let (cosine, sine) = (odd.select(sine, cosine), odd.select(cosine, sine));
        (negative_cosine.select(-cosine, cosine), negative_sine.select(-sine, sine))
    }

    /// e^x for x <= 0, to a relative 1e-6; zero where x is below -40, so that products of weights do not become
    /// denormal numbers, which take a hundred times as long.
    #[inline(always)]
    pub fn exp_negative(self) -> Self {
        let least = Self::splat(-40.0);
        let x = self.max(least) * Self::splat(std::f32::consts::LOG2_E);
        let shifted = x + Self::splat(ROUND);
        let f = (x - (shifted - Self::splat(ROUND))) * Self::splat(std::f32::consts::LN_2);
        let power = shifted.map(|shifted| f32::from_bits((shifted.to_bits() << 23).wrapping_add(127 << 23)));
        let terms = [0.001_393, 0.008_375_2, 0.041_665_82, 0.166_666_57, 0.5, 1.0, 1.0];
        let value = power * terms.into_iter().fold(Self::ZERO, |sum, term| sum * f + Self::splat(term));
        value.where_greater(self, least, Self::ZERO)
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

    /// Whether it holds for any lane.
    #[inline(always)]
    pub fn any(self) -> bool {
        self.0.iter().fold(0, |all, lane| all | lane) != 0
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_exponential_is_one() {
        for i in 0..100_000 {
            let x = -39.9 * i as f32 / 100_000.0;
            let (ours, exact) = (f64::from(<Lanes>::splat(x).exp_negative().0[3]), f64::from(x).exp());
            assert!((ours / exact - 1.0).abs() < 1e-6 + 1e-7 * f64::from(-x), "{x}: {ours} instead of {exact}");
        }
        assert_eq!(<Lanes>::ZERO.exp_negative(), <Lanes>::splat(1.0));
        assert_eq!(<Lanes>::splat(-1e30).exp_negative(), <Lanes>::ZERO);
    }

    #[test]
    fn logarithms_angles_and_error_functions_are_those() {
        for i in 1..=20_000 {
            let x = i as f32 / 10_000.0;
            for x in [x, x * 1e-12, x * 1e12] {
                let (ours, exact) = (f64::from(<Lanes>::splat(x).ln().0[1]), f64::from(x).ln());
                assert!((ours - exact).abs() <= 3e-7 * exact.abs() + 1e-7, "{x}: {ours} instead of {exact}");
            }
            let erf = f64::from(<Lanes>::splat(x).erf_positive().0[1]);
            assert!((erf - libm::erf(f64::from(x))).abs() < 4e-7, "{x}");
            let cosine = x - 1.0;
            assert!((<Lanes>::splat(cosine).acos().0[2] - cosine.acos()).abs() < 1e-4, "{cosine}");
        }
    }

    #[test]
    fn cosines_and_sines_are_those_of_the_angle() {
        for i in 0..=10_000 {
            let turns = i as f32 / 10_000.0;
            let (cosine, sine) = <Lanes>::splat(turns).cos_sin_turns();
            let exact = (f64::from(turns) * std::f64::consts::TAU).sin_cos();
            assert!((f64::from(cosine.0[2]) - exact.1).abs() < 5e-7 && (f64::from(sine.0[2]) - exact.0).abs() < 5e-7);
        }
    }

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
