//! `fluxion reference`.

use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Duration;

use anyhow::{Result, bail};
use fluxion::error::Error;
use fluxion::reference::{Reference, SEED, check};
use fluxion::render::{Control, EPOCH};

use super::outputs::Claims;
use super::progress;
use super::terminal::{note, out};

/// Options of `reference`.
#[derive(clap::Args)]
pub struct Args {
    /// Scene file, Mitsuba 3 XML
    scene: PathBuf,
    /// EXR file to write after every wave of up to 256 samples per pixel; an existing one is continued
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,
    /// Stop when the estimated relMSE of the reference itself is at most this
    #[arg(long, value_name = "RELMSE", required_unless_present_any = ["time", "spp"], value_parser = parse_floor)]
    target_floor: Option<f64>,
    /// Stop after about this total time, as in 90s, 30m or 2h
    #[arg(long, value_name = "TIME", value_parser = super::parse_time)]
    time: Option<Duration>,
    /// Stop at this number of samples per pixel
    #[arg(long, value_parser = clap::value_parser!(u32).range(2..1 << 30))]
    spp: Option<u32>,
    #[command(flatten)]
    options: super::scene::Args,
    /// Store half floats; continuing from these loses some precision
    #[arg(long)]
    half: bool,
    /// Seed of the random numbers, another one than for the images that are to be judged
    #[arg(long, default_value_t = SEED)]
    seed: u64,
}

fn parse_floor(text: &str) -> Result<f64, String> {
    let floor = text.parse().ok().filter(|&floor: &f64| floor > 0.0);
    floor.ok_or_else(|| "a floor is a positive number, as in 1e-4".into())
}

/// Renders wave after wave.
pub fn run(args: &Args) -> Result<ExitCode> {
    let there = std::fs::metadata(&args.output).is_ok_and(|found| found.len() > 0);
    if args.output.extension().is_none_or(|extension| extension != "exr") {
        bail!(Error::io(&args.output, "references are EXR files: give it a name that ends in .exr"));
    }
    let _claims = Claims::new(std::slice::from_ref(&args.output), &[], &[&args.scene])?;
    let before = if there { Some(Reference::load(&args.output)?) } else { None };
    let scene = super::scene::load(&args.scene, &args.options.options())?;
    let mut reference = match before {
        Some(before) => {
            check(&before.fingerprint, &args.output, &scene)?;
            same(args, &before, (scene.sensor().width, scene.sensor().height))?;
            before
        }
        None => Reference::new(&scene, args.seed),
    };
    let stop = super::interrupt::stop_on_signal()?;
    let bar = progress::bar();
    while let Some(spp) = next_wave(args, &reference) {
        bar.set_message(&format!("{} spp, floor {:.1e}, next wave", reference.spp, reference.floor()));
        let report = |share| bar.set(share);
        if !reference.add_wave(&scene, spp / 2, &Control { stop, progress: &report, ..Control::QUIET })? {
            break;
        }
        reference.save(&args.output, args.half)?;
    }
    bar.finish();
    if there {
        // It may be there as floats and wanted as half floats.
        reference.save(&args.output, args.half)?;
    }
    if args.half && !reference.fits_half() {
        note!("warning: the brightest values do not fit into half floats: these are floats");
    }
    if reference.spp == 0 {
        bail!("stopped before the first wave was done");
    }
    out!(
        "{}: {} spp in {}, relMSE floor {:.1e}",
        args.output.display(),
        reference.spp,
        progress::seconds(Duration::from_secs_f64(reference.seconds)),
        reference.floor()
    )?;
    Ok(ExitCode::SUCCESS)
}

/// Fails if the existing reference cannot be continued.
fn same(args: &Args, before: &Reference, size: (usize, usize)) -> Result<(), Error> {
    let there = (before.image.width, before.image.height);
    if there != size {
        let what = format!(
            "has {}x{} pixels, not {}x{}: give it another --size or --output",
            there.0, there.1, size.0, size.1
        );
        return Err(Error::mismatch(&args.output, what));
    }
    if before.epoch != EPOCH {
        let what = format!(
            "is of another epoch of samples, {}: this fluxion's are of {EPOCH}; make another one",
            before.epoch
        );
        return Err(Error::mismatch(&args.output, what));
    }
    if before.seed != args.seed {
        return Err(Error::mismatch(
            &args.output,
            format!("was started with --seed {}: give it the same", before.seed),
        ));
    }
    Ok(())
}

/// Samples per pixel of the shortest and the longest wave.
const WAVES: (u32, u32) = (16, 256);

/// Samples per pixel of the next wave, an even number; none when any of the limits is reached. Waves begin short, so
/// that there is a file soon, and the last one is as long as the time that is left.
fn next_wave(args: &Args, reference: &Reference) -> Option<u32> {
    let good = args.target_floor.is_some_and(|target| reference.floor() <= target);
    let wave = reference.spp.clamp(WAVES.0, WAVES.1);
    let left = args.spp.map_or(wave, |spp| spp.next_multiple_of(2).saturating_sub(reference.spp).min(wave));
    let in_time = match args.time {
        Some(time) if reference.spp > 0 => {
            let seconds = (time.as_secs_f64() - reference.seconds).max(0.0);
            // Rounded to the nearest even number.
            let affordable = seconds / reference.seconds.max(1e-9) * f64::from(reference.spp);
            left.min(2 * (0.5 * affordable + 0.5) as u32)
        }
        _ => left,
    };
    (!good && in_time > 0).then_some(in_time)
}
