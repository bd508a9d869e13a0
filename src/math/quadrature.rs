//! Gauss-Legendre quadrature.

use std::f64::consts::PI;

/// Nodes and weights for the integral over [0, 1], exact for polynomials of degree 2n - 1.
pub fn gauss_legendre(n: usize) -> Vec<(f32, f32)> {
    // The Legendre polynomial and its derivative, by recurrence.
    let legendre = |x: f64| {
        let (mut p, mut last) = (1.0, 0.0);
        for k in 0..n {
            let k = k as f64;
            (p, last) = (((2.0 * k + 1.0) * x * p - k * last) / (k + 1.0), p);
        }
        (p, n as f64 * (x * p - last) / (x * x - 1.0))
    };
    let node = |i: usize| {
        let mut x = (PI * (i as f64 + 0.75) / (n as f64 + 0.5)).cos();
        for _ in 0..10 {
            let (p, slope) = legendre(x);
            x -= p / slope;
        }
        let (_, slope) = legendre(x);
        let weight = 1.0 / ((1.0 - x * x) * slope * slope);
        ((0.5 * x + 0.5) as f32, weight as f32)
    };
    (0..n).map(node).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn polynomials_are_integrated_exactly() {
        let rule = gauss_legendre(8);
        for degree in 0..16 {
            let sum: f32 = rule.iter().map(|&(x, w)| w * x.powi(degree)).sum();
            assert!((sum * (degree + 1) as f32 - 1.0).abs() < 1e-5, "{degree}: {sum}");
        }
    }
}
