//! A render from the first sample to the written image.

use std::path::Path;
use std::time::Instant;

use anyhow::Result;
use fluxion::adaptive::{self, AdaptiveOutcome, AdaptiveSettings, Allocator, Start};
use fluxion::film::{Frame, Needs, Provenance, exr};
use fluxion::image::io::failed_lookups;
use fluxion::mattes::{self, MOST_SAMPLES};
use fluxion::neighbours::Selector;
use fluxion::reconstruct::{Reconstruction, Solution};
use fluxion::reference::fingerprint;
use fluxion::render::{self, Budget, Control, FilmSink, RenderOutcome, RenderSettings, SampleId, SampleSink};
use fluxion::samples::SampleWriter;
use fluxion::scene::Scene;

use super::{Args, shift};
use crate::cli::checkpoint::CheckpointWriter;
use crate::cli::interrupt::stop_on_signal;
use crate::cli::stats::Stats;
use crate::cli::terminal::note;
use crate::cli::viewer::Viewer;
use crate::cli::{method, progress};

/// A render with its options.
pub struct Job<'a> {
    pub args: &'a Args,
    pub scene: &'a Scene,
    pub method: &'a dyn Reconstruction,
    pub allocator: Option<&'a dyn Allocator>,
    pub kernel: Selector,
    pub goals: Option<Vec<u32>>,
    pub sink: Option<&'a CheckpointWriter<'a>>,
    pub viewer: Option<&'a Viewer>,
}

/// Everything that is to be written.
struct Rendered {
    frame: Frame,
    /// None if nobody wants the image.
    solution: Option<Solution>,
    /// The result of saving the layers, whose failure does not lose the image.
    layers: Result<()>,
}

impl Job<'_> {
    /// Renders, reconstructs and writes.
    pub fn run(&self, start: Start, stats: &mut Stats) -> Result<()> {
        let args = self.args;
        let Rendered { frame, solution, layers } = match self.allocator {
            Some(allocator) => self.adaptive(allocator, start, stats)?,
            None => self.straight(start, stats)?,
        };
        if let Some(solution) = solution {
            if let Some(viewer) = self.viewer {
                viewer.show(&solution.image);
            }
            let inner = self.scene.sensor().inner();
            method::write((&args.method, self.method, inner), &args.output, &solution, &frame, stats)?;
        }
        layers?;
        if let Some(path) = &args.cryptomatte {
            self.save_mattes(path, stats)?;
        }
        if let Some(path) = &args.json {
            stats.save(path)?;
        }
        Ok(())
    }

    fn settings(&self, needs: Needs, budget: Budget) -> RenderSettings {
        let (seed, first, shift, kernel) = (self.args.seed, self.args.first, shift(self.args), self.kernel);
        RenderSettings { budget, seed, first, needs, shift, kernel }
    }

    /// Runs something long under a progress bar; an interrupt stops it.
    fn controlled<T>(&self, work: impl FnOnce(&Control) -> Result<T>) -> Result<T> {
        let stop = stop_on_signal()?;
        let bar = progress::bar(self.args.quiet);
        bar.set_message("rendering");
        let report = |share| bar.set(share);
        let checkpoints = self.sink.map(|sink| sink as &dyn FilmSink);
        let sinks: Vec<_> = checkpoints.into_iter().chain(self.viewer.map(|viewer| viewer as &dyn FilmSink)).collect();
        let done = work(&Control { stop, progress: &report, sinks: &sinks, samples: None });
        bar.finish();
        done
    }

    /// The same number of samples for every pixel, or as many as are its goal.
    fn straight(&self, start: Start, stats: &mut Stats) -> Result<Rendered> {
        let args = self.args;
        let spp = args.spp.unwrap_or(self.scene.sensor().spp);
        let budget = args.time.map_or(Budget::Spp(spp), Budget::Time);
        let folder = args.samples.as_deref();
        let writer = folder.map(|folder| SampleWriter::new(folder, self.scene, spp)).transpose()?;
        let settings = self.settings(start.render.film.needs, budget);
        let outcome = self.controlled(|control| {
            let control = Control { samples: writer.as_ref().map(|writer| writer as &dyn SampleSink), ..*control };
            Ok(match &self.goals {
                Some(goals) => render::resume_to_counts(self.scene, settings, &control, start.render, goals),
                None => render::resume(self.scene, settings, &control, start.render),
            })
        })?;
        self.warn(&outcome);
        stats.rendered(&outcome);
        let developing = Instant::now();
        let frame = self.complete(outcome.film.develop(), stats);
        stats.seconds.develop = developing.elapsed().as_secs_f64();
        let mut layers = self.save_layers(&frame, stats);
        if let Some(writer) = writer {
            layers = layers.and(Ok(writer.finish(&outcome.film, &frame.provenance)?));
        }
        let wanted = !args.output.is_empty() || args.json.is_some();
        let solution = wanted.then(|| args.method.solve(self.method, &frame, args.quiet, stats)).transpose()?;
        Ok(Rendered { frame, solution, layers })
    }

    /// In passes that allocate samples to the pixels that need them.
    fn adaptive(&self, allocator: &dyn Allocator, start: Start, stats: &mut Stats) -> Result<Rendered> {
        let args = self.args;
        let limits = args.limits().or_samples(self.scene.sensor().spp);
        let settings = AdaptiveSettings {
            render: self.settings(start.render.film.needs, Budget::Spp(1)),
            method: self.method,
            allocator,
            limits,
            reconstruction: None,
        };
        let context = args.method.context(&|_, _| ());
        let outcome =
            self.controlled(|control| Ok(adaptive::resume(self.scene, &settings, control, &context, start)?))?;
        let AdaptiveOutcome { render, frame, solution, passes, develop, reconstruct } = outcome;
        self.warn(&render);
        stats.rendered(&render);
        (stats.seconds.develop, stats.seconds.reconstruct, stats.passes) = (develop, reconstruct, passes);
        let frame = self.complete(frame, stats);
        let layers = self.save_layers(&frame, stats);
        args.method.write_notes(&solution, &frame)?;
        if let (false, Some(error)) = (args.quiet, stats.passes.last().and_then(|pass| pass.error)) {
            note!("estimated relMSE {error:.2e} after {} passes", stats.passes.len());
        }
        Ok(Rendered { frame, solution: Some(solution), layers })
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

    /// Saves the shares of objects and materials, by as many samples as were taken.
    fn save_mattes(&self, path: &Path, stats: &mut Stats) -> Result<()> {
        let start = Instant::now();
        let mattes = mattes::mattes(self.scene, self.args.seed, stats.spp.clamp(1, MOST_SAMPLES));
        mattes::save(path, self.scene.sensor(), &mattes, self.provenance(stats).attributes())?;
        stats.seconds.write += start.elapsed().as_secs_f64();
        Ok(())
    }

    fn warn(&self, outcome: &RenderOutcome) {
        let args = self.args;
        if let Some((path, count)) = failed_lookups() {
            let path = path.display();
            note!("warning: {count} lookups in textures that can no longer be read were black, the first in {path}");
        }
        if outcome.stopped {
            let spp = outcome.film.most_samples();
            note!("warning: stopped early; the image has up to {spp} samples per pixel");
        }
        if let Some((id, reason)) = outcome.first_rejected {
            let (count, SampleId { x, y, index, seed }) = (outcome.film.rejected(), id);
            note!("warning: {count} samples were not finite ({}) and count as zero; the first one again:", reason.0);
            let options = args.options.as_text();
            let threshold = args.shift_threshold.map_or(String::new(), |alpha| format!(" --shift-threshold {alpha}"));
            note!(
                "  fluxion render {} --seed {seed} --shift {}{threshold}{options} \
                 --replay {x},{y},{index}",
                args.scene.display(),
                args.shift
            );
        }
    }

    /// A frame with everything that files say of it.
    fn complete(&self, frame: Frame, stats: &Stats) -> Frame {
        let mut frame = frame.with_provenance(self.provenance(stats));
        frame.window = self.scene.sensor().window();
        frame
    }

    /// Provenance of everything that is written.
    fn provenance(&self, stats: &Stats) -> Provenance {
        Provenance {
            scene: self.args.scene.file_name().unwrap_or_default().to_string_lossy().into_owned(),
            fingerprint: fingerprint(self.scene),
            seed: self.args.seed.to_string(),
            method: self.args.method.method.clone(),
            plan: stats.plan.clone(),
            kernel: stats.kernel.clone(),
            ..Provenance::new()
        }
        .after(f64::from(stats.spp), stats.seconds.render)
    }
}
