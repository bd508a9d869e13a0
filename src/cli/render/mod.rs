//! `fluxion render`.

mod job;

use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::Mutex;
use std::time::{Duration, Instant};

use anyhow::{Result, bail};
use clap::builder::{PossibleValue, PossibleValuesParser};
use fluxion::adaptive::{self, ALLOCATORS, Allocator, Goals, Limits, Start};
use fluxion::checkpoint::{Origin, Run, content};
use fluxion::error::Error;
use fluxion::film::{Needs, Recorded};
use fluxion::neighbours::Selector;
use fluxion::plan::Plan;
use fluxion::reconstruct;
use fluxion::reference::fingerprint;
use fluxion::render::{self, RenderOutcome, SHIFTS, SampleId, Shift};
use fluxion::scene::{Scene, load};

use self::job::Job;
use super::outputs::Claims;
use super::stats::Stats;
use super::viewer::{self, Viewer};
use super::{checkpoint, kernel, method, progress, statistics, stats};
use crate::cli::interrupt::stop_on_signal;
use crate::cli::terminal::{note, out};

/// Options of `render`.
#[derive(clap::Args)]
pub struct Args {
    /// Scene file, Mitsuba 3 XML
    scene: PathBuf,
    /// Image to write, by its extension: exr, hdr, pfm, tiff, png or jpg; may be given several times, and left out where a checkpoint
    /// or samples are all that is wanted
    #[arg(short, long, required_unless_present_any = ["replay", "checkpoint", "samples"], value_name = "FILE")]
    output: Vec<PathBuf>,
    /// Samples per pixel [default: the scene's own]
    #[arg(long, conflicts_with = "time", value_parser = clap::value_parser!(u32).range(1..))]
    spp: Option<u32>,
    /// Time for everything but reading and writing, as in 60, 60s or 5m; a method that does not estimate its error comes on top
    #[arg(long, value_parser = super::parse_time, value_name = "TIME")]
    time: Option<Duration>,
    /// Give more samples to the pixels that need them, by an allocator; with --time and --target-error as long as the
    /// method estimates its error, unless this says uniform
    #[arg(long, value_name = "ALLOCATOR", num_args = 0..=1, default_missing_value = ALLOCATORS[0].id(), value_parser = allocator_names())]
    adaptive: Option<String>,
    /// Stop when the estimated relMSE is below this; --spp or --time is a limit then
    #[arg(long, value_name = "RELMSE", value_parser = super::parse_positive)]
    target_error: Option<f64>,
    /// Seed of the random numbers; the same seed gives the same bits on any number of threads
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// Number of the first sample of every pixel: films of one seed with consecutive samples are better stratified
    /// together than films of different seeds
    #[arg(long, default_value_t = 0, hide_short_help = true, value_name = "N")]
    first: u32,
    /// Samples that every pixel is to have, as an EXR file with a channel `samples`, such as another render's image: numbers
    /// from --first on, at most --spp of them
    #[arg(long, conflicts_with_all = ["time", "adaptive", "target_error", "samples"], hide_short_help = true, value_name = "FILE")]
    goals: Option<PathBuf>,
    /// Fail unless the scene and the files that it names have this checksum
    #[arg(long, hide = true, requires = "checkpoint", value_name = "CHECKSUM")]
    content: Option<String>,
    #[command(flatten)]
    checkpoint: checkpoint::Args,
    /// Threads to work with (0: one per core)
    #[arg(long, default_value_t = 0, value_parser = super::parse_threads)]
    threads: usize,
    #[command(flatten)]
    options: super::scene::Args,
    #[command(flatten)]
    method: method::Args,
    /// EXR file of all recorded layers, for `fluxion reconstruct`
    #[arg(long, value_name = "FILE")]
    layers: Option<PathBuf>,
    /// Folder for every camera sample's colour, features and differences, as arrays for NumPy
    #[arg(long, value_name = "DIR", conflicts_with_all = ["time", "adaptive", "target_error", "checkpoint"])]
    samples: Option<PathBuf>,
    #[command(flatten)]
    statistics: statistics::Args,
    /// EXR file of Cryptomatte layers: shares of pixels by objects and materials, named by their ids in the scene file
    #[arg(long, value_name = "FILE")]
    cryptomatte: Option<PathBuf>,
    /// Images of the light of groups of emitters by themselves, which add up to the colour, as layers `light.NAME` of exr images:
    /// emitters by the patterns of their ids or those of their shapes, and a group without a pattern for all others
    #[arg(long, value_name = "NAME=PATTERN,...,NAME")]
    light_groups: Option<String>,
    /// Compute what scene, method and layers need, or everything, to see the savings
    #[arg(long, default_value = "needed", value_enum, value_name = "WHAT")]
    plan: Planned,
    /// JSON file for times, samples, memory and the plan; - is standard output
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Trace one sample again and print it: column, row and number of the sample
    #[arg(long, value_parser = parse_sample, value_name = "X,Y,S")]
    replay: Option<(usize, usize, u32)>,
    /// Show the image in the viewer tev while it is rendered [tev:127.0.0.1:14158]
    #[arg(long, value_name = "tev[:HOST[:PORT]]")]
    display: Option<viewer::Address>,
    /// How paths are shifted to neighbouring pixels
    #[arg(long, default_value = SHIFTS[0].id, value_parser = shift_names(), hide_short_help = true)]
    shift: String,
    /// Samples in which paths are shifted
    #[arg(long, default_value = "auto", value_enum, hide_short_help = true, value_name = "WHEN")]
    differences: Shifted,
    #[command(flatten)]
    kernel: kernel::Args,
    /// Roughness above which `reconnect` connects paths at a material instead of copying half vectors
    #[arg(long, value_name = "ALPHA", hide_short_help = true)]
    shift_threshold: Option<f32>,
    /// Megabytes of textures to hold in memory; further images are read tile by tile on demand
    #[arg(long, default_value_t = 4096, value_name = "MB", value_parser = clap::value_parser!(u64).range(..1 << 40), hide_short_help = true)]
    texture_memory: u64,
    /// Show no progress
    #[arg(short, long)]
    quiet: bool,
}

impl Args {
    /// Loads the scene.
    fn load(&self) -> Result<Scene> {
        let texture_memory = self.texture_memory << 20;
        let options = load::Options { threads: self.threads, texture_memory, ..self.options.options() };
        let mut scene = super::scene::load(&self.scene, &options)?;
        if let Some(groups) = &self.light_groups {
            scene.group_lights(groups)?;
        }
        Ok(scene)
    }

    /// Limits of the render.
    fn limits(&self) -> Limits {
        Limits { spp: self.spp, time: self.time, error: self.target_error }
    }

    /// Checksum of the scene and the files that it names.
    pub fn content(&self) -> Result<String> {
        Ok(content(&self.load()?)?)
    }

    /// Fails if the method does not estimate what an allocator needs.
    pub fn check_allocator(&self, allocator: &dyn Allocator) -> Result<()> {
        let method = reconstruct::parse(&self.method.method)?;
        Ok(adaptive::check(method.as_ref(), allocator.needs_error())?)
    }

    /// Fails if these are no options of a chunk, whose film is merged with others and has the samples that its plan says.
    pub fn check_chunk(&self) -> Result<()> {
        if self.adaptive.is_some() || self.target_error.is_some() || self.goals.is_some() {
            let what = "chunks cannot say how many samples they take: give --adaptive before the --, and neither --target-error nor --goals";
            bail!(Error::Usage(what.into()));
        }
        self.kernel.check_merging()
    }
}

/// Extent of the plan.
#[derive(Clone, Copy, clap::ValueEnum)]
enum Planned {
    /// Only what is needed.
    Needed,
    /// Everything that can be recorded.
    All,
}

/// Samples in which paths are shifted.
#[derive(Clone, Copy, PartialEq, clap::ValueEnum)]
enum Shifted {
    /// Fewer where that is costly, for methods that ask for no more.
    Auto,
    /// All.
    Always,
}

fn parse_sample(text: &str) -> Result<(usize, usize, u32), String> {
    let parts: Vec<_> = text.split(',').map(str::trim).collect();
    let error = || "a sample is written X,Y,S, as in 10,20,3".to_owned();
    match parts.as_slice() {
        [x, y, s] => {
            Ok((x.parse().map_err(|_| error())?, y.parse().map_err(|_| error())?, s.parse().map_err(|_| error())?))
        }
        _ => Err(error()),
    }
}

/// Renders, reconstructs and writes.
pub fn run(args: &Args) -> Result<ExitCode> {
    super::use_threads(args.threads)?;
    let method = args.method.make()?;
    let lock = args.checkpoint.lock()?;
    args.checkpoint.check()?;
    if args.checkpoint.checkpoint.is_some() {
        // While the scene is read, too: what is to be resumed must not look as if it had failed.
        stop_on_signal()?;
    }
    let _claims = Claims::of_layers(
        &args.output,
        &[&args.layers, &args.cryptomatte],
        &[&args.json, &args.checkpoint.checkpoint],
        &[&args.scene],
    )?;
    let mut stats = Stats { method: args.method.method.clone(), ..Stats::default() };
    let start = Instant::now();
    let mut scene = args.load()?;
    stats.seconds.load = start.elapsed().as_secs_f64();
    if scene.emitters().is_empty() {
        note!("warning: nothing in {} emits light: the image is black", args.scene.display());
    }
    let kernel = args.kernel.make(method.as_ref(), args.spp.or(args.time.is_none().then_some(scene.sensor().spp)))?;
    let needed = match args.differences {
        Shifted::Always => method.needs().with_every_difference(),
        Shifted::Auto => method.needs(),
    };
    let needed = needed.union(kernel.needs());
    let saved = saved(args, needed);
    let plan = match args.plan {
        Planned::Needed => Plan::new(&scene, needed, saved),
        Planned::All => {
            scene.disable_fast_paths();
            Plan::all(&scene)
        }
    };
    let plan = plan.with_kernel(&kernel);
    (stats.plan, stats.kernel) = (plan.summary(), kernel.name());
    if let Some(sample) = args.replay {
        return replay(args, &scene, sample);
    }
    let origin = args.checkpoint.checkpoint.as_ref().map(|_| origin(args, &scene, &plan, kernel)).transpose()?;
    let goals = goals(args, &scene)?;
    let journal = Mutex::default();
    let start = match origin.as_ref().map(|origin| args.checkpoint.load(origin)).transpose()?.flatten() {
        Some(checkpoint) => checkpoint.resume(&journal),
        None => Start { render: RenderOutcome::new(&scene, plan.needs), journal: &journal },
    };
    let sink = origin.zip(lock).and_then(|(origin, lock)| args.checkpoint.sink(origin, &start, lock));
    let viewer = viewer(args, &scene)?;
    let allocator = adaptive::chosen(args.adaptive.as_deref(), &args.limits(), method.as_ref())?;
    let (scene, method, sink, viewer) = (&scene, method.as_ref(), sink.as_ref(), viewer.as_ref());
    let done = Job { args, scene, method, allocator, kernel, goals, sink, viewer }.run(start, &mut stats);
    match sink {
        Some(sink) => sink.conclude(done)?,
        None => done?,
    }
    report(args, &stats);
    Ok(ExitCode::SUCCESS)
}

/// Sample counts that the film's pixels are to have, if a file says.
fn goals(args: &Args, scene: &Scene) -> Result<Option<Vec<u32>>> {
    let Some(path) = &args.goals else { return Ok(None) };
    let goals = Goals::load(path)?;
    let (width, height) = (scene.sensor().width, scene.sensor().height);
    if goals.size != (width, height) {
        let (columns, rows) = goals.size;
        bail!(Error::mismatch(path, format!("is of {columns}x{rows} pixels, the film of {width}x{height}")));
    }
    Ok(Some(goals.of_chunk(args.first, args.spp)))
}

/// Statistics that are to be saved, for a method with these needs.
fn saved(args: &Args, needed: Needs) -> Needs {
    match (&args.layers, &args.samples) {
        (None, None) => Needs::default(),
        (None, Some(_)) => Needs::NONE.with(Recorded::Features),
        (Some(_), _) => Needs { edges: needed.edges, ..args.statistics.0 }.with(Recorded::Features),
    }
}

/// The viewer that is to show the image, if there is one.
fn viewer(args: &Args, scene: &Scene) -> Result<Option<Viewer>> {
    let name = args.output.first().unwrap_or(&args.scene).display().to_string();
    let size = (scene.sensor().width, scene.sensor().height);
    args.display.as_ref().map(|address| Viewer::new(address, &name, size)).transpose()
}

/// Origin of the film that is going to be rendered. The error says that the scene is not the one that is expected.
fn origin(args: &Args, scene: &Scene, plan: &Plan, kernel: Selector) -> Result<Origin> {
    let content = content(scene)?;
    if args.content.as_ref().is_some_and(|known| *known != content) {
        bail!(Error::mismatch(&args.scene, "has changed since the plan was made, or a file that it names: plan anew"));
    }
    Ok(Origin {
        version: env!("CARGO_PKG_VERSION").into(),
        scene: args.scene.file_name().unwrap_or_default().to_string_lossy().into_owned(),
        content,
        fingerprint: fingerprint(scene),
        method: args.method.method.clone(),
        plan: plan.summary(),
        size: (scene.sensor().width, scene.sensor().height),
        needs: plan.needs,
        shift: shift(args),
        kernel,
        lights: scene.light_groups().names().to_vec(),
        runs: vec![Run { seed: args.seed, first: args.first, samples: 0 }],
    })
}

/// Names of allocators, as values of options.
pub fn allocator_names() -> PossibleValuesParser {
    let name = |allocator: &&dyn Allocator| PossibleValue::new(allocator.id()).help(allocator.summary());
    ALLOCATORS.iter().map(name).collect::<Vec<_>>().into()
}

fn shift_names() -> PossibleValuesParser {
    SHIFTS.iter().map(|kind| PossibleValue::new(kind.id).help(kind.summary)).collect::<Vec<_>>().into()
}

fn shift(args: &Args) -> Shift {
    let shift = Shift::named(&args.shift).unwrap_or_default();
    args.shift_threshold.map_or(shift, |threshold| shift.with_threshold(threshold))
}

fn report(args: &Args, stats: &stats::Stats) {
    if args.quiet {
        return;
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

fn replay(args: &Args, scene: &Scene, (x, y, index): (usize, usize, u32)) -> Result<ExitCode> {
    let sensor = scene.sensor();
    if x >= sensor.width || y >= sensor.height {
        bail!(Error::Usage(format!("pixel {x},{y} is outside the film of {}x{}", sensor.width, sensor.height)));
    }
    let id = SampleId { seed: args.seed, x, y, index };
    let sample = render::sample(scene, id, shift(args));
    out!("{sample:#?}")?;
    Ok(ExitCode::SUCCESS)
}
