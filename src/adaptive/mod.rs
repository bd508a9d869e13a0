//! Adaptive sampling: render, develop, reconstruct, and allocate the next samples to the pixels that need them most, until a
//! budget is used up or the estimated error is small enough.
//!
//! ```text
//! budget (how many samples a pass gets) -> allocator (need of every pixel) -> allocate (samples of every pixel)
//!        ^                                                                          |
//!        +---- estimate (error of the image) <- reconstruct <- develop <- render <--+
//! ```
//!
//! Sample counts depend on earlier samples of the same pixels, which makes the mean of all samples slightly biased; as
//! every pixel gets a minimum share and needs are averaged over pixels around, the bias vanishes as samples are added.

mod allocate;
mod budget;
mod estimate;
mod goals;
mod journal;
mod predicted_error;
mod run;
mod uniform;
mod variance;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

pub use self::budget::Limits;
pub use self::goals::{Goals, first_round};
pub use self::journal::{Journal, Notes, PreviousPass};
pub use self::run::{AdaptiveOutcome, AdaptiveSettings, Start, resume, run};
use crate::error::{Error, Result};
use crate::film::Frame;
use crate::reconstruct::{Reconstruction, Solution};

/// A measure of where samples are needed.
pub trait Allocator: Sync {
    /// Name in `--adaptive`.
    fn id(&self) -> &'static str;

    /// Description for help texts.
    fn summary(&self) -> &'static str;

    /// Whether it needs a reconstruction with an estimated error.
    fn needs_error(&self) -> bool;

    /// For every pixel the standard deviation of a single sample, in any unit: the best number of samples is proportional
    /// to it (Neyman 1934). `solution` is there if [`Allocator::needs_error`].
    fn need(&self, frame: &Frame, solution: Option<&Solution>) -> Result<Vec<f32>>;
}

/// Every allocator, the default first.
pub const ALLOCATORS: &[&dyn Allocator] = &[&predicted_error::PredictedError, &variance::Variance, &uniform::Uniform];

/// The allocator of a name.
pub fn allocator(id: &str) -> Result<&'static dyn Allocator> {
    let unknown = || Error::unknown("allocator", id, ALLOCATORS.iter().map(|allocator| allocator.id()));
    ALLOCATORS.iter().copied().find(|allocator| allocator.id() == id).ok_or_else(unknown)
}

/// The allocator of a name, or without one the default where there is time or an error to decide by and the method allows it.
pub fn chosen(
    id: Option<&str>,
    limits: &Limits,
    method: &dyn Reconstruction,
) -> Result<Option<&'static dyn Allocator>> {
    let by_default = (limits.time.is_some() && method.estimates_error()) || limits.error.is_some();
    id.or_else(|| by_default.then(|| ALLOCATORS[0].id())).map(allocator).transpose()
}

/// Fails if a method does not estimate the errors that decisions are made by.
pub fn check(method: &dyn Reconstruction, by_error: bool) -> Result<()> {
    if !by_error || method.estimates_error() {
        return Ok(());
    }
    Err(Error::Usage(
        "this method does not estimate its error: nothing can be allocated or stopped by it; `fluxion info --methods` \
         says which do, and `--adaptive variance` works with all"
            .into(),
    ))
}

/// Splits `apr:order=1+adaptive=variance` into a method and an allocator.
pub fn parse(text: &str) -> Result<(&str, Option<&'static dyn Allocator>)> {
    match text.rsplit_once("+adaptive") {
        Some((method, "")) => Ok((method, Some(ALLOCATORS[0]))),
        Some((method, id)) if id.starts_with('=') => Ok((method, Some(allocator(&id[1..])?))),
        _ => Ok((text, None)),
    }
}

/// A pass that has ended.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Pass {
    /// Mean samples per pixel after it.
    pub spp: f64,
    /// Seconds since the start.
    pub seconds: f64,
    /// Estimated relMSE of the image, if it was reconstructed, by the method or its guide.
    pub error: Option<f64>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn methods_are_told_from_allocators() {
        let split = |text| parse(text).map(|(method, allocator)| (method, allocator.map(Allocator::id)));
        assert_eq!(split("apr:order=1").unwrap(), ("apr:order=1", None));
        assert_eq!(split("apr+adaptive").unwrap(), ("apr", Some("predicted_error")));
        assert_eq!(
            split("apr:features=albedo+normal+adaptive=variance").unwrap(),
            ("apr:features=albedo+normal", Some("variance"))
        );
        assert!(split("apr+adaptive=x").unwrap_err().to_string().contains("predicted_error, variance, uniform"));
    }
}
