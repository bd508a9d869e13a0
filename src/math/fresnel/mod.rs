//! Fresnel equations and the directions they speak of. Local coordinates: the normal is +z, directions point
//! away from the surface.

pub mod lanes;

use self::lanes::Dielectrics;
use super::lanes::{Lanes, Lanes3};
use super::{Rgb, Vec3, vec3};

/// Reflection and refraction of a direction at a smooth dielectric interface.
#[derive(Clone, Copy, Debug)]
pub struct Dielectric {
    /// Reflected share of unpolarised light, in [0, 1].
    pub reflectance: f32,
    /// Cosine of the transmitted direction, with the opposite sign of the incident one; 0 on total reflection.
    pub cos_t: f32,
    /// Relative index from the transmitted to the incident side: sin θt = sin θi · eta_ti.
    pub eta_ti: f32,
}

/// Fresnel reflectance of a dielectric with relative index `eta` = interior / exterior, seen along a direction
/// of cosine `cos_i` (negative: from inside).
pub fn dielectric(cos_i: f32, eta: f32) -> Dielectric {
    let Dielectrics { reflectance, cos_t, eta_ti } = lanes::dielectric(Lanes([cos_i]), Lanes([eta]));
    Dielectric { reflectance: reflectance.0[0], cos_t: cos_t.0[0], eta_ti: eta_ti.0[0] }
}

/// Fresnel reflectance of a conductor with complex index `eta - i k`, per channel (PBR Book, "Fresnel for
/// conductors").
pub fn conductor(cos_i: f32, eta: Rgb, k: Rgb) -> Rgb {
    lanes::conductor::<1>(Lanes([cos_i]), Lanes3::splat(eta), Lanes3::splat(k)).get(0)
}

/// Average reflectance of a dielectric interface under diffuse illumination, 2 ∫ R(µ) µ dµ, by the fits that renderers
/// agree on: Egan and Hilgeman 1973 from the denser side (`eta` < 1), d'Eon and Irving 2011 from the other.
pub fn dielectric_diffuse(eta: f32) -> f32 {
    if eta < 1.0 {
        return -1.4399 * eta * eta + 0.7099 * eta + 0.6681 + 0.0636 / eta;
    }
    let x = 1.0 / eta;
    0.919_317 + x * (-3.4793 + x * (6.753_35 + x * (-7.809_89 + x * (4.985_54 - x * 1.368_81))))
}

/// Mirrors `wi` about +z.
pub fn reflect(wi: Vec3) -> Vec3 {
    vec3(-wi.x, -wi.y, wi.z)
}

/// Mirrors `wi` about the unit vector `m`.
pub fn reflect_about(wi: Vec3, m: Vec3) -> Vec3 {
    2.0 * wi.dot(m) * m - wi
}

/// Refracts `wi` at +z, with the result of [`dielectric`].
pub fn refract(wi: Vec3, cos_t: f32, eta_ti: f32) -> Vec3 {
    vec3(-eta_ti * wi.x, -eta_ti * wi.y, cos_t)
}

/// Refracts `wi` at the unit vector `m`.
pub fn refract_about(wi: Vec3, m: Vec3, cos_t: f32, eta_ti: f32) -> Vec3 {
    m * (wi.dot(m) * eta_ti + cos_t) - wi * eta_ti
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dielectric_has_its_closed_values() {
        assert!((dielectric(1.0, 1.5).reflectance - 0.04).abs() < 1e-6);
        assert!((dielectric(-1.0, 1.5).reflectance - 0.04).abs() < 1e-6);
        assert_eq!(dielectric(-0.1, 1.5).reflectance, 1.0);
        assert_eq!(dielectric(0.3, 1.0).reflectance, 0.0);
        // Stokes' relation: the same light path seen from its other end is reflected equally.
        let outside = dielectric(0.6, 1.33);
        assert!((dielectric(outside.cos_t, 1.33).reflectance - outside.reflectance).abs() < 1e-6);
    }

    #[test]
    fn conductor_has_its_closed_values() {
        let normal = conductor(1.0, Rgb::splat(0.2), Rgb::splat(3.0));
        let expected = ((0.2f32 - 1.0).powi(2) + 9.0) / ((0.2f32 + 1.0).powi(2) + 9.0);
        assert!((normal.x - expected).abs() < 1e-6);
        // Without absorption it is a dielectric.
        assert!((conductor(0.4, Rgb::splat(1.5), Rgb::ZERO).x - dielectric(0.4, 1.5).reflectance).abs() < 1e-6);
        assert!((conductor(0.0, Rgb::ONE, Rgb::ZERO).x).is_finite());
    }

    #[test]
    fn diffuse_reflectance_is_as_near_to_its_integral_as_the_fits_are() {
        for eta in [1.0 / 1.5, 1.0 / 1.1, 1.33, 1.5, 2.4f32] {
            let n = 200_000;
            let fine: f64 = (0..n)
                .map(|i| (f64::from(i) + 0.5) / f64::from(n))
                .map(|mu| 2.0 * f64::from(dielectric(mu as f32, eta).reflectance) * mu / f64::from(n))
                .sum();
            assert!((f64::from(dielectric_diffuse(eta)) - fine).abs() < 0.012, "{eta}: {fine}");
        }
    }

    #[test]
    fn refraction_obeys_snell() {
        let wi = vec3(0.6, 0.0, 0.8);
        let found = dielectric(wi.z, 1.5);
        let wo = refract(wi, found.cos_t, found.eta_ti);
        assert!((wo.length() - 1.0).abs() < 1e-6 && (wo.x + 0.4).abs() < 1e-6 && wo.z < 0.0);
        assert!(refract_about(wi, Vec3::Z, found.cos_t, found.eta_ti).distance(wo) < 1e-6);
    }
}
