//! Maps from the unit square to the domains that are sampled. Each is continuous and has its density beside it.

use std::f32::consts::{FRAC_1_PI, FRAC_PI_4, PI};

use super::lanes::{Lanes, Lanes3};
use super::{Vec2, Vec3, vec2, vec3};

/// Uniform on the unit disk (Shirley and Chiu 1997, concentric map).
pub fn disk(u: Vec2) -> Vec2 {
    let [x, y] = disk_lanes::<1>([u.x, u.y].map(|u| Lanes([u])));
    vec2(x.0[0], y.0[0])
}

/// [`disk`] for several points at a time.
#[inline(always)]
pub fn disk_lanes<const N: usize>([u, v]: [Lanes<N>; 2]) -> [Lanes<N>; 2] {
    let two = Lanes::splat(2.0);
    let (x, y) = (two * u - Lanes::ONE, two * v - Lanes::ONE);
    let wide = x.abs().greater(y.abs());
    let (radius, other) = (wide.select(x, y), wide.select(y, x));
    let nonzero = radius.abs().greater(Lanes::ZERO);
    let angle = nonzero.select(Lanes::splat(FRAC_PI_4) * (other / radius), Lanes::ZERO);
    let (cosine, sine) = angle.cos_sin_small();
    [radius * wide.select(cosine, sine), radius * wide.select(sine, cosine)]
}

/// Cosine-weighted on the upper hemisphere; density cos θ / π.
pub fn cosine_hemisphere(u: Vec2) -> Vec3 {
    cosine_hemisphere_lanes::<1>([u.x, u.y].map(|u| Lanes([u]))).get(0)
}

/// [`cosine_hemisphere`] for several points at a time.
#[inline(always)]
pub fn cosine_hemisphere_lanes<const N: usize>(u: [Lanes<N>; 2]) -> Lanes3<N> {
    let [x, y] = disk_lanes(u);
    Lanes3 { x, y, z: (Lanes::ONE - (x * x + y * y)).max(Lanes::ZERO).sqrt() }
}

/// Density of [`cosine_hemisphere`] per solid angle.
pub fn cosine_hemisphere_pdf(cos: f32) -> f32 {
    cos.max(0.0) * FRAC_1_PI
}

/// [`cosine_hemisphere_pdf`] for several directions at a time.
#[inline(always)]
pub fn cosine_hemisphere_pdfs<const N: usize>(cos: Lanes<N>) -> Lanes<N> {
    cos.max(Lanes::ZERO) * Lanes::splat(FRAC_1_PI)
}

/// Uniform on the unit sphere; density 1 / 4π.
pub fn sphere(u: Vec2) -> Vec3 {
    let z = 1.0 - 2.0 * u.x;
    let radius = (1.0 - z * z).max(0.0).sqrt();
    let angle = 2.0 * PI * u.y;
    vec3(radius * angle.cos(), radius * angle.sin(), z)
}

/// Uniform in the cone about +z of which `versine` = 1 - cos of the half angle; density 1 / (2π versine).
/// Taking 1 - cos keeps narrow cones exact.
pub fn cone(u: Vec2, versine: f32) -> Vec3 {
    let height = u.x * versine;
    let radius = (height * (2.0 - height)).max(0.0).sqrt();
    let angle = 2.0 * PI * u.y;
    vec3(radius * angle.cos(), radius * angle.sin(), 1.0 - height)
}

/// Barycentric weights of the second and third vertex, uniform over a triangle.
pub fn triangle(u: Vec2) -> Vec2 {
    let root = (1.0 - u.x).max(0.0).sqrt();
    vec2(1.0 - root, u.y * root)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Means over a regular grid against the distributions' closed moments.
    fn mean(f: impl Fn(Vec2) -> f32) -> f32 {
        let n = 256;
        let cell = |i: usize| (i as f32 + 0.5) / n as f32;
        (0..n * n).map(|i| f(vec2(cell(i % n), cell(i / n)))).sum::<f32>() / (n * n) as f32
    }

    #[test]
    fn moments_are_those_of_the_distributions() {
        assert!((mean(|u| disk(u).length_squared()) - 0.5).abs() < 1e-3);
        assert!((mean(|u| cosine_hemisphere(u).z) - 2.0 / 3.0).abs() < 1e-3);
        assert!(mean(|u| sphere(u).z).abs() < 1e-3 && (mean(|u| sphere(u).x.powi(2)) - 1.0 / 3.0).abs() < 1e-3);
        assert!((mean(|u| cone(u, 0.25).z) - 0.875).abs() < 1e-3);
        assert!((mean(|u| triangle(u).x) - 1.0 / 3.0).abs() < 1e-3);
        assert!((mean(|u| triangle(u).y) - 1.0 / 3.0).abs() < 1e-3);
    }
}
