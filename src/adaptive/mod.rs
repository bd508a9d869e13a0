//! Adaptive sampling: render, develop, reconstruct, and deal the next samples to the pixels that need them most, until a
//! budget is used up or the estimated error is small enough.
//!
//! Counts follow from earlier samples of the same pixels, which makes the mean of all of them slightly biased; as every
//! pixel gets a minimum share and needs are averaged over pixels around, the bias vanishes as samples are added.

mod allocate;
mod estimate;
mod journal;
mod predicted_error;
mod uniform;
mod variance;

use std::sync::{Mutex, MutexGuard};
use std::time::{Duration, Instant};

use serde::{Deserialize, Serialize};

use self::allocate::allocate;
use self::journal::Stage;
pub use self::journal::{Journal, Notes, Seen};
use crate::error::{Error, Result};
use crate::film::Frame;
use crate::reconstruct::{self, Context, Reconstruction, Solution};
use crate::render::{self, Control};
use crate::scene::Scene;

/// Where samples are needed.
pub trait Allocator: Sync {
    /// Name in `--adaptive`.
    fn id(&self) -> &'static str;

    /// What it goes by.
    fn summary(&self) -> &'static str;

    /// Whether it asks for a reconstruction with an estimated error.
    fn needs_error(&self) -> bool;

    /// For every pixel the standard deviation of a single sample, in any unit: the best number of samples is proportional
    /// to it. `solution` is there if it is asked for.
    fn need(&self, frame: &Frame, solution: Option<&Solution>) -> Result<Vec<f32>>;
}

/// Every allocator, the default first.
pub const ALLOCATORS: &[&dyn Allocator] = &[&predicted_error::PredictedError, &variance::Variance, &uniform::Uniform];

/// The allocator of a name.
pub fn allocator(id: &str) -> Result<&'static dyn Allocator> {
    ALLOCATORS.iter().copied().find(|allocator| allocator.id() == id).ok_or_else(|| {
        let names: Vec<_> = ALLOCATORS.iter().map(|allocator| allocator.id()).collect();
        Error::Usage(format!("allocator `{id}` is not known; there are {}", names.join(", ")))
    })
}

/// Splits `apr:order=1+adaptive=variance` into a method and an allocator.
pub fn parse(text: &str) -> Result<(&str, Option<&'static dyn Allocator>)> {
    match text.rsplit_once("+adaptive") {
        Some((method, "")) => Ok((method, Some(ALLOCATORS[0]))),
        Some((method, id)) if id.starts_with('=') => Ok((method, Some(allocator(&id[1..])?))),
        _ => Ok((text, None)),
    }
}

/// When to stop. The first limit that is reached counts.
#[derive(Clone, Copy, Debug, Default)]
pub struct Limits {
    /// Mean samples per pixel.
    pub spp: Option<u32>,
    /// Time for everything, the last reconstruction included.
    pub time: Option<Duration>,
    /// Estimated relMSE.
    pub error: Option<f64>,
}

/// What to do.
pub struct Settings<'a> {
    /// How samples are taken; the budget is not looked at.
    pub render: render::Settings,
    /// What makes the image.
    pub method: &'a dyn Reconstruction,
    /// Who gets the samples.
    pub allocator: &'a dyn Allocator,
    /// When to stop.
    pub limits: Limits,
    /// How long a reconstruction takes, if it is known.
    pub reconstruction: Option<Duration>,
    /// Whether there are differences to render; else they are zero.
    pub lit: bool,
}

/// A pass: samples and what they led to.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Pass {
    /// Mean samples per pixel after it.
    pub spp: f64,
    /// Seconds since the start.
    pub seconds: f64,
    /// Estimated relMSE of the image, if it was reconstructed.
    pub error: Option<f64>,
}

/// What came out.
pub struct Outcome {
    /// The film.
    pub render: render::Outcome,
    /// It developed.
    pub frame: Frame,
    /// It reconstructed.
    pub solution: Solution,
    /// What was done.
    pub passes: Vec<Pass>,
    /// Seconds that developing took.
    pub develop: f64,
    /// Seconds that reconstructing took.
    pub reconstruct: f64,
}

/// Samples of every pixel before the first decision: with less, errors cannot be told. All bins have one.
const FIRST: u32 = 8;

/// The share of a budget that the first, uniform pass takes, and the number of passes that follow it.
const FIRST_SHARE: f64 = 0.25;
const PASSES: u32 = 3;

/// The share of the time that reconstructions between passes may take.
const OVERHEAD: f64 = 0.1;

/// The least and the most that a pass adds to the samples on the way to an error.
const GROWTH: (f64, f64) = (0.15, 1.0);

/// The least that the first of these passes adds.
const CONFIRM: f64 = 1.0;

/// How errors fall with samples, when guessing how many will do.
const SLOPE: f64 = 0.85;

/// Share of a pass after which its speed is looked at again.
const LOOK: f64 = 0.85;

/// Where to begin, and where to write down how far it has come.
pub struct Begun<'a> {
    /// What has been rendered.
    pub render: render::Outcome,
    /// What has been decided. A [`render::Keeper`] finds it in step with the film.
    pub journal: &'a Mutex<Journal>,
}

/// Renders and reconstructs within limits.
pub fn run(scene: &Scene, settings: &Settings, control: &Control, context: &Context) -> Result<Outcome> {
    let render = render::Outcome::new(scene, settings.render.needs);
    resume(scene, settings, control, context, Begun { render, journal: &Mutex::default() })
}

/// Goes on with a run of the same settings, wherever it ended. Unless time is among the limits, all decisions and samples
/// are the same as in a run without interruption.
pub fn resume(
    scene: &Scene,
    settings: &Settings,
    control: &Control,
    context: &Context,
    begun: Begun,
) -> Result<Outcome> {
    let goes_by_error = settings.allocator.needs_error() || settings.limits.error.is_some();
    if goes_by_error && !settings.method.estimates_error() {
        return Err(Error::Usage(
            "this method does not estimate its error: nothing can be allocated or stopped by it; `fluxion info --methods` \
             says which do, and `--adaptive variance` works with all"
                .into(),
        ));
    }
    let Begun { render, journal } = begun;
    let now = Instant::now();
    let (start, times) = (now.checked_sub(render.elapsed).unwrap_or(now), Times::default());
    Run { scene, settings, control, context, goes_by_error, start, render, journal, times }.go()
}

/// Seconds that were spent besides rendering.
#[derive(Clone, Copy, Debug, Default)]
struct Times {
    develop: f64,
    reconstruct: f64,
    /// Of the last reconstruction.
    last: Option<f64>,
}

struct Run<'a> {
    scene: &'a Scene,
    settings: &'a Settings<'a>,
    control: &'a Control<'a>,
    context: &'a Context<'a>,
    goes_by_error: bool,
    start: Instant,
    render: render::Outcome,
    journal: &'a Mutex<Journal>,
    times: Times,
}

/// What is known after a pass.
struct State {
    frame: Frame,
    solution: Option<Solution>,
    error: Option<f64>,
}

impl Run<'_> {
    fn go(mut self) -> Result<Outcome> {
        // A pass that was interrupted is brought to its end first.
        let stage = self.journal().stage();
        let mut state = match stage {
            Stage::Fresh => {
                self.begin();
                self.look()?
            }
            Stage::Dealing => {
                self.give(None);
                self.look()?
            }
            Stage::Between => {
                let frame = self.develop();
                self.know(frame)?
            }
        };
        while let Some(samples) = self.next(state.error) {
            let need = self.settings.allocator.need(&state.frame, state.solution.as_ref())?;
            self.journal().before = Seen::new(state.frame, state.solution);
            self.deal(&need, samples);
            state = self.look()?;
        }
        if let Some(keeper) = self.control.keeper {
            keeper.keep(&self.render);
        }
        let State { frame, solution, .. } = state;
        let solution = solution.map_or_else(|| self.solve(&frame), Ok)?;
        let passes = self.journal().notes.passes.clone();
        Ok(Outcome {
            frame,
            solution,
            develop: self.times.develop,
            reconstruct: self.times.reconstruct,
            render: self.render,
            passes,
        })
    }

    fn journal(&self) -> MutexGuard<'_, Journal> {
        self.journal.lock().unwrap_or_else(|poisoned| poisoned.into_inner())
    }

    fn pixels(&self) -> f64 {
        (self.render.film.width * self.render.film.height) as f64
    }

    fn samples(&self) -> f64 {
        self.render.film.samples() as f64
    }

    /// Seconds that a reconstruction takes, as far as is known.
    fn finish(&self) -> f64 {
        self.times.last.or(self.settings.reconstruction.map(|known| known.as_secs_f64())).unwrap_or(0.0)
    }

    /// Samples a second.
    fn speed(&self) -> f64 {
        self.samples() / self.render.elapsed.as_secs_f64().max(1e-9)
    }

    /// Samples that can still be taken, infinite without a limit.
    fn affordable(&self) -> f64 {
        let Limits { spp, time, .. } = self.settings.limits;
        let by_spp = spp.map_or(f64::INFINITY, |spp| f64::from(spp) * self.pixels() - self.samples());
        let left = |limit: Duration| limit.as_secs_f64() - self.start.elapsed().as_secs_f64() - self.finish();
        by_spp.min(time.map_or(f64::INFINITY, |limit| left(limit) * self.speed())).max(0.0)
    }

    /// The first pass: as many samples for every pixel; all of them if nothing is going to be decided.
    fn begin(&mut self) {
        let Limits { time, error, .. } = self.settings.limits;
        // One sample tells the speed.
        self.fill(1);
        let all = (self.affordable() + self.samples()) / self.pixels();
        let first = match error {
            Some(_) => f64::from(2 * FIRST),
            None => f64::from(FIRST).max(FIRST_SHARE * all),
        };
        let too_slow = |time: Duration| self.goes_by_error && self.finish() > 2.0 * OVERHEAD * time.as_secs_f64();
        let decides = error.is_some() || self.settings.allocator.id() != uniform::Uniform.id();
        if decides && all > 1.5 * first && !time.is_some_and(too_slow) {
            return self.fill(first as u32);
        }
        self.journal().notes.left = 0;
        self.fill((1.0 + LOOK * (all - 1.0)) as u32);
        let rounding = if time.is_some() { 0.5 } else { 0.0 };
        self.fill(((self.affordable() + self.samples()) / self.pixels() + rounding) as u32);
    }

    /// Samples of the next pass, or none if this was the last.
    fn next(&mut self, error: Option<f64>) -> Option<f64> {
        let most = self.affordable();
        if self.render.stopped || most < 1.0 {
            return None;
        }
        let Notes { passes, left, .. } = self.journal().notes.clone();
        if let Some(target) = self.settings.limits.error {
            let growth = (error? / target).powf(1.0 / SLOPE) - 1.0;
            // New samples are to confirm what the first image claims.
            let least = if passes.len() == 1 { CONFIRM } else { GROWTH.0 };
            let reached = passes.len() > 1 && growth <= 0.0;
            return (!reached).then(|| (self.samples() * growth.clamp(least, GROWTH.1)).min(most));
        }
        let cost = if self.goes_by_error { self.finish() } else { 0.0 };
        let time = self.settings.limits.time.map(|time| time.as_secs_f64());
        // As many as reconstructions between them leave time for.
        let looks = time.map_or(f64::INFINITY, |time| OVERHEAD * time / cost.max(1e-9));
        let passes = f64::from(left).min(1.0 + looks.floor());
        if left == 0 {
            return None;
        }
        self.journal().notes.left = passes as u32 - 1;
        let lost = time.map_or(0.0, |_| (passes - 1.0) * cost * self.speed());
        Some((most - lost).max(1.0) / passes)
    }

    /// Gives samples to the pixels that need them. Within a time limit the last pass looks at its speed on the way.
    fn deal(&mut self, need: &[f32], samples: f64) {
        let in_parts = self.settings.limits.time.is_some() && self.journal().notes.left == 0;
        let first = if in_parts { LOOK * samples } else { samples };
        self.give(Some((need, first as u64)));
        if in_parts && !self.render.stopped {
            self.give(Some((need, self.affordable().min(samples) as u64)));
        }
    }

    /// Gives new samples, or those that were written down before.
    fn give(&mut self, new: Option<(&[f32], u64)>) {
        if let Some((need, samples)) = new {
            let mut goals = self.render.film.counts();
            let added = allocate(need, &goals, samples);
            goals.iter_mut().zip(added).for_each(|(goal, more)| *goal += more);
            self.journal().goals = goals;
        }
        let goals = self.journal().goals.clone();
        self.render(&goals);
    }

    fn fill(&mut self, spp: u32) {
        self.render(&vec![spp; self.pixels() as usize]);
    }

    /// Renders until every pixel has as many samples as its goal.
    fn render(&mut self, goals: &[u32]) {
        let Limits { spp, time, .. } = self.settings.limits;
        let done = self.samples();
        let missing = goals.iter().zip(self.render.film.counts()).map(|(&goal, count)| goal.saturating_sub(count));
        let all: f64 = missing.map(f64::from).sum();
        let (start, pixels) = (self.start, self.pixels());
        let progress = |share: f32| {
            let by_spp = spp.map_or(0.0, |spp| (done + f64::from(share) * all) / (f64::from(spp) * pixels));
            let by_time = time.map_or(0.0, |time| start.elapsed().as_secs_f64() / time.as_secs_f64());
            (self.control.progress)(by_spp.max(by_time).min(1.0) as f32);
        };
        let control = Control { progress: &progress, ..*self.control };
        render::raise(self.scene, self.settings.render, &control, &mut self.render, goals);
    }

    fn develop(&mut self) -> Frame {
        let start = Instant::now();
        let mut frame = self.render.film.develop();
        if !self.settings.lit {
            frame.fill_dark_edges();
        }
        self.times.develop += start.elapsed().as_secs_f64();
        frame
    }

    fn solve(&mut self, frame: &Frame) -> Result<Solution> {
        let start = Instant::now();
        let solution = reconstruct::solve(self.settings.method, frame, self.context)?;
        let seconds = start.elapsed().as_secs_f64();
        self.times.reconstruct += seconds;
        self.times.last = Some(seconds);
        Ok(solution)
    }

    /// Ends a pass: learns from its samples how right the last image was, and writes down what is known now.
    fn look(&mut self) -> Result<State> {
        let frame = self.develop();
        if self.render.stopped {
            // The pass is not over: going on, it is brought to its end.
            return Ok(State { frame, solution: None, error: None });
        }
        self.journal().learn(&frame);
        let state = self.know(frame)?;
        let (spp, seconds) = (self.samples() / self.pixels(), self.start.elapsed().as_secs_f64());
        self.journal().notes.passes.push(Pass { spp, seconds, error: state.error });
        Ok(state)
    }

    /// What is known now; without a reconstruction if nothing goes by it.
    fn know(&mut self, frame: Frame) -> Result<State> {
        let notes = self.journal().notes.clone();
        let solution = if self.goes_by_error && notes.left > 0 { Some(self.solve(&frame)?) } else { None };
        let error = solution.as_ref().map(|solution| notes.estimate.rel_mse(&frame, solution));
        Ok(State { frame, solution, error })
    }
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
