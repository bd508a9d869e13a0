//! One end's share of a difference: (J f(y) - f(x)) / D, D being the sum of both paths' densities.

use crate::math::lanes::{Lanes, Lanes3, Mask};

/// Contributions of sixteen base paths: f(x) before division by `density`, the sum over the sampling strategies.
#[derive(Clone, Copy)]
#[repr(align(64))]
pub struct Contributions {
    pub base: Lanes3,
    pub density: Lanes,
    /// One over the Russian-roulette survival probability of the last segment.
    pub inv_survival: Lanes,
}

impl Contributions {
    /// Differences to contributions J f(y) with densities J p(y), both relative to the base's prefix; to zero where the
    /// offset carries nothing.
    #[inline(always)]
    pub fn differences(&self, offset: Lanes3, density: Lanes) -> Lanes3 {
        let pair = offset.nonzero() & density.greater(Lanes::ZERO);
        let other = pair.select3(offset * self.inv_survival, Lanes3::ZERO);
        let densities = self.density + pair.select(density, Lanes::ZERO);
        (other - self.base) * (Lanes::splat(1.0) / densities)
    }
}

/// Last segments of sixteen offsets: the light that they receive apart from their base paths.
#[derive(Clone, Copy)]
#[repr(align(64))]
pub struct LastSegments {
    /// f cos at the offset's vertex times the radiance received, times dω' / dω; zero where nothing is received.
    pub contribution: Lanes3,
    /// Sum of the densities of sampling the emitter point and of hitting it by scattering, times dω' / dω.
    pub density: Lanes,
}

impl LastSegments {
    /// Nothing is received.
    pub const NONE: Self = Self { contribution: Lanes3::ZERO, density: Lanes::ZERO };

    /// Copies one lane of others.
    #[inline(always)]
    pub fn copy(&mut self, to: usize, from: &Self, lane: usize) {
        self.contribution.set(to, from.contribution.get(lane));
        self.density.0[to] = from.density.0[lane];
    }

    /// Others in some lanes.
    #[inline(always)]
    pub fn replaced(self, others: &Self, lanes: Mask) -> Self {
        Self {
            contribution: lanes.select3(others.contribution, self.contribution),
            density: lanes.select(others.density, self.density),
        }
    }
}
