//! Results of evaluating and sampling a material.

use crate::math::{Rgb, Vec3};

/// Kinds of scattering that shift mappings distinguish.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Lobe {
    /// Spread over solid angle.
    Smooth,
    /// Mirror direction only.
    DeltaReflect,
    /// Refracted direction only.
    DeltaTransmit,
    /// Straight through, unscattered.
    Null,
}

impl Lobe {
    /// Whether the lobe has a single direction.
    pub fn is_delta(self) -> bool {
        self != Self::Smooth
    }
}

/// A sampled direction.
#[derive(Clone, Copy, Debug)]
pub struct BsdfSample {
    /// Outgoing direction.
    pub wo: Vec3,
    /// f |cos θo| / pdf, of all smooth lobes together or of the one delta lobe.
    pub weight: Rgb,
    /// Density per solid angle, or probability of a delta lobe.
    pub pdf: f32,
    /// The lobe.
    pub lobe: Lobe,
    /// Relative index of refraction along the new direction: 1 unless refracted.
    pub eta: f32,
}

/// The smooth lobes in a pair of directions.
#[derive(Clone, Copy, Debug, Default)]
pub struct Eval {
    /// f |cos θo|.
    pub value: Rgb,
    /// Density per solid angle with which `sample` gives `wo`, delta lobes' share taken off.
    pub pdf: f32,
}

impl Eval {
    /// The sample of a direction in which a smooth lobe has this value; none where it is never sampled.
    pub fn sampled(self, wo: Vec3) -> Option<BsdfSample> {
        let Self { value, pdf } = self;
        (pdf > 0.0).then(|| BsdfSample { wo, weight: value / pdf, pdf, lobe: Lobe::Smooth, eta: 1.0 })
    }
}

/// Scattering by a delta lobe.
#[derive(Clone, Copy, Debug)]
pub struct Delta {
    /// Its one outgoing direction.
    pub wo: Vec3,
    /// Factor on radiance.
    pub value: Rgb,
    /// Probability with which `sample` chooses it.
    pub probability: f32,
}
