//! The Fresnel equations for several directions at a time.

use crate::math::lanes::{Lanes, Lanes3, Mask};

/// Reflection and refraction at smooth dielectric interfaces, as [`super::Dielectric`].
#[derive(Clone, Copy, Debug)]
pub struct Dielectrics<const N: usize> {
    /// Reflected shares.
    pub reflectance: Lanes<N>,
    /// Cosines of the transmitted directions.
    pub cos_t: Lanes<N>,
    /// Relative indices from the transmitted to the incident side.
    pub eta_ti: Lanes<N>,
}

/// [`super::dielectric`].
#[inline(always)]
pub fn dielectric<const N: usize>(cos_i: Lanes<N>, eta: Lanes<N>) -> Dielectrics<N> {
    let (zero, one) = (Lanes::ZERO, Lanes::ONE);
    let inside = cos_i.less(zero);
    let inverse = one / eta;
    let (eta_it, eta_ti) = (inside.select(inverse, eta), inside.select(eta, inverse));
    let cos2 = one - (one - cos_i * cos_i) * eta_ti * eta_ti;
    let (ci, ct) = (cos_i.abs(), cos2.max(zero).sqrt());
    let s = (ci - eta_it * ct) / (ci + eta_it * ct);
    let p = (ct - eta_it * ci) / (ct + eta_it * ci);
    let partial = Lanes::splat(0.5) * (s * s + p * p);
    let passes = cos2.greater(zero);
    let matched = !(eta.less(one) | eta.greater(one));
    Dielectrics {
        reflectance: matched.select(zero, passes.select(partial, one)),
        cos_t: matched.select(-cos_i, passes.select(-(ct.copysign(cos_i)), zero)),
        eta_ti,
    }
}

/// [`super::conductor`].
#[inline(always)]
pub fn conductor<const N: usize>(cos_i: Lanes<N>, eta: Lanes3<N>, k: Lanes3<N>) -> Lanes3<N> {
    Lanes3 {
        x: conductor_channel(cos_i, eta.x, k.x),
        y: conductor_channel(cos_i, eta.y, k.y),
        z: conductor_channel(cos_i, eta.z, k.z),
    }
}

#[inline(always)]
fn conductor_channel<const N: usize>(cos_i: Lanes<N>, eta: Lanes<N>, k: Lanes<N>) -> Lanes<N> {
    let (zero, half, two) = (Lanes::ZERO, Lanes::splat(0.5), Lanes::splat(2.0));
    let cos2 = cos_i * cos_i;
    let sin2 = Lanes::ONE - cos2;
    let t0 = eta * eta - k * k - sin2;
    let a2_plus_b2 = (t0 * t0 + Lanes::splat(4.0) * eta * eta * k * k).max(zero).sqrt();
    let a = (half * (a2_plus_b2 + t0)).max(zero).sqrt();
    let (t1, t2) = (a2_plus_b2 + cos2, two * a * cos_i);
    let s = (t1 - t2) / (t1 + t2);
    let (t3, t4) = (a2_plus_b2 * cos2 + sin2 * sin2, t2 * sin2);
    let p = s * (t3 - t4) / (t3 + t4);
    let value = half * (s + p);
    // Only 0/0 (a perfect index match at grazing incidence) gets to the other case.
    value.finite().select(value, Lanes::ONE)
}

/// [`super::reflect`].
#[inline(always)]
pub fn reflect<const N: usize>(wi: Lanes3<N>) -> Lanes3<N> {
    Lanes3 { x: -wi.x, y: -wi.y, z: wi.z }
}

/// [`super::reflect_about`].
#[inline(always)]
pub fn reflect_about<const N: usize>(wi: Lanes3<N>, m: Lanes3<N>) -> Lanes3<N> {
    m * (Lanes::splat(2.0) * wi.dot(m)) - wi
}

/// [`super::refract`].
#[inline(always)]
pub fn refract<const N: usize>(wi: Lanes3<N>, found: &Dielectrics<N>) -> Lanes3<N> {
    Lanes3 { x: -(found.eta_ti * wi.x), y: -(found.eta_ti * wi.y), z: found.cos_t }
}

/// [`super::refract_about`].
#[inline(always)]
pub fn refract_about<const N: usize>(wi: Lanes3<N>, m: Lanes3<N>, found: &Dielectrics<N>) -> Lanes3<N> {
    m * (wi.dot(m) * found.eta_ti + found.cos_t) - wi * found.eta_ti
}

/// Index of refraction of the side that light goes to over that of the side it comes from, by the cosines of the latter.
#[inline(always)]
pub fn eta_across<const N: usize>(cos_i: Lanes<N>, eta: Lanes<N>) -> Lanes<N> {
    let outside: Mask<N> = cos_i.greater(Lanes::ZERO);
    outside.select(eta, Lanes::ONE / eta)
}
