//! Lobes of closures, kind by kind.

use super::facets::Facets;
use super::sample::Lobe;
use super::{Closure, Closures, Conductor, Deltas, Dielectric, Diffuse, Draws, Evals, Kind, Plastic, Principled};
use super::{Numbers, PrincipledThin, Proposals, RoughConductor, RoughDielectric, RoughPlastic, Scatters};
use crate::math::lanes::{LANES, Lanes, Lanes3, Mask};
use crate::math::warp;

/// Lobes of one kind with their parameters.
pub trait Lobes<const N: usize> {
    /// The smooth lobes.
    fn eval(&self, _wi: Lanes3<N>, _wo: Lanes3<N>) -> Evals<N> {
        Evals::ZERO
    }

    /// Facets of which `lobe` selects one, if there are any.
    fn facets(&self, _lobe: Lanes<N>) -> Option<Facets<N>> {
        None
    }

    /// Directions of one of the lobes each.
    fn propose(&self, wi: Lanes3<N>, numbers: &Numbers<N>) -> Proposals<N>;

    /// Scattering by a delta lobe.
    fn delta(&self, _wi: Lanes3<N>, _lobe: Lobe) -> Deltas<N> {
        Deltas::NONE
    }
}

/// Runs something for every kind among the active lanes, with the lanes of the kind.
macro_rules! each_kind {
    ($closures:expr, $active:expr, |$kind:ident, $lanes:ident| $body:expr) => {
        each_kind!($closures, $active, |$kind, $lanes| $body; Diffuse, Conductor, RoughConductor, Dielectric,
            RoughDielectric, Plastic, RoughPlastic, Principled, PrincipledThin)
    };
    ($closures:expr, $active:expr, |$kind:ident, $lanes:ident| $body:expr; $($each:ident),*) => {
        $(
            let $lanes = $active & $closures.are(Kind::$each);
            if $lanes.any() {
                use $each as $kind;
                $body
            }
        )*
    };
}

/// Lobes of packets in the widest vectors that there are, a function for each kind.
pub trait OfPackets {
    /// [`Lobes::eval`].
    fn eval_packet(closures: &Closures, directions: [Lanes3; 2]) -> Evals;

    /// [`Lobes::propose`].
    fn propose_packet(closures: &Closures, wi: Lanes3, numbers: &Numbers) -> Proposals;

    /// [`Lobes::delta`].
    fn delta_packet(closures: &Closures, wi: Lanes3, lobe: Lobe) -> Deltas;
}

/// The lobes of closures of all kinds, neither perturbed nor with holes, from the front.
pub trait AllLobes<const N: usize> {
    /// [`Lobes::eval`].
    fn eval_lobes(&self, directions: [Lanes3<N>; 2], active: Mask<N>) -> Evals<N>;

    /// [`Lobes::propose`].
    fn propose_lobes(&self, wi: Lanes3<N>, numbers: &Numbers<N>, active: Mask<N>) -> Proposals<N>;

    /// [`Lobes::delta`].
    fn delta_lobes(&self, wi: Lanes3<N>, lobe: Lobe, active: Mask<N>) -> Deltas<N>;

    /// Normals of visible facets.
    fn visible_facets(facets: &Facets<N>, wi: Lanes3<N>, u: [Lanes<N>; 2]) -> Lanes3<N>;
}

impl<const N: usize> Closures<N>
where
    Self: AllLobes<N>,
{
    /// Samples directions for the active lanes; returns the lanes that have one.
    #[inline(always)]
    pub(super) fn sample_lobes(&self, wi: Lanes3<N>, [lobe, u, v]: [Lanes<N>; 3], active: Mask<N>) -> Draws<N> {
        let (mut rough, mut facets) = (Mask::NONE, Facets { ggx: Mask::NONE, alpha: [Lanes::ONE; 2] });
        each_kind!(self, active, |Each, lanes| {
            if let Some(of_kind) = Each::load(self).facets(lobe) {
                rough = rough | lanes;
                facets = facets.replaced(&of_kind, lanes);
            }
        });
        let mut numbers = Numbers { lobe, facet: Lanes3::UP, cosine: warp::cosine_hemisphere_lanes([u, v]), u: [u, v] };
        if rough.any() {
            numbers.facet = Self::visible_facets(&facets, wi * Lanes::ONE.copysign(wi.z), [u, v]);
        }
        let (mut scatters, possible) = self.propose_lobes(wi, &numbers, active);
        let left = possible & !scatters.pdf.greater(Lanes::ZERO) & scatters.are(Lobe::Smooth);
        if left.any() {
            let evals = self.eval_lobes([wi, scatters.wo], left);
            scatters.weight = left.select3(evals.value * (Lanes::ONE / evals.pdf), scatters.weight);
            scatters.pdf = left.select(evals.pdf, scatters.pdf);
        }
        (scatters, possible & scatters.pdf.greater(Lanes::ZERO))
    }
}

// Functions of their own for the single closures of a kind: all kinds inlined into one function take minutes to compile.

#[inline(never)]
fn eval<L: Lobes<1>>(lobes: &L, wi: Lanes3<1>, wo: Lanes3<1>) -> Evals<1> {
    lobes.eval(wi, wo)
}

#[inline(never)]
fn propose<L: Lobes<1>>(lobes: &L, wi: Lanes3<1>, numbers: &Numbers<1>) -> Proposals<1> {
    lobes.propose(wi, numbers)
}

#[inline(never)]
fn delta<L: Lobes<1>>(lobes: &L, wi: Lanes3<1>, lobe: Lobe) -> Deltas<1> {
    lobes.delta(wi, lobe)
}

impl AllLobes<1> for Closure {
    fn eval_lobes(&self, [wi, wo]: [Lanes3<1>; 2], active: Mask<1>) -> Evals<1> {
        each_kind!(self, active, |Each, _lanes| return eval(&Each::load(self), wi, wo));
        Evals::ZERO
    }

    fn propose_lobes(&self, wi: Lanes3<1>, numbers: &Numbers<1>, active: Mask<1>) -> Proposals<1> {
        each_kind!(self, active, |Each, _lanes| return propose(&Each::load(self), wi, numbers));
        (Scatters::default(), Mask::NONE)
    }

    fn delta_lobes(&self, wi: Lanes3<1>, lobe: Lobe, active: Mask<1>) -> Deltas<1> {
        each_kind!(self, active, |Each, _lanes| return delta(&Each::load(self), wi, lobe));
        Deltas::NONE
    }

    fn visible_facets(facets: &Facets<1>, wi: Lanes3<1>, u: [Lanes<1>; 2]) -> Lanes3<1> {
        facets.sample_visible(wi, u)
    }
}

impl AllLobes<LANES> for Closures {
    fn eval_lobes(&self, directions: [Lanes3; 2], active: Mask) -> Evals {
        let mut evals = Evals::ZERO;
        each_kind!(self, active, |Each, lanes| evals = evals.replaced(&Each::eval_packet(self, directions), lanes));
        evals
    }

    fn propose_lobes(&self, wi: Lanes3, numbers: &Numbers, active: Mask) -> Proposals {
        let (mut scatters, mut found) = (Scatters::default(), Mask::NONE);
        each_kind!(self, active, |Each, lanes| {
            let (of_kind, there) = Each::propose_packet(self, wi, numbers);
            scatters = scatters.replaced(&of_kind, lanes);
            found = found | (there & lanes);
        });
        (scatters, found)
    }

    fn delta_lobes(&self, wi: Lanes3, lobe: Lobe, active: Mask) -> Deltas {
        let mut deltas = Deltas::NONE;
        each_kind!(self, active, |Each, lanes| deltas = deltas.replaced(&Each::delta_packet(self, wi, lobe), lanes));
        deltas
    }

    fn visible_facets(facets: &Facets, wi: Lanes3, u: [Lanes; 2]) -> Lanes3 {
        visible_facets(facets, wi, u)
    }
}

vectorized! {
    /// Normals of the visible facets of packets, in the widest vectors that there are.
    pub fn visible_facets(facets: &Facets, wi: Lanes3, u: [Lanes; 2]) -> Lanes3 {
        facets.sample_visible(wi, u)
    }
}
