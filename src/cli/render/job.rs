//! A render from the first sample to the written image.

use std::time::Instant;

use anyhow::Result;
use fluxion::adaptive::{self, Begun, Limits};
use fluxion::film::{Frame, Needs, exr};
use fluxion::image::io::failed_lookups;
use fluxion::plan::Plan;
use fluxion::reconstruct::{Reconstruction, Solution};
use fluxion::render::{self, Budget, Control, Outcome, SampleId, Settings};
use fluxion::scene::Scene;

use super::{Args, shift};
use crate::cli::checkpoint::Keeper;
use crate::cli::stats::Stats;
use crate::cli::{method, progress, stop_on_interrupt};

/// What is asked for.
pub struct Job<'a> {
    pub args: &'a Args,
    pub scene: &'a Scene,
    pub method: &'a dyn Reconstruction,
    pub plan: &'a Plan,
    pub keeper: Option<&'a Keeper<'a>>,
}

/// What a job leaves to be written.
struct Made {
    frame: Frame,
    solution: Solution,
    /// How saving the layers went: without them there is still an image.
    layers: Result<()>,
}

impl Job<'_> {
    /// Renders, reconstructs and writes.
    pub fn run(&self, begun: Begun, stats: &mut Stats) -> Result<()> {
        let args = self.args;
        let Made { frame, solution, layers } = if args.adaptive.is_some() || args.target_error.is_some() {
            self.adaptive(begun, stats)?
        } else {
            self.straight(begun, stats)?
        };
        method::write(&args.output, &solution, &frame, stats)?;
        layers?;
        if let Some(path) = &args.json {
            stats.save(path)?;
        }
        Ok(())
    }

    fn settings(&self, needs: Needs, budget: Budget) -> Settings {
        Settings { budget, seed: self.args.seed, first: self.args.first, needs, shift: shift(self.args) }
    }

    /// Does something long under a progress bar, until an interrupt stops it.
    fn controlled<T>(&self, work: impl FnOnce(&Control) -> Result<T>) -> Result<T> {
        let stop = stop_on_interrupt()?;
        let bar = progress::bar(self.args.quiet);
        bar.set_message("rendering");
        let report = |share| progress::set(&bar, share);
        let keeper = self.keeper.map(|keeper| keeper as &dyn render::Keeper);
        let done = work(&Control { stop: &stop, progress: &report, keeper });
        bar.finish_and_clear();
        done
    }

    /// As many samples for every pixel.
    fn straight(&self, begun: Begun, stats: &mut Stats) -> Result<Made> {
        let args = self.args;
        let budget = match args.time {
            Some(time) => Budget::Time(time),
            None => Budget::Spp(args.spp.unwrap_or(self.scene.sensor().spp)),
        };
        let settings = self.settings(begun.render.film.needs, budget);
        let outcome = self.controlled(|control| Ok(render::resume(self.scene, settings, control, begun.render)))?;
        self.warn(&outcome);
        stats.rendered(&outcome);
        let start = Instant::now();
        let mut frame = outcome.film.develop();
        if self.method.needs().edges && self.plan.is_dark() {
            frame.fill_dark_edges();
        }
        frame.attributes = self.attributes(stats);
        stats.seconds.develop = start.elapsed().as_secs_f64();
        let layers = self.save_layers(&frame, stats);
        let solution = args.method.solve(self.method, &frame, args.quiet, stats)?;
        Ok(Made { frame, solution, layers })
    }

    /// In passes, samples where they are needed.
    fn adaptive(&self, begun: Begun, stats: &mut Stats) -> Result<Made> {
        let args = self.args;
        let limits = Limits {
            // Without any limit the scene says how much.
            spp: args.spp.or((args.time.is_none() && args.target_error.is_none()).then_some(self.scene.sensor().spp)),
            time: args.time,
            error: args.target_error,
        };
        let settings = adaptive::Settings {
            render: self.settings(begun.render.film.needs, Budget::Spp(1)),
            method: self.method,
            allocator: adaptive::allocator(args.adaptive.as_deref().unwrap_or("uniform"))?,
            limits,
            reconstruction: None,
            lit: !self.plan.is_dark(),
        };
        let context = args.method.context(&|_, _| ());
        let outcome =
            self.controlled(|control| Ok(adaptive::resume(self.scene, &settings, control, &context, begun)?))?;
        let adaptive::Outcome { render, mut frame, solution, passes, develop, reconstruct } = outcome;
        self.warn(&render);
        stats.rendered(&render);
        (stats.seconds.develop, stats.seconds.reconstruct, stats.passes) = (develop, reconstruct, passes);
        frame.attributes = self.attributes(stats);
        let layers = self.save_layers(&frame, stats);
        args.method.write_notes(&solution, &frame)?;
        if let (false, Some(error)) = (args.quiet, stats.passes.last().and_then(|pass| pass.error)) {
            eprintln!("estimated relMSE {error:.2e} after {} passes", stats.passes.len());
        }
        Ok(Made { frame, solution, layers })
    }

    /// Saves the layers, if they are asked for.
    fn save_layers(&self, frame: &Frame, stats: &mut Stats) -> Result<()> {
        if let Some(path) = &self.args.layers {
            let start = Instant::now();
            exr::save(path, frame)?;
            stats.seconds.write += start.elapsed().as_secs_f64();
        }
        Ok(())
    }

    fn warn(&self, outcome: &Outcome) {
        let args = self.args;
        if let Some((path, count)) = failed_lookups() {
            let path = path.display();
            eprintln!(
                "warning: {count} lookups in textures that can no longer be read were black, the first in {path}"
            );
        }
        if outcome.stopped {
            let spp = outcome.film.most_samples();
            eprintln!("warning: stopped early; the image has up to {spp} samples per pixel");
        }
        if let Some((id, reason)) = outcome.first_rejected {
            let (count, SampleId { x, y, index, seed }) = (outcome.film.rejected(), id);
            eprintln!(
                "warning: {count} samples were not finite ({}) and count as zero; the first one again:",
                reason.0
            );
            let (width, height) = (outcome.film.width, outcome.film.height);
            let threshold = args.shift_threshold.map_or(String::new(), |alpha| format!(" --shift-threshold {alpha}"));
            let definitions: String = args.define.iter().map(|(name, value)| format!(" -D '{name}={value}'")).collect();
            eprintln!(
                "  fluxion render {} --size {width}x{height} --seed {seed} --shift {}{threshold}{definitions} \
                 --replay {x},{y},{index}",
                args.scene.display(),
                args.shift
            );
        }
    }

    /// Header attributes of everything that is written.
    fn attributes(&self, stats: &Stats) -> Vec<(String, String)> {
        let pairs = [
            ("fluxion:version", env!("CARGO_PKG_VERSION").to_owned()),
            ("fluxion:scene", self.args.scene.file_name().unwrap_or_default().to_string_lossy().into_owned()),
            ("fluxion:fingerprint", format!("{:016x}", self.scene.fingerprint())),
            ("fluxion:seed", self.args.seed.to_string()),
            ("fluxion:spp", stats.spp.to_string()),
            ("fluxion:seconds", format!("{:.3}", stats.seconds.render)),
            ("fluxion:method", self.args.method.method.clone()),
            ("fluxion:plan", stats.plan.clone()),
        ];
        pairs.map(|(name, value)| (name.to_owned(), value)).to_vec()
    }
}
