//! Microfacet distributions of materials: parameters, and integrals over them.

use std::sync::Arc;

use crate::error::Result;
use crate::math::fresnel::lanes as fresnel;
use crate::math::lanes::{LANES, Lanes, Lanes3, Mask};
use crate::math::quadrature::gauss_legendre;
use crate::math::{Rgb, Vec2, Vec3, vec2, vec3};
use crate::scene::closure::facets::{Facets, Ggx, Transmittance};
use crate::scene::closure::visible_facets;
use crate::scene::plugin::{Loader, Object};
use crate::scene::texture::{Point, Texture};

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
    pub fn load(object: &Object, loader: &mut dyn Loader) -> Result<Self> {
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
    pub fn at(&self, at: &Point) -> Microfacet {
        let u = self.u.scalar(at);
        let v = self.v.as_ref().map_or(u, |v| v.scalar(at));
        Microfacet::anisotropic(self.kind, vec2(u, v))
    }

    /// The textures that it is read from.
    pub fn textures(&self) -> impl Iterator<Item = &dyn Texture> {
        [Some(&self.u), self.v.as_ref()].into_iter().flatten().map(|texture| &**texture)
    }

    /// Whether the tangents matter.
    pub fn is_anisotropic(&self) -> bool {
        self.v.is_some()
    }
}

impl Kind {
    /// From `distribution`. The powers of cosines that older files may ask for are nearly Beckmann's distribution.
    pub fn load(object: &Object, loader: &dyn Loader) -> Result<Self> {
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

    /// The distribution as closures have it.
    pub fn facets(&self) -> Facets<1> {
        let ggx = Mask([if self.kind == Kind::Ggx { !0 } else { 0 }]);
        Facets { ggx, alpha: [Lanes([self.alpha.x]), Lanes([self.alpha.y])] }
    }

    /// The same, where it is known to be [`Kind::Ggx`].
    pub fn ggx(&self) -> Ggx<1> {
        Ggx { alpha: self.facets().alpha }
    }

    /// [`Facets::d`].
    pub fn d(&self, m: Vec3) -> f32 {
        self.facets().d(Lanes3::splat(m)).0[0]
    }

    /// [`Facets::g1`].
    pub fn g1(&self, v: Vec3, m: Vec3) -> f32 {
        self.facets().g1(Lanes3::splat(v), Lanes3::splat(m)).0[0]
    }

    /// [`Facets::reflect_pdf`].
    pub fn reflect_pdf(&self, wi: Vec3, m: Vec3) -> f32 {
        self.facets().reflect_pdf(Lanes3::splat(wi), Lanes3::splat(m)).0[0]
    }

    /// [`Facets::sample_visible`].
    pub fn sample_visible(&self, wi: Vec3, u: Vec2) -> Vec3 {
        self.facets().sample_visible(Lanes3::splat(wi), [Lanes([u.x]), Lanes([u.y])]).get(0)
    }
}

/// Directional integrals of a rough dielectric interface.
pub struct RoughTransmittance {
    series: Transmittance<1>,
    /// Diffuse reflectance of the interface from inside.
    pub internal: f32,
}

/// Nodes of the quadrature along either random number: two packets.
const QUADRATURE: usize = 2 * LANES;

/// Cosines of which the internal reflectance is the mean.
const COSINES: usize = 64;

impl RoughTransmittance {
    /// Integrates for relative index `eta` > 1. The transmittance counts light that is refracted and not masked
    /// on its way out; the internal reflectance is the mean of 2 R(µ) µ over equally spaced cosines.
    pub fn new(facets: Microfacet, eta: f32) -> Self {
        let rule = gauss_legendre(QUADRATURE);
        let [nodes, weights] = [0, 1].map(|k| rule.iter().map(|node| [node.0, node.1][k]).collect::<Vec<f32>>());
        let facets =
            Facets { ggx: Mask([facets.facets().ggx.0[0]; LANES]), alpha: facets.alpha.to_array().map(Lanes::splat) };
        let transmitted = |wi: Lanes3, m: Lanes3| {
            let found = fresnel::dielectric(wi.dot(m), Lanes::splat(eta));
            let wo = fresnel::refract_about(wi, m, &found);
            wo.z.less(Lanes::ZERO).select(facets.g1(wo, m) * (Lanes::ONE - found.reflectance), Lanes::ZERO)
        };
        let reflected = |wi: Lanes3, m: Lanes3| {
            let wo = fresnel::reflect_about(wi, m);
            let share = fresnel::dielectric(wi.dot(m), Lanes::splat(1.0 / eta)).reflectance;
            wo.z.greater(Lanes::ZERO).select(facets.g1(wo, m) * share, Lanes::ZERO)
        };
        let average = |mu: f32, term: &dyn Fn(Lanes3, Lanes3) -> Lanes| {
            let mu = mu.max(1e-6);
            let wi = Lanes3::splat(vec3((1.0 - mu * mu).max(0.0).sqrt(), 0.0, mu));
            let packet = |first: usize, v: f32| {
                let (u, weight): (Lanes, Lanes) = (Lanes::load(&nodes[first..]), Lanes::load(&weights[first..]));
                (weight * term(wi, visible_facets(&facets, wi, [u, Lanes::splat(v)]))).sum()
            };
            rule.iter().map(|&(v, weight)| weight * (packet(0, v) + packet(LANES, v))).sum::<f32>()
        };
        let internal = (0..COSINES).map(|k| k as f32 / (COSINES - 1) as f32);
        let internal = internal.map(|mu| 2.0 * mu * average(mu, &reflected)).sum::<f32>() / COSINES as f32;
        Self { series: Transmittance::fit(|mu| average(mu, &transmitted)), internal }
    }

    /// Transmitted share at a cosine in [0, 1].
    pub fn at(&self, cos: f32) -> f32 {
        self.series.at(Lanes([cos])).0[0]
    }

    /// The transmittance as closures have it.
    pub fn series(&self) -> Transmittance<1> {
        self.series
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
