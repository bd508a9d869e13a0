//! One run: render, develop, reconstruct, measure.

use std::collections::BTreeMap;
use std::fmt;
use std::path::Path;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

use super::case::Case;
use super::record::{Record, Seconds, machine};
use crate::adaptive::{self, Limits};
use crate::error::{Error, Result};
use crate::image::Image;
use crate::math::rng;
use crate::metrics::METRICS;
use crate::pipeline::{self, Host, Outputs, Prepared, Recipe, Rendered, Stats, peak_bytes, reset_peak};
use crate::reconstruct::Solution;
use crate::render::RenderOutcome;

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

/// A method to be run on a scene.
pub struct Runner<'a> {
    /// The scene.
    pub case: &'a Case,
    /// The method as it was asked for.
    pub method: &'a str,
    recipe: Recipe,
}

/// A run and its image.
pub struct RunResult {
    /// Figures that are stored.
    pub record: Record,
    /// The image.
    pub image: Image,
}

impl<'a> Runner<'a> {
    /// Makes sure that there is such a method.
    pub fn new(case: &'a Case, method: &'a str) -> Result<Self> {
        let (id, allocator) = adaptive::parse(method)?;
        // Without an allocator all pixels get the same number of samples, whatever the budget.
        let allocator = allocator.map(|allocator| allocator.id().to_owned());
        let outputs = Outputs { image: true, ..Outputs::default() };
        let recipe = Recipe { allocator, outputs, ..Recipe::of_method(id) };
        recipe.check()?;
        Ok(Self { case, method, recipe })
    }

    /// Whether sampling is adaptive.
    pub fn is_adaptive(&self) -> bool {
        self.recipe.allocator.is_some()
    }

    /// A run within limits that is prepared, with its reconstruction taking `finish` seconds.
    fn prepare(&self, limits: Limits, seed: u64, finish: f64) -> Result<Prepared<'a>> {
        let recipe = Recipe { limits, seed, ..self.recipe.clone() };
        let mut prepared = recipe.prepare(&self.case.scene, Path::new(&self.case.name))?;
        if !self.is_adaptive() {
            prepared.allocator = None;
        }
        prepared.reconstruction = Some(Duration::from_secs_f64(finish));
        Ok(prepared)
    }

    /// Measures with two samples per pixel; the reconstruction twice, since the first may load libraries.
    pub fn pilot(&self) -> Result<Pilot> {
        let prepared = self.prepare(Limits { spp: Some(2), ..Limits::default() }, 0, 0.0)?;
        let empty = RenderOutcome::new(&self.case.scene, prepared.settings.needs);
        let rendered = prepared.develop(prepared.render(empty, None, &Host::QUIET), &Host::QUIET);
        let solve = || {
            let mut stats = Stats::default();
            prepared.method.solve(&rendered.frame, &Host::QUIET, &mut stats)?;
            Ok::<_, Error>(stats.seconds.reconstruct)
        };
        let first = solve()?;
        let least = if first < 1.0 { solve()?.min(first) } else { first };
        let pipeline::Seconds { render, develop, .. } = rendered.stats.seconds;
        Ok(Pilot { sample: render / 2.0, finish: develop + least })
    }

    /// Limits of a run within a budget. Of a time an adaptive run takes the reconstruction off by itself.
    fn limits(&self, budget: Budget, finish: f64) -> Limits {
        let time = |total: f64| if self.is_adaptive() { total } else { (total - finish).max(1e-6) };
        match budget {
            Budget::Spp(spp) => Limits { spp: Some(spp), ..Limits::default() },
            Budget::Seconds(total) => Limits { time: Some(Duration::from_secs_f64(time(total))), ..Limits::default() },
        }
    }

    /// Runs with a seed, within a budget; `pilot` says how long the reconstruction is going to take. None if `stop` was
    /// set before the samples were taken.
    pub fn run(&self, budget: Budget, seed: u64, pilot: Pilot, stop: &AtomicBool) -> Result<Option<RunResult>> {
        reset_peak();
        // Runs of different budgets do not share samples; those of different methods do.
        let salt = budget.to_string().bytes().fold(0, |hash, byte| rng::combine(hash, u64::from(byte)));
        let (seed_of_run, limits) = (rng::combine(seed, salt), self.limits(budget, pilot.finish));
        let prepared = self.prepare(limits, seed_of_run, pilot.finish)?;
        let host = Host { stop, ..Host::QUIET };
        let rendered = if self.is_adaptive() {
            prepared.run_anew(&host)?
        } else {
            let empty = RenderOutcome::new(&self.case.scene, prepared.settings.needs);
            let outcome = prepared.render(empty, None, &host);
            if outcome.stopped {
                return Ok(None);
            }
            let mut rendered = prepared.develop(outcome, &host);
            rendered.solution = Some(prepared.method.solve(&rendered.frame, &host, &mut rendered.stats)?);
            rendered
        };
        let Rendered { render, solution: Some(Solution { image, .. }), stats, .. } = rendered else { return Ok(None) };
        if render.stopped {
            return Ok(None);
        }
        let pipeline::Seconds { render: tracing, develop, reconstruct, .. } = stats.seconds;
        let total = tracing + develop + reconstruct;
        let seconds = Seconds { load: self.case.load, render: tracing, develop, reconstruct, total };
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
            fingerprint: self.case.scene.fingerprint_hex(),
            spp: stats.spp,
            seconds,
            metrics,
            negative,
            rejected: stats.rejected,
            peak_bytes,
            floor: self.case.truth.floor,
            machine: machine(),
            version: env!("CARGO_PKG_VERSION").into(),
        };
        Ok(Some(RunResult { record, image }))
    }
}
