//! `fluxion render`.

mod differences;
mod outputs;
mod sampling;

use std::path::PathBuf;
use std::process::ExitCode;
use std::time::{Duration, Instant};

use anyhow::{Result, bail};
use clap::ArgGroup;
use fluxion::adaptive::Start;
use fluxion::error::Error;
use fluxion::internals::ffi::memory::say_what_is_kept;
use fluxion::mitsuba;
use fluxion::pipeline::{Host, Prepared, RENDERING, Recipe, Rendered, Stats};
use fluxion::render::{self, FilmSink, SampleId};
use fluxion::scene::Scene;

pub use self::sampling::allocator_names;
use super::host::{hosted, warn};
use super::outputs::Claims;
use super::viewer::Viewer;
use super::{checkpoint, interrupt, machine, method, progress};
use crate::cli::terminal::{note, out};

/// Options of `render`.
#[derive(clap::Args)]
#[command(group = ArgGroup::new("recorded").multiple(true))]
pub struct Args {
    /// Scene file, Mitsuba 3 XML
    scene: PathBuf,
    #[command(flatten)]
    outputs: outputs::Args,
    #[command(flatten)]
    sampling: sampling::Args,
    #[command(flatten)]
    method: method::Args,
    #[command(flatten)]
    options: super::scene::Args,
    #[command(flatten)]
    checkpoint: checkpoint::Args,
    #[command(flatten)]
    differences: differences::Args,
    /// Megabytes of textures to hold in memory; further images are read tile by tile on demand
    #[arg(
        long, default_value_t = 4096, value_name = "MB", value_parser = clap::value_parser!(u64).range(..1 << 40),
        hide_short_help = true, help_heading = "Machine"
    )]
    texture_memory: u64,
}

impl Args {
    /// The recipe that the options say.
    pub fn recipe(&self) -> Recipe {
        let (sampling, differences) = (&self.sampling, &self.differences);
        let texture_memory = self.texture_memory << 20;
        let light_groups = self.outputs.light_groups.clone();
        Recipe {
            scene: mitsuba::Options { texture_memory, light_groups, ..self.options.options() },
            method: self.method.recipe(),
            kernel: differences.kernel.clone(),
            pilot: differences.pilot,
            shift: differences.shift(),
            differences: differences.differences(),
            statistics: self.outputs.statistics(),
            extent: sampling.extent(),
            seed: sampling.seed,
            first: sampling.first,
            limits: sampling.limits(),
            allocator: sampling.adaptive.clone(),
            goals: sampling.goals.clone(),
            outputs: self.outputs.outputs(self.method.notes.clone()),
        }
    }

    /// The first option that is given and that has no meaning for chunks of jobs.
    pub fn not_of_chunks(&self) -> Option<&'static str> {
        let given = [
            ("--display", self.outputs.display.is_some()),
            ("--replay", self.sampling.replay.is_some()),
            ("--resume", self.checkpoint.resume),
            ("--json", self.outputs.json.is_wanted()),
        ];
        given.into_iter().find(|(_, given)| *given).map(|(name, _)| name)
    }

    /// Time between checkpoints.
    pub fn checkpoint_every(&self) -> Duration {
        self.checkpoint.checkpoint_every
    }
}

/// Renders, reconstructs and writes.
pub fn run(args: &Args) -> Result<ExitCode> {
    let recipe = args.recipe();
    recipe.check()?;
    args.method.make_folder()?;
    let checkpoints = args.checkpoint.checkpoints();
    let _lock = checkpoints.as_ref().map(|checkpoints| checkpoints.lock()).transpose()?;
    if checkpoints.is_some() {
        // While the scene is read, too: what is to be resumed must not look as if it had failed.
        interrupt::stop_on_signal()?;
    }
    let outputs = &recipe.outputs;
    let _claims = Claims::of_layers(
        &outputs.images,
        &[&outputs.layers, &outputs.cryptomatte],
        &[&args.outputs.json.file(), &args.checkpoint.checkpoint],
        &[&args.scene],
    )?;
    let loading = Instant::now();
    let scene = super::scene::read(|| recipe.load(&args.scene))?;
    let load = loading.elapsed().as_secs_f64();
    let prepared = recipe.prepare(&scene, &args.scene)?;
    if let Some(sample) = args.sampling.replay {
        return replay(&recipe, &scene, sample);
    }
    let viewer = viewer(args, &recipe, &scene)?;
    let sinks: Vec<_> = viewer.iter().map(|viewer| viewer as &dyn FilmSink).collect();
    // Between the passes of adaptive sampling only its own share of the work moves the bar.
    let shows = |stage: &str| prepared.allocator.is_none() || stage == RENDERING;
    let finish = |start: Start, host: &Host| finish(args, (&prepared, viewer.as_ref(), load), start, host);
    let stats = hosted(&sinks, shows, |host| match &checkpoints {
        None => finish(prepared.start(&Default::default()), host),
        Some(checkpoints) => {
            let file = checkpoints.file.display();
            say_what_is_kept(format!("; the last checkpoint, if there was time for one, is kept in {file}"));
            let stats = checkpoints.keep((&prepared, prepared.origin()?), host, finish)?;
            interrupt::saved();
            Ok(stats)
        }
    })??;
    args.outputs.json.write(&stats)?;
    tell_unreached(recipe.limits.error, &stats);
    report(&stats);
    Ok(ExitCode::SUCCESS)
}

/// Renders from a start on, and writes.
fn finish(
    args: &Args,
    (prepared, viewer, load): (&Prepared, Option<&Viewer>, f64),
    start: Start,
    host: &Host,
) -> Result<Stats, Error> {
    let mut rendered = prepared.run(start, host)?;
    rendered.stats.seconds.load = load;
    tell_rejected(args, &rendered);
    if let (Some(viewer), Some(solution)) = (viewer, &rendered.solution) {
        viewer.show(&solution.image);
    }
    prepared.write(&mut rendered)?;
    let mut stats = rendered.stats;
    stats.peak_bytes = fluxion::pipeline::peak_bytes();
    Ok(stats)
}

/// The viewer that is to show the image, if there is one.
fn viewer(args: &Args, recipe: &Recipe, scene: &Scene) -> Result<Option<Viewer>> {
    let name = recipe.outputs.images.first().unwrap_or(&args.scene).display().to_string();
    let size = (scene.sensor().width, scene.sensor().height);
    args.outputs.display.as_ref().map(|address| Viewer::new(address, &name, size)).transpose()
}

/// Says how to trace the first sample again that was not finite.
fn tell_rejected(args: &Args, rendered: &Rendered) {
    let Some((SampleId { x, y, index, seed }, _)) = rendered.render.first_rejected else { return };
    note!("replay the first sample that was not finite with:");
    let (file, shift, options) = (args.scene.display(), args.differences.as_text(), args.options.as_text());
    note!("  fluxion render {file} --seed {seed}{shift}{options} --replay {x},{y},{index}");
}

/// Warns where the budget has ended before the error was as small as it was to be.
fn tell_unreached(target: Option<f64>, stats: &Stats) {
    let (Some(target), Some(error)) = (target, stats.passes.last().and_then(|pass| pass.error)) else { return };
    if error > target {
        warn(&format!("the run ended at an estimated relMSE of {error:.2e}, above the target of {target:e}"));
    }
}

/// Says how long everything took.
pub fn report(stats: &Stats) {
    if machine::is_quiet() {
        return;
    }
    if let Some((passes, error)) = stats.passes.last().and_then(|pass| Some((stats.passes.len(), pass.error?))) {
        note!("estimated relMSE {error:.2e} after {passes} passes");
    }
    let rate = stats.samples as f64 / stats.seconds.render.max(1e-9) / 1e6;
    let time = |seconds| progress::seconds(Duration::from_secs_f64(seconds));
    note!(
        "load {}, render {} ({} spp, {rate:.2} million samples a second), reconstruct {}, write {}",
        time(stats.seconds.load),
        time(stats.seconds.render),
        stats.spp,
        time(stats.seconds.reconstruct),
        time(stats.seconds.write)
    );
}

fn replay(recipe: &Recipe, scene: &Scene, (x, y, index): (usize, usize, u32)) -> Result<ExitCode> {
    let sensor = scene.sensor();
    if x >= sensor.width || y >= sensor.height {
        bail!(Error::Usage(format!("pixel {x},{y} is outside the film of {}x{}", sensor.width, sensor.height)));
    }
    let sample = render::sample(scene, SampleId { seed: recipe.seed, x, y, index }, recipe.shift);
    out!("{sample:#?}")?;
    Ok(ExitCode::SUCCESS)
}
