//! Exponentials, logarithms and angles of several numbers at a time, by polynomials.

use super::{Bits, Lanes};

/// Adding 1.5 * 2^23 leaves the nearest integer in the low bits.
const ROUND: f32 = 12_582_912.0;

impl<const N: usize> Lanes<N> {
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
        let angle =
            (Self::ONE - x).sqrt() * terms.into_iter().fold(Self::ZERO, |sum, term| sum * x + Self::splat(term));
        self.less(Self::ZERO).select(Self::splat(std::f32::consts::PI) - angle, angle)
    }

    /// Angles of the vectors (x, y), for y over x, to 2e-6 (minimax polynomial of the arctangent).
    #[inline(always)]
    pub fn atan2(y: Self, x: Self) -> Self {
        use std::f32::consts::{FRAC_PI_2, PI};
        const TERMS: [f32; 6] = [-0.011_721_2, 0.052_653_32, -0.116_432_87, 0.193_543_46, -0.332_623_47, 0.999_977_26];
        let (long, short) = (x.abs().max(y.abs()), x.abs().min(y.abs()));
        let t = short / long.max(Self::splat(1e-30));
        let squared = t * t;
        let mut sum = Self::ZERO;
        for term in TERMS {
            sum = sum * squared + Self::splat(term);
        }
        let steep = y.abs().greater(x.abs());
        let angle = steep.select(Self::splat(FRAC_PI_2) - sum * t, sum * t);
        x.less(Self::ZERO).select(Self::splat(PI) - angle, angle).copysign(y)
    }

    /// Error functions of numbers that are not negative, to 2e-7 (Abramowitz and Stegun 7.1.26).
    #[inline(always)]
    pub fn erf_positive(self) -> Self {
        let t = Self::ONE / (Self::ONE + Self::splat(0.327_591_1) * self);
        let terms = [1.061_405_4, -1.453_152, 1.421_413_7, -0.284_496_74, 0.254_829_6];
        let series = terms.into_iter().fold(Self::ZERO, |sum, term| sum * t + Self::splat(term)) * t;
        Self::ONE - series * (-(self * self)).exp_negative()
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
            assert!((erf - libm::erf(f64::from(x))).abs() < 1e-6, "{x}");
            let angle = i as f32 / 20_000.0 * 2.0 * std::f32::consts::PI - std::f32::consts::PI;
            let (sin, cos) = angle.sin_cos();
            let ours = <Lanes>::atan2(Lanes::splat(sin), Lanes::splat(cos)).0[4];
            assert!((ours - sin.atan2(cos)).abs() < 3e-6, "{angle}: {ours}");
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
}
