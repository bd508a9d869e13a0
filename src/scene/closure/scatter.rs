//! Results of closures: values and densities, sampled directions, delta lobes.

use super::sample::{BsdfSample, Delta, Eval, Lobe};
use crate::math::lanes::{Bits, LANES, Lanes, Lanes3, Mask};

/// Smooth lobes evaluated for pairs of directions, as in [`Eval`].
#[derive(Clone, Copy, Debug)]
#[repr(align(64))]
pub struct Evals<const N: usize = LANES> {
    /// f |cos θo|.
    pub value: Lanes3<N>,
    /// Density per solid angle.
    pub pdf: Lanes<N>,
}

/// Sampled directions, as in [`BsdfSample`].
#[derive(Clone, Copy, Debug)]
#[repr(align(64))]
pub struct Scatters<const N: usize = LANES> {
    /// Outgoing directions.
    pub wo: Lanes3<N>,
    /// f |cos θo| / pdf.
    pub weight: Lanes3<N>,
    /// Densities.
    pub pdf: Lanes<N>,
    /// Lobes, as positions in [`LOBES`].
    pub(super) lobe: Bits<N>,
    /// Relative indices of refraction.
    pub eta: Lanes<N>,
}

/// Sampled directions, and the lanes that have one.
pub type Draws<const N: usize = LANES> = (Scatters<N>, Mask<N>);

/// Directions that lobes propose, and the lanes that have one. Where the density is zero, weights and densities are still to
/// be evaluated, of all smooth lobes together.
pub type Proposals<const N: usize = LANES> = (Scatters<N>, Mask<N>);

/// Random numbers that lobes propose directions by, mapped to normals and directions.
#[derive(Clone, Copy)]
pub struct Numbers<const N: usize = LANES> {
    /// Numbers that select the lobe.
    pub lobe: Lanes<N>,
    /// Normals of visible facets, where the lobes have facets.
    pub facet: Lanes3<N>,
    /// Cosine-weighted directions.
    pub cosine: Lanes3<N>,
    /// The numbers that these are of.
    pub u: [Lanes<N>; 2],
}

/// Scattering by delta lobes, as in [`Delta`].
#[derive(Clone, Copy, Debug)]
#[repr(align(64))]
pub struct Deltas<const N: usize = LANES> {
    /// Outgoing directions.
    pub wo: Lanes3<N>,
    /// Factors on radiance.
    pub value: Lanes3<N>,
    /// Probabilities with which sampling chooses them; 0 where there is none.
    pub probability: Lanes<N>,
}

/// Lobes by number; the smooth one is number 0.
const LOBES: [Lobe; 4] = [Lobe::Smooth, Lobe::DeltaReflect, Lobe::DeltaTransmit, Lobe::Null];

/// Number of a lobe.
fn number(lobe: Lobe) -> u32 {
    LOBES.iter().position(|&known| known == lobe).unwrap_or_default() as u32
}

impl<const N: usize> Evals<N> {
    /// All zero.
    pub const ZERO: Self = Self { value: Lanes3::ZERO, pdf: Lanes::ZERO };

    /// Zero in all but some lanes.
    #[inline(always)]
    pub fn only(self, lanes: Mask<N>) -> Self {
        Self { value: lanes.select3(self.value, Lanes3::ZERO), pdf: lanes.select(self.pdf, Lanes::ZERO) }
    }

    /// Others in some lanes.
    #[inline(always)]
    pub fn replaced(self, others: &Self, lanes: Mask<N>) -> Self {
        Self { value: lanes.select3(others.value, self.value), pdf: lanes.select(others.pdf, self.pdf) }
    }

    /// Sets one lane.
    pub fn set(&mut self, lane: usize, Eval { value, pdf }: Eval) {
        self.value.set(lane, value);
        self.pdf.0[lane] = pdf;
    }

    /// Value and density of one lane.
    pub fn get(&self, lane: usize) -> Eval {
        Eval { value: self.value.get(lane), pdf: self.pdf.0[lane] }
    }
}

impl<const N: usize> Default for Scatters<N> {
    fn default() -> Self {
        Self { wo: Lanes3::ZERO, weight: Lanes3::ZERO, pdf: Lanes::ZERO, lobe: Bits::ZERO, eta: Lanes::ONE }
    }
}

impl<const N: usize> Scatters<N> {
    /// Directions of smooth lobes, not evaluated.
    #[inline(always)]
    pub fn towards(wo: Lanes3<N>, eta: Lanes<N>) -> Self {
        Self { wo, eta, ..Self::default() }
    }

    /// Others in some lanes.
    #[inline(always)]
    pub fn replaced(self, others: &Self, lanes: Mask<N>) -> Self {
        Self {
            wo: lanes.select3(others.wo, self.wo),
            weight: lanes.select3(others.weight, self.weight),
            pdf: lanes.select(others.pdf, self.pdf),
            lobe: lanes.select_bits(others.lobe, self.lobe),
            eta: lanes.select(others.eta, self.eta),
        }
    }

    /// Directions straight on, of the given probabilities, in some lanes.
    #[inline(always)]
    pub fn or_straight_on(self, wi: Lanes3<N>, probability: Lanes<N>, lanes: Mask<N>) -> Self {
        let on = Self {
            wo: -wi,
            weight: Lanes3::ONE,
            pdf: probability,
            lobe: Bits::splat(number(Lobe::Null)),
            eta: Lanes::ONE,
        };
        self.replaced(&on, lanes)
    }

    /// Sets one lane.
    pub fn set(&mut self, lane: usize, sample: &BsdfSample) {
        self.wo.set(lane, sample.wo);
        self.weight.set(lane, sample.weight);
        self.pdf.0[lane] = sample.pdf;
        self.lobe.0[lane] = number(sample.lobe);
        self.eta.0[lane] = sample.eta;
    }

    /// The sample of one lane.
    pub fn get(&self, lane: usize) -> BsdfSample {
        BsdfSample {
            wo: self.wo.get(lane),
            weight: self.weight.get(lane),
            pdf: self.pdf.0[lane],
            lobe: self.lobe(lane),
            eta: self.eta.0[lane],
        }
    }

    /// The lobe of one lane.
    #[inline(always)]
    pub fn lobe(&self, lane: usize) -> Lobe {
        LOBES[self.lobe.0[lane] as usize]
    }

    /// Lanes whose direction is one of a lobe.
    #[inline(always)]
    pub fn are(&self, lobe: Lobe) -> Mask<N> {
        self.lobe.equal(number(lobe))
    }
}

impl<const N: usize> Deltas<N> {
    /// None in all lanes.
    pub const NONE: Self = Self { wo: Lanes3::ZERO, value: Lanes3::ZERO, probability: Lanes::ZERO };

    /// The same on a share of the surface.
    #[inline(always)]
    pub fn scaled(self, share: Lanes<N>) -> Self {
        Self { value: self.value * share, probability: self.probability * share, ..self }
    }

    /// Others in some lanes.
    #[inline(always)]
    pub fn replaced(self, others: &Self, lanes: Mask<N>) -> Self {
        Self {
            wo: lanes.select3(others.wo, self.wo),
            value: lanes.select3(others.value, self.value),
            probability: lanes.select(others.probability, self.probability),
        }
    }

    /// Sets one lane.
    pub fn set(&mut self, lane: usize, delta: Option<Delta>) {
        self.probability.0[lane] = 0.0;
        if let Some(Delta { wo, value, probability }) = delta {
            self.wo.set(lane, wo);
            self.value.set(lane, value);
            self.probability.0[lane] = probability;
        }
    }

    /// The samples of a lobe, and the lanes that have it.
    #[inline(always)]
    pub fn proposed(self, lobe: Lobe) -> Proposals<N> {
        let weight = self.value * (Lanes::ONE / self.probability);
        let lobe = Bits::splat(number(lobe));
        let scatters = Scatters { wo: self.wo, weight, pdf: self.probability, lobe, eta: Lanes::ONE };
        (scatters, self.probability.greater(Lanes::ZERO))
    }

    /// That of one lane, if there is one.
    pub fn get(&self, lane: usize) -> Option<Delta> {
        let probability = self.probability.0[lane];
        (probability > 0.0).then(|| Delta { wo: self.wo.get(lane), value: self.value.get(lane), probability })
    }
}
