//! Microfacet distributions: Beckmann and GGX with sampling of visible normals.
//!
//! Walter et al. 2007 for the distributions and Smith's shadowing; Heitz and d'Eon 2014 for visible normals.

use std::f32::consts::FRAC_1_PI;

use crate::math::lanes::{LANES, Lanes, Lanes3, Mask};
use crate::math::warp;

/// Distributions of facet normals.
#[derive(Clone, Copy, Debug)]
pub struct Facets<const N: usize = LANES> {
    /// Lanes of long-tailed slopes (Trowbridge-Reitz); the others are Beckmann's, Gaussian.
    pub ggx: Mask<N>,
    /// Root mean square slopes along both tangents (times √2 for Beckmann's convention).
    pub alpha: [Lanes<N>; 2],
}

/// Distributions of long-tailed slopes, known to be such.
#[derive(Clone, Copy, Debug)]
pub struct Ggx<const N: usize = LANES> {
    /// As of [`Facets`].
    pub alpha: [Lanes<N>; 2],
}

impl<const N: usize> From<Ggx<N>> for Facets<N> {
    #[inline(always)]
    fn from(Ggx { alpha }: Ggx<N>) -> Self {
        Self { ggx: !Mask::NONE, alpha }
    }
}

/// Densities and masking of a distribution.
macro_rules! densities {
    ($facets:ident) => {
        impl<const N: usize> $facets<N> {
            /// Density of the mirror direction of `wi` about a visible normal `m`: D G1(wi) / 4 cos θi.
            #[inline(always)]
            pub fn reflect_pdf(&self, wi: Lanes3<N>, m: Lanes3<N>) -> Lanes<N> {
                self.d(m) * self.g1(wi, m) / (Lanes::splat(4.0) * wi.z)
            }

            /// Density of [`Facets::sample_visible`] per solid angle of normal.
            #[inline(always)]
            pub fn visible_pdf(&self, wi: Lanes3<N>, m: Lanes3<N>) -> Lanes<N> {
                self.d(m) * self.g1(wi, m) * (wi.dot(m) / wi.z).abs()
            }
        }
    };
}

densities!(Facets);
densities!(Ggx);

/// Squared slopes over the roughness of normals `m`, and their squared cosines.
#[inline(always)]
fn slopes<const N: usize>([u, v]: [Lanes<N>; 2], m: Lanes3<N>) -> (Lanes<N>, Lanes<N>) {
    let (x, y) = (m.x / u, m.y / v);
    (x * x + y * y, m.z * m.z)
}

/// Densities, but none far out in the tail, where products would be denormal.
#[inline(always)]
fn without_tail<const N: usize>(value: Lanes<N>, m: Lanes3<N>) -> Lanes<N> {
    let there = m.z.greater(Lanes::ZERO) & (value * m.z).greater(Lanes::splat(1e-20));
    there.select(value, Lanes::ZERO)
}

/// Squared tangents of directions, stretched by the roughness.
#[inline(always)]
fn stretched_tan2<const N: usize>(alpha: [Lanes<N>; 2], w: Lanes3<N>) -> Lanes<N> {
    let (x, y) = (w.x * alpha[0], w.y * alpha[1]);
    (x * x + y * y) / (w.z * w.z)
}

/// Masking, but none of facets that show a direction their backs.
#[inline(always)]
fn of_fronts<const N: usize>(masking: Lanes<N>, w: Lanes3<N>, m: Lanes3<N>) -> Lanes<N> {
    (w.dot(m) * w.z).greater(Lanes::ZERO).select(masking, Lanes::ZERO)
}

impl<const N: usize> Ggx<N> {
    /// [`Facets::d`].
    #[inline(always)]
    pub fn d(&self, m: Lanes3<N>) -> Lanes<N> {
        let (slope2, cos2) = slopes(self.alpha, m);
        let sum = slope2 + cos2;
        without_tail(Lanes::splat(FRAC_1_PI) / (self.alpha[0] * self.alpha[1] * sum * sum), m)
    }

    /// [`Facets::g1`].
    #[inline(always)]
    pub fn g1(&self, w: Lanes3<N>, m: Lanes3<N>) -> Lanes<N> {
        let root = (Lanes::ONE + stretched_tan2(self.alpha, w)).sqrt();
        of_fronts(Lanes::splat(2.0) / (Lanes::ONE + root), w, m)
    }
}

impl<const N: usize> Facets<N> {
    /// Others in some lanes.
    #[inline(always)]
    pub fn replaced(self, others: &Self, lanes: Mask<N>) -> Self {
        Self {
            ggx: (self.ggx & !lanes) | (others.ggx & lanes),
            alpha: [0, 1].map(|k| lanes.select(others.alpha[k], self.alpha[k])),
        }
    }

    /// Density of facet normals `m` per solid angle of normal, per projected area: ∫ D cos θ dω = 1.
    #[inline(always)]
    pub fn d(&self, m: Lanes3<N>) -> Lanes<N> {
        let (slope2, cos2) = slopes(self.alpha, m);
        let sum = self.ggx.select(slope2 + cos2, cos2);
        let value = Lanes::splat(FRAC_1_PI) / (self.alpha[0] * self.alpha[1] * sum * sum);
        without_tail(self.ggx.select(value, value * (-(slope2 / cos2)).exp_negative()), m)
    }

    /// Smith's masking of facets `m` along `w`. Beckmann uses the rational fit of Walter et al.
    #[inline(always)]
    pub fn g1(&self, w: Lanes3<N>, m: Lanes3<N>) -> Lanes<N> {
        let (one, constant) = (Lanes::ONE, Lanes::splat);
        let tan2 = stretched_tan2(self.alpha, w);
        let root = self.ggx.select(one + tan2, tan2).sqrt();
        let a = one / root;
        let fit = a * (constant(3.535) + constant(2.181) * a) / (one + a * (constant(2.276) + constant(2.577) * a));
        let gaussian = a.less(constant(1.6)).select(fit, one);
        of_fronts(self.ggx.select(constant(2.0) / (one + root), gaussian), w, m)
    }

    /// A normal in proportion to its visible area from `wi` (wi.z > 0); density D G1 wi·m / cos θi.
    #[inline(always)]
    pub fn sample_visible(&self, wi: Lanes3<N>, u: [Lanes<N>; 2]) -> Lanes3<N> {
        let [along_s, along_t] = self.alpha;
        let stretched = Lanes3 { x: wi.x * along_s, y: wi.y * along_t, z: wi.z }.normalize_or(Lanes3::UP);
        let sin = (stretched.x * stretched.x + stretched.y * stretched.y).sqrt();
        let tilted = sin.greater(Lanes::ZERO);
        let cos_phi = tilted.select(stretched.x / sin, Lanes::ONE);
        let sin_phi = tilted.select(stretched.y / sin, Lanes::ZERO);
        let [mut x, mut y] = [Lanes::ZERO; 2];
        if self.ggx.any() {
            [x, y] = ggx_slope(stretched.z, sin, u);
        }
        if (!self.ggx).any() {
            let [along, across] = beckmann_slope(stretched.z, sin, u);
            (x, y) = (self.ggx.select(x, along), self.ggx.select(y, across));
        }
        let turned = [cos_phi * x - sin_phi * y, sin_phi * x + cos_phi * y];
        Lanes3 { x: -(along_s * turned[0]), y: -(along_t * turned[1]), z: Lanes::ONE }.normalize_or(Lanes3::UP)
    }
}

/// Slopes of visible normals of the unit GGX surface, from the visible disk of a hemisphere (Heitz 2018).
#[inline(always)]
fn ggx_slope<const N: usize>(cos: Lanes<N>, sin: Lanes<N>, u: [Lanes<N>; 2]) -> [Lanes<N>; 2] {
    let (zero, one) = (Lanes::ZERO, Lanes::ONE);
    let [x, y] = warp::disk_lanes(u);
    let height = (one - x * x).max(zero).sqrt();
    let share = Lanes::splat(0.5) * (one + cos);
    let y = height * (one - share) + y * share;
    let z = (one - (x * x + y * y)).max(zero).sqrt();
    let scale = one / (sin * y + cos * z).max(Lanes::splat(1e-12));
    [(cos * y - sin * z) * scale, x * scale]
}

/// Newton steps that [`beckmann_slope`] takes; after them all but one in a thousand slopes are right to 1e-4.
const STEPS: usize = 3;

/// Slopes of visible normals of the unit Beckmann surface. Across the view they are Gaussian. Along it the visible area of
/// the slopes below s is cos (1 + erf s) + sin exp(-s²) / √π up to a factor, a concave function of y = 1 + erf s, which
/// Newton steps invert from Jakob's first guess (2014).
#[inline(always)]
fn beckmann_slope<const N: usize>(cos: Lanes<N>, sin: Lanes<N>, [u, v]: [Lanes<N>; 2]) -> [Lanes<N>; 2] {
    let constant = Lanes::splat;
    let (one, least) = (Lanes::ONE, constant(1e-6));
    let [u, v] = [u, v].map(|u| u.max(least).min(one - least));
    let across = erf_inv(constant(2.0) * v);
    // The largest visible slope is the cotangent.
    let steepest = (cos / sin.max(constant(1e-9))).max(Lanes::ZERO).min(constant(6.0));
    let highest = one + steepest.erf_positive();
    let sin_by_root = sin * constant(0.564_189_6);
    let total = cos * highest + sin_by_root * (-(steepest * steepest)).exp_negative();
    let target = u * total;
    let theta = cos.acos();
    let power = one + theta * (constant(-0.876) + theta * (constant(0.426_5) - constant(0.059_4) * theta));
    let mut y = highest * (one - ((one - u).ln() * power).min(Lanes::ZERO).exp_negative());
    for _ in 0..STEPS {
        y = y.max(constant(1e-7)).min(highest);
        let slope = erf_inv(y);
        let visible = cos * y + sin_by_root * (-(slope * slope)).exp_negative();
        y = y - (visible - target) / (cos - sin * slope).max(least);
    }
    [erf_inv(y.max(constant(1e-7)).min(highest)), across]
}

/// A polynomial, from the highest power on.
#[inline(always)]
fn polynomial<const N: usize>(coefficients: [f32; 9], x: Lanes<N>) -> Lanes<N> {
    let mut sum = Lanes::ZERO;
    for coefficient in coefficients {
        sum = sum * x + Lanes::splat(coefficient);
    }
    sum
}

/// Inverse error functions of y - 1 (Giles 2012, single precision).
#[inline(always)]
fn erf_inv<const N: usize>(y: Lanes<N>) -> Lanes<N> {
    const CENTRE: [f32; 9] = [
        2.810_226_4e-8,
        3.432_739_4e-7,
        -3.523_387_7e-6,
        -4.391_506_5e-6,
        2.185_808_7e-4,
        -1.253_725_e-3,
        -4.177_681_6e-3,
        0.246_640_73,
        1.501_409_4,
    ];
    const TAIL: [f32; 9] = [
        -2.002_142_6e-4,
        1.009_505_6e-4,
        1.349_343_2e-3,
        -3.673_428_4e-3,
        5.739_507_7e-3,
        -7.622_461_3e-3,
        9.438_870_5e-3,
        1.001_674,
        2.832_976_8,
    ];
    let w = -(y * (Lanes::splat(2.0) - y)).max(Lanes::splat(1e-12)).ln();
    let near = w.less(Lanes::splat(5.0));
    let mut factor = polynomial(CENTRE, w - Lanes::splat(2.5));
    if (!near).any() {
        factor = near.select(factor, polynomial(TAIL, w.max(Lanes::ZERO).sqrt() - Lanes::splat(3.0)));
    }
    factor * (y - Lanes::ONE)
}

/// Directional integrals of a rough dielectric interface over the cosine, as Chebyshev series.
#[derive(Clone, Copy, Debug)]
pub struct Transmittance<const N: usize = LANES> {
    /// Coefficients.
    pub series: [Lanes<N>; TRANSMITTANCE_TERMS],
}

/// Number of coefficients of a [`Transmittance`]: those of smooth interfaces are right to 1e-4.
pub const TRANSMITTANCE_TERMS: usize = 8;

/// The cosine's scale: near grazing the transmittance changes quickly.
const GRAZING: f32 = 0.3;

impl<const N: usize> Transmittance<N> {
    /// The transmitted shares at cosines in [0, 1].
    #[inline(always)]
    pub fn at(&self, cos: Lanes<N>) -> Lanes<N> {
        let cos = cos.max(Lanes::ZERO).min(Lanes::ONE);
        // From [0, 1] to [-1, 1].
        let scaled = cos * Lanes::splat(1.0 + GRAZING) / (cos + Lanes::splat(GRAZING));
        let twice = Lanes::splat(4.0) * scaled - Lanes::splat(2.0);
        let (mut b1, mut b2) = (Lanes::ZERO, Lanes::ZERO);
        for &term in self.series[1..].iter().rev() {
            (b1, b2) = (twice * b1 - b2 + term, b1);
        }
        Lanes::splat(0.5) * twice * b1 - b2 + self.series[0]
    }
}

impl Transmittance<1> {
    /// The series of a function of the cosine.
    pub fn fit(f: impl Fn(f32) -> f32) -> Self {
        const NODES: usize = 2 * TRANSMITTANCE_TERMS;
        let angle = |j: usize| std::f64::consts::PI * (j as f64 + 0.5) / NODES as f64;
        let value = |j: usize| {
            let scaled = 0.5 * (1.0 + angle(j).cos());
            let grazing = f64::from(GRAZING);
            f64::from(f((grazing * scaled / (1.0 + grazing - scaled)) as f32))
        };
        let values: [f64; NODES] = std::array::from_fn(value);
        let term = |k: usize| {
            let sum: f64 = (0..NODES).map(|j| values[j] * (k as f64 * angle(j)).cos()).sum();
            let share = if k == 0 { 1.0 } else { 2.0 };
            Lanes([(share * sum / NODES as f64) as f32])
        };
        Self { series: std::array::from_fn(term) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn inverse_error_function_inverts() {
        for x in [-0.999f32, -0.7, -1e-3, 0.0, 0.5, 0.99] {
            assert!((libm::erff(erf_inv(Lanes([1.0 + x])).0[0]) - x).abs() < 2e-6, "{x}");
        }
    }

    #[test]
    fn a_series_is_the_function() {
        let smooth = |cos: f32| 1.0 - crate::math::fresnel::dielectric(cos, 1.49).reflectance;
        let series = Transmittance::fit(smooth);
        for k in 0..=1000 {
            let cos = k as f32 / 1000.0;
            assert!((series.at(Lanes([cos])).0[0] - smooth(cos)).abs() < 2e-4, "{cos}");
        }
    }
}
