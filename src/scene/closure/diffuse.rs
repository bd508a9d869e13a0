//! Lambert's law, on the outside only.

use super::{Evals, Lobes, Numbers, Proposals, Scatters, parameters};
use crate::math::lanes::{Lanes, Lanes3};
use crate::math::warp;

parameters! {
    /// Diffuse reflection.
    Diffuse {
        /// Its colour.
        reflectance: Lanes3,
    }
}

impl<const N: usize> Lobes<N> for Diffuse<N> {
    #[inline(always)]
    fn eval(&self, wi: Lanes3<N>, wo: Lanes3<N>) -> Evals<N> {
        let pdf = warp::cosine_hemisphere_pdfs(wi.z.greater(Lanes::ZERO).select(wo.z, Lanes::ZERO));
        Evals { value: self.reflectance * pdf, pdf }
    }

    #[inline(always)]
    fn propose(&self, wi: Lanes3<N>, numbers: &Numbers<N>) -> Proposals<N> {
        let wo = numbers.cosine;
        let possible = wi.z.greater(Lanes::ZERO) & wo.z.greater(Lanes::ZERO);
        let pdf = warp::cosine_hemisphere_pdfs(wo.z);
        (Scatters { weight: self.reflectance, pdf, ..Scatters::towards(wo, Lanes::ONE) }, possible)
    }
}
