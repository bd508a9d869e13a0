//! Microfacet distributions: Beckmann and GGX with sampling of visible normals.
//!
//! Walter et al. 2007 for the distributions and Smith's shadowing; Heitz and d'Eon 2014 for visible normals.

use std::f32::consts::FRAC_1_PI;
use std::sync::Arc;

use crate::error::Result;
use crate::math::quadrature::gauss_legendre;
use crate::math::{Rgb, Vec2, Vec3, vec2, vec3, warp};
use crate::scene::Surface;
use crate::scene::load::Loader;
use crate::scene::load::props::Object;
use crate::scene::texture::Texture;

/// Smaller roughness than this is indistinguishable from smooth and numerically unsafe.
const MIN_ALPHA: f32 = 1e-4;

/// The shape of the distribution's tail.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Gaussian slopes.
    Beckmann,
    /// Long-tailed slopes (Trowbridge-Reitz).
    Ggx,
}

/// A distribution of facet normals.
#[derive(Clone, Copy, Debug)]
pub struct Microfacet {
    /// Shape.
    pub kind: Kind,
    /// Root mean square slope along both tangents (times √2 for Beckmann's convention).
    pub alpha: Vec2,
}

/// A roughness that may vary over the surface.
pub struct Roughness {
    kind: Kind,
    /// Along the first tangent, or both.
    u: Arc<dyn Texture>,
    /// Along the second tangent where that is different.
    v: Option<Arc<dyn Texture>>,
}

impl Roughness {
    /// From `distribution` and `alpha`, or `alpha_u` and `alpha_v`. Visible normals are always sampled.
    pub fn load(object: &Object, loader: &mut Loader) -> Result<Self> {
        object.ignore(&["sample_visible"]);
        let kind = Kind::load(object, loader)?;
        let mut alpha = |name: &str| loader.texture(object, name, Rgb::splat(0.1));
        match (object.get("alpha_u").is_some(), object.get("alpha_v").is_some()) {
            (false, false) => Ok(Self { kind, u: alpha("alpha")?, v: None }),
            (true, true) if object.get("alpha").is_none() => {
                Ok(Self { kind, u: alpha("alpha_u")?, v: Some(alpha("alpha_v")?) })
            }
            _ => Err(object.loc_of("alpha_u").invalid("give either `alpha`, or both `alpha_u` and `alpha_v`")),
        }
    }

    /// The distribution at a surface point.
    pub fn at(&self, surface: &Surface) -> Microfacet {
        let u = self.u.scalar(&surface.at);
        let v = self.v.as_ref().map_or(u, |v| v.scalar(&surface.at));
        Microfacet::anisotropic(self.kind, vec2(u, v))
    }

    /// Whether the tangents matter.
    pub fn is_anisotropic(&self) -> bool {
        self.v.is_some()
    }
}

impl Kind {
    /// From `distribution`. The powers of cosines that older files may ask for are nearly Beckmann's distribution.
    pub fn load(object: &Object, loader: &Loader) -> Result<Self> {
        let kind = object.choice("distribution", &["beckmann", "ggx", "phong", "as"], 0)?;
        if kind >= 2 {
            let what = "the distribution of facets is taken as `beckmann` of the same roughness";
            loader.warn(&object.loc_of("distribution"), what)?;
        }
        Ok(if kind == 1 { Self::Ggx } else { Self::Beckmann })
    }
}

impl Microfacet {
    /// The same roughness in all directions.
    pub fn new(kind: Kind, alpha: f32) -> Self {
        Self::anisotropic(kind, Vec2::splat(alpha))
    }

    /// `alpha` is kept at or above 1e-4.
    pub fn anisotropic(kind: Kind, alpha: Vec2) -> Self {
        Self { kind, alpha: alpha.max(Vec2::splat(MIN_ALPHA)) }
    }

    /// The smaller roughness.
    pub fn smallest(&self) -> f32 {
        self.alpha.min_element()
    }

    /// Density of facet normals `m` per solid angle of normal, per projected area: ∫ D cos θ dω = 1.
    pub fn d(&self, m: Vec3) -> f32 {
        if m.z <= 0.0 {
            return 0.0;
        }
        let (a2, cos2) = (self.alpha.x * self.alpha.y, m.z * m.z);
        let slope2 = (m.truncate() / self.alpha).length_squared();
        let value = match self.kind {
            Kind::Beckmann => (-slope2 / cos2).exp() * FRAC_1_PI / (a2 * cos2 * cos2),
            Kind::Ggx => FRAC_1_PI / (a2 * (slope2 + cos2) * (slope2 + cos2)),
        };
        // Far out in the tail the products below would be denormal.
        if value * m.z > 1e-20 { value } else { 0.0 }
    }

    /// Smith's masking of facets `m` along `v`. Beckmann uses the rational fit of Walter et al.
    pub fn g1(&self, v: Vec3, m: Vec3) -> f32 {
        if v.dot(m) * v.z <= 0.0 {
            return 0.0;
        }
        let tan2 = (v.truncate() * self.alpha).length_squared() / (v.z * v.z);
        if tan2 == 0.0 {
            return 1.0;
        }
        match self.kind {
            Kind::Beckmann => {
                let a = 1.0 / tan2.sqrt();
                if a >= 1.6 { 1.0 } else { (3.535 * a + 2.181 * a * a) / (1.0 + 2.276 * a + 2.577 * a * a) }
            }
            Kind::Ggx => 2.0 / (1.0 + (1.0 + tan2).sqrt()),
        }
    }

    /// Density of the mirror direction of `wi` about a visible normal `m`: D G1(wi) / 4 cos θi.
    pub fn reflect_pdf(&self, wi: Vec3, m: Vec3) -> f32 {
        self.d(m) * self.g1(wi, m) / (4.0 * wi.z)
    }

    /// Density of [`Microfacet::sample_visible`] per solid angle of normal.
    pub fn visible_pdf(&self, wi: Vec3, m: Vec3) -> f32 {
        self.d(m) * self.g1(wi, m) * (wi.dot(m) / wi.z).abs()
    }

    /// A normal in proportion to its visible area from `wi` (wi.z > 0); density D G1 wi·m / cos θi.
    pub fn sample_visible(&self, wi: Vec3, u: Vec2) -> Vec3 {
        let stretched = (self.alpha * wi.truncate()).extend(wi.z).normalize();
        let sin = vec2(stretched.x, stretched.y).length();
        let (cos_phi, sin_phi) = if sin > 0.0 { (stretched.x / sin, stretched.y / sin) } else { (1.0, 0.0) };
        let slope = match self.kind {
            Kind::Beckmann => beckmann_slope(stretched.z, sin, u),
            Kind::Ggx => ggx_slope(stretched.z, sin, u),
        };
        let turned = vec2(cos_phi * slope.x - sin_phi * slope.y, sin_phi * slope.x + cos_phi * slope.y);
        (-self.alpha * turned).extend(1.0).normalize()
    }
}

/// Slope of a visible normal of the unit GGX surface, from the visible disk of a hemisphere (Heitz 2018).
fn ggx_slope(cos: f32, sin: f32, u: Vec2) -> Vec2 {
    let mut p = warp::disk(u);
    let height = (1.0 - p.x * p.x).max(0.0).sqrt();
    let share = 0.5 * (1.0 + cos);
    p.y = height * (1.0 - share) + p.y * share;
    let z = (1.0 - p.length_squared()).max(0.0).sqrt();
    let scale = 1.0 / (sin * p.y + cos * z).max(1e-12);
    vec2(cos * p.y - sin * z, p.x) * scale
}

/// Slope of a visible normal of the unit Beckmann surface: the slope along the view is found by inverting its
/// distribution with Newton steps inside a bracket, the one across is Gaussian.
fn beckmann_slope(cos: f32, sin: f32, u: Vec2) -> Vec2 {
    let u = u.clamp(Vec2::splat(1e-6), Vec2::splat(1.0 - 1e-6));
    let across = erf_inv(2.0 * u.y - 1.0);
    let (cos, sin) = (f64::from(cos), f64::from(sin));
    // P(slope < x) is proportional to the visible area below x: the integral of (cos - s sin) exp(-s²).
    let visible = |x: f64| cos * 0.5 * PI64_SQRT * (1.0 + libm::erf(x)) + sin * 0.5 * (-x * x).exp();
    let upper = if sin > 1e-9 { (cos / sin).min(6.0) } else { 6.0 };
    let target = f64::from(u.x) * visible(upper);
    let (mut low, mut high) = (-6.0, upper);
    let mut x = 0.0f64.clamp(low, high);
    for _ in 0..24 {
        let error = visible(x) - target;
        if error > 0.0 {
            high = x
        } else {
            low = x
        }
        let density = (cos - x * sin) * (-x * x).exp();
        let newton = x - error / density;
        let next = if density > 0.0 && newton > low && newton < high { newton } else { 0.5 * (low + high) };
        let step = (next - x).abs();
        x = next;
        if step < 1e-7 {
            break;
        }
    }
    vec2(x as f32, across)
}

const PI64_SQRT: f64 = 1.772_453_850_905_516;

/// Inverse error function (Giles 2012, single precision).
fn erf_inv(x: f32) -> f32 {
    let w = -((1.0 - x) * (1.0 + x)).max(1e-12).ln();
    let polynomial = |coefficients: [f32; 9], w: f32| coefficients.into_iter().fold(0.0, |sum, c| sum * w + c);
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
    if w < 5.0 { polynomial(CENTRE, w - 2.5) * x } else { polynomial(TAIL, w.sqrt() - 3.0) * x }
}

/// Directional integrals of a rough dielectric interface, tabulated over the cosine.
pub struct RoughTransmittance {
    table: [f32; Self::NODES],
    /// Diffuse reflectance of the interface from inside.
    pub internal: f32,
}

impl RoughTransmittance {
    const NODES: usize = 64;
    const QUADRATURE: usize = 32;

    /// Tabulates for relative index `eta` > 1. The transmittance counts light that is refracted and not masked
    /// on its way out; the internal reflectance is the mean of 2 R(µ) µ over the nodes.
    pub fn new(facets: Microfacet, eta: f32) -> Self {
        use crate::math::fresnel;
        let rule = gauss_legendre(Self::QUADRATURE);
        let node = |k: usize| (k as f32 / (Self::NODES - 1) as f32).max(1e-6);
        let transmitted = |wi: Vec3, m: Vec3| {
            let found = fresnel::dielectric(wi.dot(m), eta);
            let wo = fresnel::refract_about(wi, m, found.cos_t, found.eta_ti);
            if wo.z < 0.0 { facets.g1(wo, m) * (1.0 - found.reflectance) } else { 0.0 }
        };
        let reflected = |wi: Vec3, m: Vec3| {
            let wo = fresnel::reflect_about(wi, m);
            if wo.z > 0.0 { facets.g1(wo, m) * fresnel::dielectric(wi.dot(m), 1.0 / eta).reflectance } else { 0.0 }
        };
        let average = |mu: f32, term: &dyn Fn(Vec3, Vec3) -> f32| {
            let wi = vec3((1.0 - mu * mu).max(0.0).sqrt(), 0.0, mu);
            let row = |&(v, weight): &(f32, f32)| {
                let value = |&(u, weight): &(f32, f32)| weight * term(wi, facets.sample_visible(wi, vec2(u, v)));
                weight * rule.iter().map(value).sum::<f32>()
            };
            rule.iter().map(row).sum::<f32>()
        };
        let table = std::array::from_fn(|k| average(node(k), &transmitted));
        let internal = (0..Self::NODES).map(|k| 2.0 * node(k) * average(node(k), &reflected)).sum::<f32>();
        Self { table, internal: internal / Self::NODES as f32 }
    }

    /// Transmitted share at a cosine in [0, 1].
    pub fn at(&self, cos: f32) -> f32 {
        let x = cos.clamp(0.0, 1.0) * (Self::NODES - 1) as f32;
        let i = (x as usize).min(Self::NODES - 2);
        let f = x - i as f32;
        self.table[i] * (1.0 - f) + self.table[i + 1] * f
    }
}

#[cfg(test)]
mod tests {
    use std::f32::consts::PI;

    use super::*;

    const ALPHAS: [f32; 3] = [0.05, 0.3, 1.0];

    fn each(mut check: impl FnMut(Microfacet)) {
        for kind in [Kind::Beckmann, Kind::Ggx] {
            ALPHAS.into_iter().for_each(|alpha| check(Microfacet::new(kind, alpha)));
            check(Microfacet::anisotropic(kind, vec2(0.3, 0.1)));
        }
    }

    /// ∫ f(m) dω over the upper hemisphere, in the tangent of the angle so that sharp peaks are resolved.
    fn integrate(f: impl Fn(Vec3) -> f32, alpha: f32) -> f64 {
        let (n_theta, n_phi) = (2000, 64);
        let mut sum = 0.0;
        for i in 0..n_theta {
            let t = (i as f32 + 0.5) / n_theta as f32;
            let tan = alpha * t / (1.0 - t);
            let theta = tan.atan();
            let d_theta = alpha / ((1.0 - t) * (1.0 - t)) / (1.0 + tan * tan) / n_theta as f32;
            for j in 0..n_phi {
                let phi = 2.0 * PI * (j as f32 + 0.5) / n_phi as f32;
                let m = vec3(theta.sin() * phi.cos(), theta.sin() * phi.sin(), theta.cos());
                sum += f64::from(f(m) * theta.sin() * d_theta * 2.0 * PI / n_phi as f32);
            }
        }
        sum
    }

    #[test]
    fn projected_area_is_one_and_visible_area_is_the_cosine() {
        each(|facets| {
            let area = integrate(|m| facets.d(m) * m.z, facets.alpha.x);
            assert!((area - 1.0).abs() < 2e-3, "{facets:?}: {area}");
            for wi in [vec3(0.0, 0.0, 1.0), vec3(0.8, 0.0, 0.6), vec3(0.0, 0.98, 0.199)] {
                let visible = integrate(|m| facets.d(m) * facets.g1(wi, m) * wi.dot(m).max(0.0), facets.alpha.x);
                // Exact for GGX; the rational fit of Beckmann's masking is good to half a percent.
                let tolerance = if facets.kind == Kind::Ggx { 3e-3 } else { 1e-2 };
                assert!((visible / f64::from(wi.z) - 1.0).abs() < tolerance, "{facets:?} {wi}: {visible}");
            }
        });
    }

    #[test]
    fn sampled_normals_follow_the_visible_density() {
        each(|facets| {
            for wi in [vec3(0.0, 0.0, 1.0), vec3(0.8, 0.0, 0.6), vec3(0.0, 0.98, 0.199)] {
                let n = 300;
                let cell = |i: usize| (i as f32 + 0.5) / n as f32;
                let mut sampled = Vec3::ZERO;
                for i in 0..n * n {
                    sampled += facets.sample_visible(wi, vec2(cell(i % n), cell(i / n))) / (n * n) as f32;
                }
                let pdf = |m: Vec3| facets.d(m) * facets.g1(wi, m) * wi.dot(m).max(0.0) / wi.z;
                let expected = [0, 1, 2].map(|axis| integrate(|m| pdf(m) * m[axis], facets.alpha.x) as f32);
                assert!(sampled.distance(Vec3::from_array(expected)) < 1e-2, "{facets:?} {wi}: {sampled} {expected:?}");
            }
        });
    }

    #[test]
    fn inverse_error_function_inverts() {
        for x in [-0.999f32, -0.7, -1e-3, 0.0, 0.5, 0.99] {
            assert!((libm::erff(erf_inv(x)) - x).abs() < 2e-6, "{x}");
        }
    }

    #[test]
    fn tables_agree_with_a_smooth_interface_when_roughness_vanishes() {
        let tables = RoughTransmittance::new(Microfacet::new(Kind::Ggx, 1e-3), 1.5);
        for cos in [0.2f32, 0.5, 1.0] {
            let smooth = 1.0 - crate::math::fresnel::dielectric(cos, 1.5).reflectance;
            assert!((tables.at(cos) - smooth).abs() < 5e-3, "{cos}");
        }
        // The mean over nodes is the integral up to one part in their number.
        assert!((tables.internal - crate::math::fresnel::dielectric_diffuse(1.0 / 1.5)).abs() < 0.02);
    }
}
