//! The run: samples, then the frame, then the image.

use std::sync::Mutex;
use std::time::Instant;

use super::host::{Host, RENDERING};
use super::prepare::Prepared;
use super::stats::Stats;
use crate::adaptive::{self, AdaptiveOutcome, AdaptiveSettings, Allocator, Journal, Start};
use crate::error::Result;
use crate::film::{Frame, exr};
use crate::image::io::failed_lookups;
use crate::output::samples::SampleWriter;
use crate::reconstruct::Solution;
use crate::render::{self, Control, RenderOutcome, RenderSettings, SampleId, SampleSink};

/// A render that has ended.
pub struct Rendered {
    /// The film.
    pub render: RenderOutcome,
    /// Its means and variances.
    pub frame: Frame,
    /// The image; none if it was not asked for.
    pub solution: Option<Solution>,
    /// Times and counts.
    pub stats: Stats,
    /// The result of saving layers and samples, whose failure does not lose the image.
    pub(super) stored: Result<()>,
}

impl Prepared<'_> {
    /// Renders from the first sample on.
    pub fn run_anew(&self, host: &Host) -> Result<Rendered> {
        let journal = Mutex::default();
        self.run(self.start(&journal), host)
    }

    /// The start of a render without samples.
    pub fn start<'a>(&self, journal: &'a Mutex<Journal>) -> Start<'a> {
        Start { render: RenderOutcome::new(self.scene, self.settings.needs), journal }
    }

    /// Renders and makes the frame and the image. Layers and samples are saved on the way, before the method begins.
    pub fn run(&self, start: Start, host: &Host) -> Result<Rendered> {
        self.warnings.iter().for_each(|warning| (host.warn)(warning));
        match self.allocator {
            Some(allocator) => self.adaptive(allocator, start, host),
            None => self.straight(start, host),
        }
    }

    /// The same number of samples for every pixel, or as many as are its goal.
    fn straight(&self, start: Start, host: &Host) -> Result<Rendered> {
        let folder = self.outputs.samples.as_deref();
        let spp = self.limits.spp.unwrap_or(self.scene.sensor().spp);
        let writer = folder.map(|folder| SampleWriter::new(folder, self.scene, spp)).transpose()?;
        let samples = writer.as_ref().map(|writer| writer as &dyn SampleSink);
        let outcome = self.render(start.render, samples, host);
        let mut rendered = self.develop(outcome, host);
        if let Some(writer) = writer {
            let finished = writer.finish(&rendered.render.film, &rendered.frame.provenance);
            rendered.stored = rendered.stored.and(finished);
        }
        if self.outputs.needs_image() {
            rendered.solution = Some(self.method.solve(&rendered.frame, host, &mut rendered.stats)?);
        }
        Ok(rendered)
    }

    /// Takes the samples that are missing.
    pub fn render(&self, film: RenderOutcome, samples: Option<&dyn SampleSink>, host: &Host) -> RenderOutcome {
        let progress = |share| (host.progress)(RENDERING, share);
        let control = Control { stop: host.stop, progress: &progress, sinks: host.sinks, samples };
        let settings = RenderSettings { needs: film.film.needs, ..self.settings };
        match &self.goals {
            Some(goals) => render::resume_to_counts(self.scene, settings, &control, film, goals),
            None => render::resume(self.scene, settings, &control, film),
        }
    }

    /// Makes the frame of a film, and saves the layers.
    pub fn develop(&self, outcome: RenderOutcome, host: &Host) -> Rendered {
        let developing = Instant::now();
        let frame = outcome.film.develop();
        let develop = developing.elapsed().as_secs_f64();
        let mut rendered = self.rendered(outcome, frame, host);
        rendered.stats.seconds.develop = develop;
        rendered
    }

    /// In passes that allocate samples to the pixels that need them.
    fn adaptive(&self, allocator: &dyn Allocator, start: Start, host: &Host) -> Result<Rendered> {
        let settings = AdaptiveSettings {
            render: RenderSettings { needs: start.render.film.needs, ..self.settings },
            method: &*self.method.made,
            allocator,
            limits: self.limits,
            reconstruction: self.reconstruction,
        };
        let progress = |share| (host.progress)(RENDERING, share);
        let control = Control { stop: host.stop, progress: &progress, sinks: host.sinks, samples: None };
        let done = adaptive::resume(self.scene, &settings, &control, &self.method.context(host), start)?;
        let AdaptiveOutcome { render, frame, solution, passes, develop, reconstruct } = done;
        self.method.made.warnings(&frame).iter().for_each(|warning| (host.warn)(warning));
        self.method.check_notes(&solution, host);
        let mut rendered = self.rendered(render, frame, host);
        let seconds = &mut rendered.stats.seconds;
        (seconds.develop, seconds.reconstruct) = (develop, reconstruct);
        (rendered.stats.passes, rendered.solution) = (passes, Some(solution));
        Ok(rendered)
    }

    /// A render with everything that files say of its frame. Saves the layers.
    fn rendered(&self, render: RenderOutcome, frame: Frame, host: &Host) -> Rendered {
        warn(&render, host);
        let mut frame = frame.with_provenance(self.origin.provenance(&render));
        frame.window = self.scene.sensor().window();
        let mut stats = Stats {
            method: self.method.name.clone(),
            plan: self.origin.plan.clone(),
            kernel: self.origin.kernel.name(),
            ..Stats::default()
        };
        stats.rendered(&render);
        let start = Instant::now();
        let stored = self.outputs.layers.as_ref().map_or(Ok(()), |path| exr::save(path, &frame));
        stats.seconds.write += start.elapsed().as_secs_f64();
        Rendered { render, frame, solution: None, stats, stored }
    }
}

fn warn(outcome: &RenderOutcome, host: &Host) {
    if let Some((path, count)) = failed_lookups() {
        let path = path.display();
        (host.warn)(&format!("{count} lookups in textures that can no longer be read were black, the first in {path}"));
    }
    if let Some((SampleId { x, y, index, seed }, reason)) = outcome.first_rejected {
        let (count, reason) = (outcome.film.rejected(), reason.0);
        let first = format!("the first is number {index} of pixel {x},{y}, seed {seed}");
        (host.warn)(&format!("{count} samples were not finite ({reason}) and count as zero; {first}"));
    }
    if outcome.stopped {
        let spp = outcome.film.most_samples();
        (host.warn)(&format!("stopped early; the image has up to {spp} samples per pixel"));
    }
}
