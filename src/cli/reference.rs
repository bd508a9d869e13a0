//! `fluxion reference`.

use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Duration;

use anyhow::{Result, bail};
use fluxion::error::Error;
use fluxion::reference::{Reference, SEED, WAVE};
use fluxion::render::Control;
use fluxion::scene::load;

use super::outputs::Claims;
use super::progress;

/// Options of `reference`.
#[derive(clap::Args)]
pub struct Args {
    /// Scene file, Mitsuba 3 XML
    scene: PathBuf,
    /// EXR file to write after every wave of samples; one that is there already is gone on with
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,
    /// Stop when the estimated relMSE of the reference itself is at most this
    #[arg(long, value_name = "RELMSE", required_unless_present_any = ["time", "spp"], value_parser = parse_floor)]
    target_floor: Option<f64>,
    /// Stop after rendering for so long in all, as in 90s, 30m or 2h
    #[arg(long, value_name = "TIME", value_parser = super::parse_time)]
    time: Option<Duration>,
    /// Stop at so many samples per pixel
    #[arg(long, value_parser = clap::value_parser!(u32).range(2..))]
    spp: Option<u32>,
    /// Film size in place of the scene's, as in 640x360
    #[arg(long, value_parser = super::parse_size, value_name = "WxH")]
    size: Option<(usize, usize)>,
    /// Store half floats; going on from these loses a little of what there was
    #[arg(long)]
    half: bool,
    /// Seed of the random numbers, another one than for the images that are to be judged
    #[arg(long, default_value_t = SEED)]
    seed: u64,
    /// Threads to work with (0: one per core)
    #[arg(long, default_value_t = 0)]
    threads: usize,
    /// Value of a scene parameter, over its <default>
    #[arg(short = 'D', value_parser = super::parse_definition, value_name = "NAME=VALUE")]
    define: Vec<(String, String)>,
    /// Show no progress
    #[arg(short, long)]
    quiet: bool,
}

fn parse_floor(text: &str) -> Result<f64, String> {
    let floor = text.parse().ok().filter(|&floor: &f64| floor > 0.0);
    floor.ok_or_else(|| "a floor is a positive number, as in 1e-4".into())
}

/// Renders wave after wave.
pub fn run(args: &Args) -> Result<ExitCode> {
    super::use_threads(args.threads)?;
    let there = std::fs::metadata(&args.output).is_ok_and(|found| found.len() > 0);
    let _claims = Claims::new(std::slice::from_ref(&args.output), &[], Some(&args.scene))?;
    let before = if there { Some(Reference::load(&args.output)?) } else { None };
    let options = load::Options { parameters: args.define.clone(), size: args.size, ..load::Options::default() };
    let scene = load::load(&args.scene, &options)?;
    let mut reference = match before {
        Some(before) => {
            before.check(&args.output, &scene)?;
            same(args, &before, (scene.sensor().width, scene.sensor().height))?;
            before
        }
        None => Reference::new(&scene, args.seed),
    };
    let stop = super::stop_on_interrupt()?;
    let bar = progress::bar(args.quiet);
    while let Some(spp) = next_wave(args, &reference) {
        bar.set_message(format!("{} spp, floor {:.1e}, next wave", reference.spp, reference.floor()));
        let report = |share| progress::set(&bar, share);
        if !reference.add_wave(&scene, spp / 2, &Control { stop: &stop, progress: &report })? {
            break;
        }
        reference.save(&args.output, args.half)?;
    }
    bar.finish_and_clear();
    if reference.spp == 0 {
        bail!("stopped before the first wave was done");
    }
    println!(
        "{}: {} spp in {}, relMSE floor {:.1e}",
        args.output.display(),
        reference.spp,
        progress::seconds(Duration::from_secs_f64(reference.seconds)),
        reference.floor()
    );
    Ok(ExitCode::SUCCESS)
}

/// Fails if what is there cannot be gone on with.
fn same(args: &Args, before: &Reference, size: (usize, usize)) -> Result<(), Error> {
    let there = (before.image.width, before.image.height);
    if there != size {
        let what = format!(
            "has {}x{} pixels, not {}x{}: give it another --size or --output",
            there.0, there.1, size.0, size.1
        );
        return Err(Error::io(&args.output, what));
    }
    if before.seed != args.seed {
        return Err(Error::io(&args.output, format!("was begun with --seed {}: give it the same", before.seed)));
    }
    Ok(())
}

/// Samples per pixel of the next wave, none when any of the limits is reached.
fn next_wave(args: &Args, reference: &Reference) -> Option<u32> {
    let good = args.target_floor.is_some_and(|target| reference.floor() <= target);
    let long = args.time.is_some_and(|time| reference.seconds >= time.as_secs_f64());
    // An even number: half of them for each half.
    let left = args.spp.map_or(WAVE, |spp| spp.next_multiple_of(2).saturating_sub(reference.spp).min(WAVE));
    (!good && !long && left > 0).then_some(left)
}
