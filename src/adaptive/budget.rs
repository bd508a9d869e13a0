//! The policy of an adaptive run: how many samples each pass gets. Pure functions of what has been spent so far, without a
//! clock.

use std::time::Duration;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Limits of a run. The first one that is reached counts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Limits {
    /// Mean samples per pixel.
    pub spp: Option<u32>,
    /// Time for everything, the last reconstruction included.
    pub time: Option<Duration>,
    /// Estimated relMSE.
    pub error: Option<f64>,
}

impl Limits {
    /// These limits or, without any, the number of samples that the scene asks for.
    #[must_use]
    pub fn or_samples(self, spp: u32) -> Self {
        let spp = self.spp.or((self.time.is_none() && self.error.is_none()).then_some(spp));
        Self { spp, ..self }
    }
}

/// Samples of every pixel before the first decision: one in each bin. With fewer, variances of pixels are too noisy to
/// allocate by.
pub(super) const FIRST_SPP: u32 = 8;

/// Share of a budget that the first, uniform pass takes, and number of passes that follow it (docs/experiments.md has what they
/// gain).
pub(super) const FIRST_SHARE: f64 = 0.25;
pub(super) const PASSES: u32 = 2;

/// Share of the time that reconstructions between passes may take: what a second pass gains (docs/experiments.md).
const OVERHEAD: f64 = 0.02;

/// Share of the time that the reconstruction before the first of them may take: beyond it all samples are taken evenly.
const FIRST_OVERHEAD: f64 = 0.2;

/// Least and largest growth of the number of samples by a pass on the way to a target error: a pass of less than 15 %
/// would be mostly reconstruction, and one of more than 100 % would rest on an extrapolation too far.
const GROWTH: (f64, f64) = (0.15, 1.0);

/// Least growth by the first of these passes: as many new samples as there were have to confirm the first estimate.
const CONFIRM: f64 = 1.0;

/// Exponent of the number of samples that errors are assumed to fall with, to predict how many will do; between the
/// slopes of the methods.
const SLOPE: f64 = 0.85;

/// Share of the last pass after which the speed of rendering is measured again, to meet a time limit.
const SPEED_CHECK_SHARE: f64 = 0.85;

/// Everything that decisions depend on.
#[derive(Clone, Copy, Debug)]
pub struct Spent {
    /// Pixels of the film.
    pub pixels: f64,
    /// Samples of all pixels.
    pub samples: f64,
    /// Seconds since the start of the run.
    pub elapsed: f64,
    /// Seconds of rendering.
    pub rendering: f64,
    /// Seconds that the last reconstruction takes, as far as is known.
    pub reconstruction: f64,
    /// Seconds that one between passes takes.
    pub between: f64,
}

/// Limits of a run, and the inputs of its decisions.
#[derive(Clone, Copy, Debug)]
pub struct Budget {
    pub limits: Limits,
    /// Whether passes need a reconstruction with an estimated error.
    pub by_error: bool,
    /// Whether all pixels get the same number of samples.
    pub uniform: bool,
}

/// Decision about the first pass.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum FirstPass {
    /// The same number of samples for every pixel, with passes to follow.
    Uniform(u32),
    /// All samples evenly, since nothing is going to be decided; so many of every pixel before the speed is measured again.
    Everything(u32),
}

/// Decision about a later pass.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NextPass {
    /// Samples to allocate.
    pub samples: f64,
    /// Passes that are left after it, unless there is an error to reach.
    pub left: u32,
}

impl Spent {
    /// Samples a second.
    fn speed(&self) -> f64 {
        self.samples / self.rendering.max(1e-9)
    }
}

impl Budget {
    /// Samples that can still be taken, infinite without a limit.
    pub fn affordable(&self, spent: &Spent) -> f64 {
        let by_spp = self.limits.spp.map_or(f64::INFINITY, |spp| f64::from(spp) * spent.pixels - spent.samples);
        let left = |limit: Duration| limit.as_secs_f64() - spent.elapsed - spent.reconstruction;
        by_spp.min(self.limits.time.map_or(f64::INFINITY, |limit| left(limit) * spent.speed())).max(0.0)
    }

    /// The first pass, after one sample of every pixel has shown the speed.
    pub fn first_pass(&self, spent: &Spent) -> FirstPass {
        let Limits { time, error, .. } = self.limits;
        let all = (self.affordable(spent) + spent.samples) / spent.pixels;
        let first = match error {
            Some(_) => f64::from(2 * FIRST_SPP),
            None => f64::from(FIRST_SPP).max(FIRST_SHARE * all),
        };
        let too_slow = |time: Duration| self.by_error && spent.between > FIRST_OVERHEAD * time.as_secs_f64();
        let decides = error.is_some() || !self.uniform;
        if decides && all > 1.5 * first && !time.is_some_and(too_slow) {
            return FirstPass::Uniform(first as u32);
        }
        FirstPass::Everything((1.0 + SPEED_CHECK_SHARE * (all - 1.0)) as u32)
    }

    /// Samples of every pixel when all that can be afforded are taken evenly.
    pub fn even_spp(&self, spent: &Spent) -> u32 {
        let rounding = if self.limits.time.is_some() { 0.5 } else { 0.0 };
        ((self.affordable(spent) + spent.samples) / spent.pixels + rounding) as u32
    }

    /// The next pass, or none if `done` passes were enough; `left` are left by the last decision. `error` is the relMSE
    /// estimated for the last image.
    pub fn next_pass(&self, spent: &Spent, (done, left): (usize, u32), error: Option<f64>) -> Option<NextPass> {
        let most = self.affordable(spent);
        if most < 1.0 {
            return None;
        }
        if let Some(target) = self.limits.error {
            let growth = (error? / target).powf(1.0 / SLOPE) - 1.0;
            let least = if done == 1 { CONFIRM } else { GROWTH.0 };
            let reached = done > 1 && growth <= 0.0;
            let samples = (spent.samples * growth.clamp(least, GROWTH.1)).min(most);
            return (!reached).then_some(NextPass { samples, left });
        }
        if left == 0 {
            return None;
        }
        let cost = if self.by_error { spent.between } else { 0.0 };
        let time = self.limits.time.map(|time| time.as_secs_f64());
        // As many passes as the reconstructions between them leave time for.
        let reconstructions = time.map_or(f64::INFINITY, |time| OVERHEAD * time / cost.max(1e-9));
        let passes = f64::from(left).min(1.0 + reconstructions.floor());
        let lost = time.map_or(0.0, |_| (passes - 1.0) * cost * spent.speed());
        Some(NextPass { samples: (most - lost).max(1.0) / passes, left: passes as u32 - 1 })
    }

    /// Samples of a pass before the speed is measured again: less than all of them in the last pass within a time limit.
    pub fn before_speed_check(&self, pass: NextPass) -> Option<f64> {
        (self.limits.time.is_some() && pass.left == 0).then_some(SPEED_CHECK_SHARE * pass.samples)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn spent(spp: f64, elapsed: f64) -> Spent {
        Spent { pixels: 100.0, samples: 100.0 * spp, elapsed, rendering: elapsed, reconstruction: 0.1, between: 0.1 }
    }

    fn budget(limits: Limits) -> Budget {
        Budget { limits, by_error: true, uniform: false }
    }

    #[test]
    fn passes_use_up_the_samples_exactly() {
        let budget = budget(Limits { spp: Some(48), ..Limits::default() });
        assert_eq!(budget.first_pass(&spent(1.0, 1.0)), FirstPass::Uniform(12));
        let (mut samples, mut left) = (1200.0, PASSES);
        for done in 1..=PASSES as usize {
            let now = Spent { samples, ..spent(0.0, 1.0) };
            let pass = budget.next_pass(&now, (done, left), Some(0.1)).unwrap();
            (samples, left) = (samples + pass.samples, pass.left);
            assert_eq!(budget.before_speed_check(pass), None);
        }
        assert_eq!((samples, left), (4800.0, 0));
        assert_eq!(budget.next_pass(&Spent { samples, ..spent(0.0, 1.0) }, (4, 0), Some(0.1)), None);
    }

    #[test]
    fn time_is_left_for_reconstructions() {
        let budget = budget(Limits { time: Some(Duration::from_secs(10)), ..Limits::default() });
        // A hundred samples a second, one second gone, a tenth for the last reconstruction.
        assert!((budget.affordable(&spent(1.0, 1.0)) - 890.0).abs() < 1e-9);
        let slow = Spent { reconstruction: 3.0, between: 3.0, ..spent(1.0, 1.0) };
        assert!(matches!(budget.first_pass(&slow), FirstPass::Everything(_)));
        // A reconstruction of 0.1 s leaves time for one between two passes, one of 0.6 s does not.
        let left =
            |between| budget.next_pass(&Spent { between, ..spent(10.0, 5.0) }, (1, PASSES), Some(0.1)).unwrap().left;
        assert_eq!([0.1, 0.6].map(left), [1, 0]);
        let last = budget.next_pass(&spent(10.0, 9.0), (2, 1), Some(0.1)).unwrap();
        assert_eq!(budget.before_speed_check(last), Some(SPEED_CHECK_SHARE * last.samples));
    }

    #[test]
    fn a_target_error_is_confirmed_by_new_samples() {
        let budget = budget(Limits { error: Some(0.01), ..Limits::default() });
        assert_eq!(budget.first_pass(&spent(1.0, 1.0)), FirstPass::Uniform(16));
        let pass =
            |done, error| budget.next_pass(&spent(16.0, 1.0), (done, PASSES), Some(error)).map(|pass| pass.samples);
        assert_eq!(pass(1, 0.001), Some(1600.0));
        assert_eq!(pass(2, 0.001), None);
        assert_eq!(pass(2, 10.0), Some(1600.0));
        assert_eq!(pass(2, 0.0101), Some(240.0));
    }

    #[test]
    fn nothing_is_decided_for_uniform_samples() {
        let uniform = Budget { uniform: true, ..budget(Limits { spp: Some(48), ..Limits::default() }) };
        assert_eq!(uniform.first_pass(&spent(1.0, 1.0)), FirstPass::Everything(40));
        assert_eq!(uniform.even_spp(&spent(40.0, 1.0)), 48);
    }
}
