//! An adaptive run: carries out the decisions of the budget.

use std::sync::{Mutex, MutexGuard};
use std::time::{Duration, Instant};

use super::allocate::Demand;
use super::budget::{Budget, FirstPass, NextPass, Spent};
use super::goals::raised;
use super::journal::Stage;
use super::{Allocator, Journal, Limits, Pass, PreviousPass, check, uniform};
use crate::error::Result;
use crate::film::Frame;
use crate::reconstruct::{self, Context, Reconstruction, Solution};
use crate::render::{Control, RenderOutcome, RenderSettings, render_to_counts, sample_costs};
use crate::scene::Scene;
use crate::sync::lock;

/// Everything that decides an adaptive run.
pub struct AdaptiveSettings<'a> {
    /// Seed, needs and shift of the samples; its budget is ignored.
    pub render: RenderSettings,
    /// Reconstruction of the image; it or its guide also after every pass that is decided by the error.
    pub method: &'a dyn Reconstruction,
    /// Measure of where samples are needed.
    pub allocator: &'a dyn Allocator,
    /// When to stop.
    pub limits: Limits,
    /// Duration of a reconstruction, if it is known beforehand.
    pub reconstruction: Option<Duration>,
}

/// The result of an adaptive run.
pub struct AdaptiveOutcome {
    /// The film.
    pub render: RenderOutcome,
    /// The developed film.
    pub frame: Frame,
    /// The reconstructed image.
    pub solution: Solution,
    /// All passes.
    pub passes: Vec<Pass>,
    /// Seconds of developing.
    pub develop: f64,
    /// Seconds of reconstructing.
    pub reconstruct: f64,
}

/// The state that a run starts from, new or from a checkpoint.
pub struct Start<'a> {
    /// The film so far.
    pub render: RenderOutcome,
    /// The decisions so far. A [`FilmSink`](crate::render::FilmSink) finds it in step with the film.
    pub journal: &'a Mutex<Journal>,
}

/// Renders and reconstructs within limits.
pub fn run(
    scene: &Scene,
    settings: &AdaptiveSettings,
    control: &Control,
    context: &Context,
) -> Result<AdaptiveOutcome> {
    let render = RenderOutcome::new(scene, settings.render.needs);
    resume(scene, settings, control, context, Start { render, journal: &Mutex::default() })
}

/// Continues a run of the same settings, wherever it was interrupted. Unless time is among the limits, all decisions and
/// samples are the same as without the interruption.
pub fn resume(
    scene: &Scene,
    settings: &AdaptiveSettings,
    control: &Control,
    context: &Context,
    start: Start,
) -> Result<AdaptiveOutcome> {
    let by_error = settings.allocator.needs_error() || settings.limits.error.is_some();
    check(settings.method, by_error)?;
    let Start { render, journal } = start;
    let now = Instant::now();
    let (start, times) = (now.checked_sub(render.elapsed).unwrap_or(now), Times::default());
    let uniform = settings.allocator.id() == uniform::Uniform.id();
    let budget = Budget { limits: settings.limits, by_error, uniform };
    Run { scene, settings, control, context, budget, start, render, journal, times }.run_passes()
}

/// Seconds that were spent besides rendering.
#[derive(Clone, Copy, Debug, Default)]
struct Times {
    develop: f64,
    reconstruct: f64,
    /// Duration of the method, and of its guide.
    method: Option<f64>,
    guide: Option<f64>,
}

struct Run<'a> {
    scene: &'a Scene,
    settings: &'a AdaptiveSettings<'a>,
    control: &'a Control<'a>,
    context: &'a Context<'a>,
    budget: Budget,
    start: Instant,
    render: RenderOutcome,
    journal: &'a Mutex<Journal>,
    times: Times,
}

/// The image after a pass.
struct Evaluation {
    frame: Frame,
    /// None if no decision depends on it.
    solution: Option<Solution>,
    /// Whether it is the guide's.
    guided: bool,
    /// Estimated relMSE.
    error: Option<f64>,
}

impl Run<'_> {
    fn run_passes(mut self) -> Result<AdaptiveOutcome> {
        // A pass that was interrupted is finished first.
        let stage = self.journal().stage();
        let mut state = match stage {
            Stage::FirstPass => {
                self.render_first_pass();
                self.finish_pass()?
            }
            Stage::InPass => {
                self.render_pass();
                self.finish_pass()?
            }
            Stage::BetweenPasses => {
                let frame = self.develop();
                self.evaluate(frame)?
            }
        };
        while let Some(pass) = self.next_pass(state.error) {
            let need = self.settings.allocator.need(&state.frame, state.solution.as_ref())?;
            self.journal().previous = PreviousPass::new(state.frame, state.solution);
            self.allocate_pass(&need, pass);
            state = self.finish_pass()?;
        }
        self.control.conclude(&self.render);
        let Evaluation { frame, solution, guided, .. } = state;
        let solution = solution.filter(|_| !guided).map_or_else(|| self.solve(&frame, false), Ok)?;
        let passes = self.journal().notes.passes.clone();
        let Times { develop, reconstruct, .. } = self.times;
        Ok(AdaptiveOutcome { frame, solution, develop, reconstruct, render: self.render, passes })
    }

    fn journal(&self) -> MutexGuard<'_, Journal> {
        lock(self.journal)
    }

    /// Seconds that the method takes, if they are known or can be foreseen by its guide's.
    fn known_duration(&self) -> Option<f64> {
        let known = self.settings.reconstruction.map(|known| known.as_secs_f64());
        let foreseen = || self.times.guide.map(|guide| guide / self.settings.method.guide_share());
        self.times.method.or(known).or_else(foreseen)
    }

    fn spent(&self) -> Spent {
        let reconstruction = self.known_duration().unwrap_or(0.0);
        let between = match self.settings.method.guide() {
            Some(_) => self.times.guide.unwrap_or(self.settings.method.guide_share() * reconstruction),
            None => reconstruction,
        };
        Spent {
            pixels: (self.render.film.width * self.render.film.height) as f64,
            samples: self.render.film.samples() as f64,
            elapsed: self.start.elapsed().as_secs_f64(),
            rendering: self.render.elapsed.as_secs_f64(),
            reconstruction,
            between,
        }
    }

    /// As many samples for every pixel; all of them if nothing is going to be decided.
    fn render_first_pass(&mut self) {
        // One sample shows the speed.
        self.render_evenly(1);
        match self.budget.first_pass(&self.spent()) {
            FirstPass::Uniform(spp) => self.render_evenly(spp),
            FirstPass::Everything(spp) => {
                self.journal().notes.left = 0;
                self.render_evenly(spp);
                self.render_evenly(self.budget.even_spp(&self.spent()));
            }
        }
    }

    fn next_pass(&self, error: Option<f64>) -> Option<NextPass> {
        if self.render.stopped {
            return None;
        }
        let spent = self.spent();
        let notes = &mut self.journal().notes;
        let pass = self.budget.next_pass(&spent, (notes.passes.len(), notes.left), error)?;
        notes.left = pass.left;
        Some(pass)
    }

    /// Allocates the samples of a pass by the needs of the pixels, and renders them.
    fn allocate_pass(&mut self, need: &[f32], pass: NextPass) {
        let first = self.budget.before_speed_check(pass);
        self.add_goals(need, first.unwrap_or(pass.samples) as u64);
        self.render_pass();
        if first.is_some() && !self.render.stopped {
            let rest = self.budget.affordable(&self.spent()).min(pass.samples);
            self.add_goals(need, rest as u64);
            self.render_pass();
        }
    }

    /// Writes down the sample counts that the pixels are to have.
    fn add_goals(&mut self, need: &[f32], samples: u64) {
        let cost = sample_costs(self.scene, self.settings.render, &self.render);
        let (width, counts) = (self.render.film.width, self.render.film.counts());
        let goals = raised(&Demand { width, need, cost: &cost, counts: &counts }, samples);
        self.journal().goals = goals;
    }

    /// Renders up to the goals that were written down.
    fn render_pass(&mut self) {
        let goals = self.journal().goals.clone();
        self.render_to(&goals);
    }

    fn render_evenly(&mut self, spp: u32) {
        self.render_to(&vec![spp; self.render.film.width * self.render.film.height]);
    }

    /// Renders until every pixel has as many samples as its goal.
    fn render_to(&mut self, goals: &[u32]) {
        let Limits { spp, time, .. } = self.settings.limits;
        let Spent { samples: done, pixels, .. } = self.spent();
        let missing = goals.iter().zip(self.render.film.counts()).map(|(&goal, count)| goal.saturating_sub(count));
        let all: f64 = missing.map(f64::from).sum();
        let start = self.start;
        let progress = |share: f32| {
            let by_spp = spp.map_or(0.0, |spp| (done + f64::from(share) * all) / (f64::from(spp) * pixels));
            let by_time = time.map_or(0.0, |time| start.elapsed().as_secs_f64() / time.as_secs_f64());
            (self.control.progress)(by_spp.max(by_time).min(1.0) as f32);
        };
        let control = Control { progress: &progress, ..*self.control };
        render_to_counts(self.scene, self.settings.render, &control, &mut self.render, goals);
    }

    fn develop(&mut self) -> Frame {
        let start = Instant::now();
        let frame = self.render.film.develop();
        self.times.develop += start.elapsed().as_secs_f64();
        frame
    }

    /// Reconstructs with the method or its guide, if it has one.
    fn solve(&mut self, frame: &Frame, guided: bool) -> Result<Solution> {
        let start = Instant::now();
        let method = self.settings.method;
        let method = if guided { method.guide().unwrap_or(method) } else { method };
        let solution = reconstruct::solve(method, frame, self.context)?;
        let seconds = start.elapsed().as_secs_f64();
        self.times.reconstruct += seconds;
        *(if guided { &mut self.times.guide } else { &mut self.times.method }) = Some(seconds);
        Ok(solution)
    }

    /// Ends a pass: its samples show how right the last image's error estimate was, and the new image is evaluated.
    fn finish_pass(&mut self) -> Result<Evaluation> {
        let frame = self.develop();
        if self.render.stopped {
            // The pass has not ended: a resumed run finishes it.
            return Ok(Evaluation { frame, solution: None, guided: false, error: None });
        }
        self.journal().learn(&frame);
        let state = self.evaluate(frame)?;
        let Spent { samples, pixels, elapsed: seconds, .. } = self.spent();
        self.journal().notes.passes.push(Pass { spp: samples / pixels, seconds, error: state.error });
        Ok(state)
    }

    /// Reconstructs and estimates the error, if a decision depends on it.
    fn evaluate(&mut self, frame: Frame) -> Result<Evaluation> {
        let notes = self.journal().notes.clone();
        // A target is one of the method's own image.
        let guided = self.settings.method.guide().is_some() && self.settings.limits.error.is_none();
        let decides = self.budget.by_error && notes.left > 0;
        let solution = if decides { Some(self.solve(&frame, guided)?) } else { None };
        let error = solution.as_ref().map(|solution| notes.estimate.rel_mse(&frame, solution));
        Ok(Evaluation { frame, solution, guided, error })
    }
}
