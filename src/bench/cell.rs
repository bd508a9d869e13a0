//! One run: render, develop, reconstruct, measure.

use std::collections::BTreeMap;
use std::fmt;
use std::sync::atomic::AtomicBool;
use std::time::{Duration, Instant};

use super::case::Case;
use super::record::{Record, Seconds, machine};
use crate::adaptive::{self, AdaptiveOutcome, AdaptiveSettings, Allocator, Limits};
use crate::error::Result;
use crate::film::{Frame, Needs};
use crate::image::Image;
use crate::math::rng;
use crate::metrics::METRICS;
use crate::plan::Plan;
use crate::reconstruct::{self, Context, Reconstruction};
use crate::reference::fingerprint;
use crate::render::{self, Control, RenderSettings, render};

/// Limit of a run.
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

/// Durations of the parts of a run on a scene, measured beforehand.
#[derive(Clone, Copy, Debug, Default)]
pub struct Pilot {
    /// Seconds of one sample of every pixel.
    pub sample: f64,
    /// Seconds of developing and reconstructing.
    pub finish: f64,
}

/// Everything that decides a run, besides scene and method.
#[derive(Clone, Copy)]
struct RunSpec<'a> {
    budget: Budget,
    seed: u64,
    /// Expected seconds of the reconstruction.
    finish: f64,
    stop: &'a AtomicBool,
}

/// A method to be run on a scene.
pub struct Runner<'a> {
    /// The scene.
    pub case: &'a Case,
    /// The method as it was asked for.
    pub method: &'a str,
    made: Box<dyn Reconstruction>,
    allocator: Option<&'static dyn Allocator>,
    needs: Needs,
}

/// A run and its image.
pub struct RunResult {
    /// Figures that are stored.
    pub record: Record,
    /// The image.
    pub image: Image,
}

impl<'a> Runner<'a> {
    /// Builds the method and decides what to render for it.
    pub fn new(case: &'a Case, method: &'a str) -> Result<Self> {
        let (id, allocator) = adaptive::parse(method)?;
        let made = reconstruct::parse(id)?;
        let needs = Plan::new(&case.scene, made.needs(), Needs::default()).needs;
        Ok(Self { case, method, made, allocator, needs })
    }

    /// Whether sampling is adaptive.
    pub fn is_adaptive(&self) -> bool {
        self.allocator.is_some()
    }

    fn settings(&self, budget: render::Budget, seed: u64) -> RenderSettings {
        RenderSettings { seed, ..RenderSettings::new(budget, self.needs) }
    }

    fn frame(
        &self,
        budget: render::Budget,
        seed: u64,
        stop: &AtomicBool,
        seconds: &mut Seconds,
    ) -> (render::RenderOutcome, Frame) {
        let control = Control { stop, ..Control::QUIET };
        let outcome = render(&self.case.scene, self.settings(budget, seed), &control);
        seconds.render = outcome.elapsed.as_secs_f64();
        let start = Instant::now();
        let frame = outcome.film.develop();
        seconds.develop = start.elapsed().as_secs_f64();
        (outcome, frame)
    }

    fn finish(&self, frame: &Frame, seconds: &mut Seconds) -> Result<Image> {
        let start = Instant::now();
        let image = reconstruct::solve(self.made.as_ref(), frame, &Context::QUIET)?.image;
        seconds.reconstruct = start.elapsed().as_secs_f64();
        Ok(image)
    }

    /// Measures with two samples per pixel; the reconstruction twice, since the first may load libraries.
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

    /// Runs with the same number of samples for every pixel. None if it was stopped.
    fn straight(&self, spec: RunSpec, seconds: &mut Seconds) -> Result<Option<(render::RenderOutcome, Image)>> {
        let allowed = match spec.budget {
            Budget::Spp(spp) => render::Budget::Spp(spp),
            Budget::Seconds(total) => render::Budget::Time(Duration::from_secs_f64((total - spec.finish).max(1e-6))),
        };
        let (outcome, frame) = self.frame(allowed, spec.seed, spec.stop, seconds);
        if outcome.stopped {
            return Ok(None);
        }
        let image = self.finish(&frame, seconds)?;
        Ok(Some((outcome, image)))
    }

    /// Runs with adaptive sampling. None if it was stopped.
    fn adapt(
        &self,
        allocator: &dyn Allocator,
        spec: RunSpec,
        seconds: &mut Seconds,
    ) -> Result<Option<(render::RenderOutcome, Image)>> {
        let limits = match spec.budget {
            Budget::Spp(spp) => Limits { spp: Some(spp), ..Limits::default() },
            Budget::Seconds(total) => Limits { time: Some(Duration::from_secs_f64(total)), ..Limits::default() },
        };
        let settings = AdaptiveSettings {
            render: self.settings(render::Budget::Spp(1), spec.seed),
            method: self.made.as_ref(),
            allocator,
            limits,
            reconstruction: Some(Duration::from_secs_f64(spec.finish)),
        };
        let control = Control { stop: spec.stop, ..Control::QUIET };
        let outcome = adaptive::run(&self.case.scene, &settings, &control, &Context::QUIET)?;
        let AdaptiveOutcome { render, solution, develop, reconstruct, .. } = outcome;
        (seconds.render, seconds.develop, seconds.reconstruct) = (render.elapsed.as_secs_f64(), develop, reconstruct);
        Ok((!render.stopped).then_some((render, solution.image)))
    }

    /// Runs with a seed, within a budget; `pilot` says how long the reconstruction is going to take. None if `stop` was
    /// set before the samples were taken.
    pub fn run(&self, budget: Budget, seed: u64, pilot: Pilot, stop: &AtomicBool) -> Result<Option<RunResult>> {
        reset_peak();
        let mut seconds = Seconds { load: self.case.load, ..Seconds::default() };
        // Runs of different budgets do not share samples; those of different methods do.
        let salt = budget.to_string().bytes().fold(0, |hash, byte| rng::combine(hash, u64::from(byte)));
        let spec = RunSpec { budget, seed: rng::combine(seed, salt), finish: pilot.finish, stop };
        let made = match self.allocator {
            Some(allocator) => self.adapt(allocator, spec, &mut seconds)?,
            None => self.straight(spec, &mut seconds)?,
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
        Ok(Some(RunResult { record, image }))
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
