//! One run: render, develop, reconstruct, measure.

use std::collections::BTreeMap;
use std::fmt;
use std::sync::atomic::AtomicBool;
use std::time::{Duration, Instant};

use super::case::Case;
use super::record::{Record, Seconds, machine};
use crate::adaptive::{self, Allocator, Limits};
use crate::error::Result;
use crate::film::{Frame, Needs};
use crate::image::Image;
use crate::math::rng;
use crate::metrics::METRICS;
use crate::plan::Plan;
use crate::reconstruct::{self, Context, Reconstruction};
use crate::reference::fingerprint;
use crate::render::gradient::shift::Shift;
use crate::render::{self, Control, Settings, render};

/// What a run may use up.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Budget {
    /// Seconds for render and reconstruction together.
    Seconds(f64),
    /// Samples per pixel.
    Spp(u32),
}

impl Budget {
    /// The number of seconds or samples.
    pub fn amount(self) -> f64 {
        match self {
            Self::Seconds(seconds) => seconds,
            Self::Spp(spp) => f64::from(spp),
        }
    }
}

impl fmt::Display for Budget {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Seconds(seconds) => write!(f, "{seconds}s"),
            Self::Spp(spp) => write!(f, "{spp}spp"),
        }
    }
}

/// How long the parts of a run take on a scene, from trying.
#[derive(Clone, Copy, Debug, Default)]
pub struct Pilot {
    /// One sample of every pixel.
    pub sample: f64,
    /// Develop and reconstruct.
    pub finish: f64,
}

/// What a run is told.
#[derive(Clone, Copy)]
struct Terms<'a> {
    budget: Budget,
    seed: u64,
    /// Seconds that the reconstruction is going to take.
    finish: f64,
    stop: &'a AtomicBool,
}

/// Reconstructions that report to nobody.
const QUIET: Context = Context { progress: &|_, _| {}, memory: None, notes: false };

/// A method on a scene.
pub struct Runner<'a> {
    /// The scene.
    pub case: &'a Case,
    /// The method as it was asked for.
    pub method: &'a str,
    made: Box<dyn Reconstruction>,
    allocator: Option<&'static dyn Allocator>,
    needs: Needs,
    lit: bool,
}

/// A run and its image.
pub struct Ran {
    /// What is kept of it.
    pub record: Record,
    /// What was made.
    pub image: Image,
}

impl<'a> Runner<'a> {
    /// Builds the method and decides what to render for it.
    pub fn new(case: &'a Case, method: &'a str) -> Result<Self> {
        let (id, allocator) = adaptive::parse(method)?;
        let made = reconstruct::parse(id)?;
        let needs = Plan::new(&case.scene, made.needs(), Needs::default()).needs;
        let lit = needs.edges || !made.needs().edges;
        Ok(Self { case, method, made, allocator, needs, lit })
    }

    /// Whether samples go where they are needed.
    pub fn is_adaptive(&self) -> bool {
        self.allocator.is_some()
    }

    fn settings(&self, budget: render::Budget, seed: u64) -> Settings {
        Settings { budget, seed, first: 0, needs: self.needs, shift: Shift::default() }
    }

    fn frame(
        &self,
        budget: render::Budget,
        seed: u64,
        stop: &AtomicBool,
        seconds: &mut Seconds,
    ) -> (render::Outcome, Frame) {
        let control = Control { stop, progress: &|_| {}, keeper: None };
        let outcome = render(&self.case.scene, self.settings(budget, seed), &control);
        seconds.render = outcome.elapsed.as_secs_f64();
        let start = Instant::now();
        let mut frame = outcome.film.develop();
        if !self.lit {
            frame.fill_dark_edges();
        }
        seconds.develop = start.elapsed().as_secs_f64();
        (outcome, frame)
    }

    fn finish(&self, frame: &Frame, seconds: &mut Seconds) -> Result<Image> {
        let start = Instant::now();
        let image = reconstruct::solve(self.made.as_ref(), frame, &QUIET)?.image;
        seconds.reconstruct = start.elapsed().as_secs_f64();
        Ok(image)
    }

    /// Tries with two samples per pixel; the reconstruction twice, since the first may load libraries.
    pub fn pilot(&self) -> Result<Pilot> {
        let mut seconds = Seconds::default();
        let (_, frame) = self.frame(render::Budget::Spp(2), 0, &AtomicBool::new(false), &mut seconds);
        self.finish(&frame, &mut seconds)?;
        let first = seconds.reconstruct;
        if first < 1.0 {
            self.finish(&frame, &mut seconds)?;
        }
        let finish = seconds.develop + seconds.reconstruct.min(first);
        Ok(Pilot { sample: seconds.render / 2.0, finish })
    }

    /// As many samples for every pixel. None if it was stopped.
    fn straight(&self, terms: Terms, seconds: &mut Seconds) -> Result<Option<(render::Outcome, Image)>> {
        let allowed = match terms.budget {
            Budget::Spp(spp) => render::Budget::Spp(spp),
            Budget::Seconds(total) => render::Budget::Time(Duration::from_secs_f64((total - terms.finish).max(1e-6))),
        };
        let (outcome, frame) = self.frame(allowed, terms.seed, terms.stop, seconds);
        if outcome.stopped {
            return Ok(None);
        }
        let image = self.finish(&frame, seconds)?;
        Ok(Some((outcome, image)))
    }

    /// Samples where they are needed. None if it was stopped.
    fn adapt(
        &self,
        allocator: &dyn Allocator,
        terms: Terms,
        seconds: &mut Seconds,
    ) -> Result<Option<(render::Outcome, Image)>> {
        let limits = match terms.budget {
            Budget::Spp(spp) => Limits { spp: Some(spp), ..Limits::default() },
            Budget::Seconds(total) => Limits { time: Some(Duration::from_secs_f64(total)), ..Limits::default() },
        };
        let settings = adaptive::Settings {
            render: self.settings(render::Budget::Spp(1), terms.seed),
            method: self.made.as_ref(),
            allocator,
            limits,
            reconstruction: Some(Duration::from_secs_f64(terms.finish)),
            lit: self.lit,
        };
        let control = Control { stop: terms.stop, progress: &|_| {}, keeper: None };
        let outcome = adaptive::run(&self.case.scene, &settings, &control, &QUIET)?;
        let adaptive::Outcome { render, solution, develop, reconstruct, .. } = outcome;
        (seconds.render, seconds.develop, seconds.reconstruct) = (render.elapsed.as_secs_f64(), develop, reconstruct);
        Ok((!render.stopped).then_some((render, solution.image)))
    }

    /// Runs with a seed, within a budget; `pilot` says how long the reconstruction is going to take. None if `stop` was
    /// set before the samples were taken.
    pub fn run(&self, budget: Budget, seed: u64, pilot: Pilot, stop: &AtomicBool) -> Result<Option<Ran>> {
        reset_peak();
        let mut seconds = Seconds { load: self.case.load, ..Seconds::default() };
        // Runs of different budgets do not share samples; those of different methods do.
        let salt = budget.to_string().bytes().fold(0, |hash, byte| rng::combine(hash, u64::from(byte)));
        let terms = Terms { budget, seed: rng::combine(seed, salt), finish: pilot.finish, stop };
        let made = match self.allocator {
            Some(allocator) => self.adapt(allocator, terms, &mut seconds)?,
            None => self.straight(terms, &mut seconds)?,
        };
        let Some((outcome, image)) = made else { return Ok(None) };
        seconds.total = seconds.render + seconds.develop + seconds.reconstruct;
        let peak_bytes = peak_bytes();
        let mut metrics = BTreeMap::new();
        for metric in METRICS {
            let mean = metric.measure(&image, &self.case.truth.image)?.mean;
            if mean.is_finite() {
                metrics.insert(metric.id.to_owned(), mean);
            }
        }
        let negative = image.data.iter().filter(|&&value| value < 0.0).count() as f64 / image.data.len() as f64;
        let record = Record {
            scene: self.case.name.clone(),
            method: self.method.to_owned(),
            budget: budget.to_string(),
            seed,
            width: image.width,
            height: image.height,
            fingerprint: fingerprint(&self.case.scene),
            spp: (outcome.film.samples() as f64 / (image.width * image.height) as f64).round() as u32,
            seconds,
            metrics,
            negative,
            rejected: outcome.film.rejected(),
            peak_bytes,
            floor: self.case.truth.floor,
            machine: machine(),
            version: env!("CARGO_PKG_VERSION").into(),
        };
        Ok(Some(Ran { record, image }))
    }
}

/// Forgets the largest memory so far, where the system can.
fn reset_peak() {
    // Best effort: without it later runs show the peak of earlier ones.
    let _ = std::fs::write("/proc/self/clear_refs", "5");
}

/// Largest resident set of the process since the last reset; 0 where the system does not say.
pub fn peak_bytes() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"));
    line.and_then(|rest| rest.trim().trim_end_matches("kB").trim().parse::<u64>().ok()).unwrap_or(0) * 1024
}
