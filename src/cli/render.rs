//! `fluxion render`.

use std::path::PathBuf;
use std::process::ExitCode;
use std::time::{Duration, Instant};

use anyhow::{Result, bail};
use clap::builder::{PossibleValue, PossibleValuesParser};
use fluxion::adaptive::{self, ALLOCATORS, Allocator, Limits};
use fluxion::error::Error;
use fluxion::film::{Frame, Needs, exr};
use fluxion::plan::Plan;
use fluxion::reconstruct::{Reconstruction, Solution};
use fluxion::render::gradient::shift::{SHIFTS, Shift};
use fluxion::render::{self, Budget, Control, Outcome, SampleId, Settings};
use fluxion::scene::{Scene, load};

use super::outputs::Claims;
use super::stats::Stats;
use super::{method, progress, stats};

/// Options of `render`.
#[derive(clap::Args)]
pub struct Args {
    /// Scene file, Mitsuba 3 XML
    scene: PathBuf,
    /// Image to write, by its extension: exr, hdr, png or jpg; may be given several times
    #[arg(short, long, required_unless_present = "replay", value_name = "FILE")]
    output: Vec<PathBuf>,
    /// Samples per pixel [default: the scene's own]
    #[arg(long, conflicts_with = "time", value_parser = clap::value_parser!(u32).range(1..))]
    spp: Option<u32>,
    /// Time to render for, as in 60, 60s or 5m
    #[arg(long, value_parser = super::parse_time, value_name = "TIME")]
    time: Option<Duration>,
    /// Deal samples to the pixels that need them, by an allocator
    #[arg(long, value_name = "ALLOCATOR", num_args = 0..=1, default_missing_value = ALLOCATORS[0].id(), value_parser = allocator_names())]
    adaptive: Option<String>,
    /// Stop when the estimated relMSE is below this; --spp or --time is a limit then
    #[arg(long, value_name = "RELMSE", value_parser = super::parse_positive)]
    target_error: Option<f64>,
    /// Seed of the random numbers; the same seed gives the same bits on any number of threads
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// Threads to work with (0: one per core)
    #[arg(long, default_value_t = 0)]
    threads: usize,
    /// Film size in place of the scene's, as in 640x360
    #[arg(long, value_parser = super::parse_size, value_name = "WxH")]
    size: Option<(usize, usize)>,
    #[command(flatten)]
    method: method::Args,
    /// EXR file for everything that was recorded, for `fluxion reconstruct`
    #[arg(long, value_name = "FILE")]
    layers: Option<PathBuf>,
    /// Record the statistics of eight independent groups of samples in the layers
    #[arg(long, requires = "layers")]
    bins: bool,
    /// Record ambient occlusion in the layers
    #[arg(long, requires = "layers")]
    occlusion: bool,
    /// Record world positions in the layers
    #[arg(long, requires = "layers")]
    position: bool,
    /// Record what an ambient light would add in the layers, by which `feature:ambient` sees what no path has lit
    #[arg(long, requires = "layers")]
    ambient: bool,
    /// What to compute: what the scene, the method and the layers need, or everything, to see what that saves
    #[arg(long, default_value = "needed", value_enum, value_name = "WHAT")]
    plan: Planned,
    /// JSON file for times, samples, memory and what was left out
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Trace one sample again and print it: column, row and number of the sample
    #[arg(long, value_parser = parse_sample, value_name = "X,Y,S")]
    replay: Option<(usize, usize, u32)>,
    /// Value of a scene parameter, over its <default>
    #[arg(short = 'D', value_parser = super::parse_definition, value_name = "NAME=VALUE")]
    define: Vec<(String, String)>,
    /// How paths are moved to neighbouring pixels
    #[arg(long, default_value = SHIFTS[0].0, value_parser = shift_names(), hide_short_help = true)]
    shift: String,
    /// Roughness above which `reconnect` goes through a material instead of copying half vectors
    #[arg(long, value_name = "ALPHA", hide_short_help = true)]
    shift_threshold: Option<f32>,
    /// Megabytes of textures to hold in memory; further images are read tile by tile as they are needed
    #[arg(long, default_value_t = 4096, value_name = "MB", value_parser = clap::value_parser!(u64).range(..1 << 40), hide_short_help = true)]
    texture_memory: u64,
    /// Show no progress
    #[arg(short, long)]
    quiet: bool,
}

/// What is computed.
#[derive(Clone, Copy, clap::ValueEnum)]
enum Planned {
    /// What is needed.
    Needed,
    /// Everything that can be.
    All,
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
    let _claims = Claims::new(&args.output, &[&args.layers, &args.json], &[&args.scene])?;
    let mut stats = Stats { method: args.method.method.clone(), ..Stats::default() };
    let start = Instant::now();
    let texture_memory = args.texture_memory << 20;
    let options =
        load::Options { parameters: args.define.clone(), size: args.size, threads: args.threads, texture_memory };
    let mut scene = load::load(&args.scene, &options)?;
    stats.seconds.load = start.elapsed().as_secs_f64();
    if scene.emitters().is_empty() {
        eprintln!("warning: nothing in {} emits light: the image is black", args.scene.display());
    }
    let saved = match &args.layers {
        Some(_) => Needs {
            features: true,
            edges: method.needs().edges,
            bins: args.bins,
            occlusion: args.occlusion,
            position: args.position,
            ambient: args.ambient,
        },
        None => Needs::default(),
    };
    let plan = match args.plan {
        Planned::Needed => Plan::new(&scene, method.needs(), saved),
        Planned::All => {
            scene.generalize();
            Plan::all(&scene)
        }
    };
    stats.plan = plan.summary();
    if let Some(sample) = args.replay {
        return replay(args, &scene, sample);
    }
    let (frame, solution) = if args.adaptive.is_some() || args.target_error.is_some() {
        adaptive(args, &scene, method.as_ref(), &plan, &mut stats)?
    } else {
        let outcome = trace(args, &scene, plan.needs)?;
        warn(args, &outcome);
        stats.rendered(&outcome);
        let start = Instant::now();
        let mut frame = outcome.film.develop();
        if method.needs().edges && !plan.needs.edges {
            frame.fill_dark_edges();
        }
        frame.attributes = attributes(args, &scene, &stats);
        stats.seconds.develop = start.elapsed().as_secs_f64();
        save(args, &frame, &mut stats)?;
        let solution = args.method.solve(method.as_ref(), &frame, args.quiet, &mut stats)?;
        (frame, solution)
    };
    method::write(&args.output, &solution, &frame, &mut stats)?;
    if let Some(path) = &args.json {
        stats.save(path)?;
    }
    report(args, &stats);
    Ok(ExitCode::SUCCESS)
}

/// Saves the layers, if they are asked for.
fn save(args: &Args, frame: &Frame, stats: &mut Stats) -> Result<()> {
    if let Some(path) = &args.layers {
        let start = Instant::now();
        exr::save(path, frame)?;
        stats.seconds.write += start.elapsed().as_secs_f64();
    }
    Ok(())
}

fn allocator_names() -> PossibleValuesParser {
    let name = |allocator: &&dyn Allocator| PossibleValue::new(allocator.id()).help(allocator.summary());
    ALLOCATORS.iter().map(name).collect::<Vec<_>>().into()
}

/// Renders and reconstructs in passes.
fn adaptive(
    args: &Args,
    scene: &Scene,
    method: &dyn Reconstruction,
    plan: &Plan,
    stats: &mut Stats,
) -> Result<(Frame, Solution)> {
    let limits = Limits {
        // Without any limit the scene says how much.
        spp: args.spp.or((args.time.is_none() && args.target_error.is_none()).then_some(scene.sensor().spp)),
        time: args.time,
        error: args.target_error,
    };
    let settings = adaptive::Settings {
        render: settings(args, plan.needs, Budget::Spp(1)),
        method,
        allocator: adaptive::allocator(args.adaptive.as_deref().unwrap_or("uniform"))?,
        limits,
        reconstruction: None,
        lit: plan.needs.edges || !method.needs().edges,
    };
    let stop = super::stop_on_interrupt()?;
    let bar = progress::bar(args.quiet);
    bar.set_message("rendering");
    let report = |share| progress::set(&bar, share);
    let context = args.method.context(&|_, _| ());
    let outcome = adaptive::run(scene, &settings, &Control { stop: &stop, progress: &report }, &context)?;
    bar.finish_and_clear();
    let adaptive::Outcome { render, mut frame, solution, passes, develop, reconstruct } = outcome;
    warn(args, &render);
    stats.rendered(&render);
    (stats.seconds.develop, stats.seconds.reconstruct, stats.passes) = (develop, reconstruct, passes);
    frame.attributes = attributes(args, scene, stats);
    save(args, &frame, stats)?;
    args.method.write_notes(&solution, &frame)?;
    if let (false, Some(error)) = (args.quiet, stats.passes.last().and_then(|pass| pass.error)) {
        eprintln!("estimated relMSE {error:.2e} after {} passes", stats.passes.len());
    }
    Ok((frame, solution))
}

fn shift_names() -> PossibleValuesParser {
    SHIFTS.iter().map(|(name, _, summary)| PossibleValue::new(*name).help(*summary)).collect::<Vec<_>>().into()
}

fn shift(args: &Args) -> Shift {
    let row = SHIFTS.iter().find(|(name, ..)| *name == args.shift);
    match (row.map(|(_, shift, _)| *shift).unwrap_or_default(), args.shift_threshold) {
        (Shift::Reconnect { .. }, Some(threshold)) => Shift::Reconnect { threshold },
        (shift, _) => shift,
    }
}

fn settings(args: &Args, needs: Needs, budget: Budget) -> Settings {
    Settings { budget, seed: args.seed, first: 0, needs, shift: shift(args) }
}

fn trace(args: &Args, scene: &Scene, needs: Needs) -> Result<Outcome> {
    let stop = super::stop_on_interrupt()?;
    let budget = match args.time {
        Some(time) => Budget::Time(time),
        None => Budget::Spp(args.spp.unwrap_or(scene.sensor().spp)),
    };
    let settings = settings(args, needs, budget);
    let bar = progress::bar(args.quiet);
    bar.set_message("rendering");
    let report = |share| progress::set(&bar, share);
    let outcome = render::render(scene, settings, &Control { stop: &stop, progress: &report });
    bar.finish_and_clear();
    Ok(outcome)
}

fn warn(args: &Args, outcome: &Outcome) {
    if outcome.stopped {
        eprintln!("warning: stopped early; the image has up to {} samples per pixel", outcome.spp);
    }
    if let Some((id, reason)) = outcome.first_rejected {
        let (count, SampleId { x, y, index, seed }) = (outcome.film.rejected(), id);
        eprintln!("warning: {count} samples were not finite ({}) and count as zero; the first one again:", reason.0);
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

fn attributes(args: &Args, scene: &Scene, stats: &Stats) -> Vec<(String, String)> {
    let pairs = [
        ("fluxion:version", env!("CARGO_PKG_VERSION").to_owned()),
        ("fluxion:scene", args.scene.file_name().unwrap_or_default().to_string_lossy().into_owned()),
        ("fluxion:fingerprint", format!("{:016x}", scene.fingerprint())),
        ("fluxion:seed", args.seed.to_string()),
        ("fluxion:spp", stats.spp.to_string()),
        ("fluxion:seconds", format!("{:.3}", stats.seconds.render)),
        ("fluxion:method", args.method.method.clone()),
        ("fluxion:plan", stats.plan.clone()),
    ];
    pairs.map(|(name, value)| (name.to_owned(), value)).to_vec()
}

fn report(args: &Args, stats: &stats::Stats) {
    if args.quiet {
        return;
    }
    let rate = stats.samples as f64 / stats.seconds.render.max(1e-9) / 1e6;
    let time = |seconds| progress::seconds(Duration::from_secs_f64(seconds));
    eprintln!(
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
    println!("{sample:#?}");
    Ok(ExitCode::SUCCESS)
}
