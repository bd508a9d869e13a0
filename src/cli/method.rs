//! Common part of `render` and `reconstruct`: the method, its image and its intermediate images.

use std::path::{Path, PathBuf};
use std::time::Instant;

use anyhow::{Context as _, Result, bail};
use fluxion::film::{Frame, Layer};
use fluxion::image::Image;
use fluxion::image::io::{self, Extras};
use fluxion::reconstruct::{self, Context, Reconstruction, Solution};

use fluxion::scene::sensor::Crop;

use super::progress;
use super::stats::Stats;
use super::terminal::note;

/// Options of the reconstruction.
#[derive(clap::Args)]
pub struct Args {
    /// Reconstruction with its parameters; `fluxion info --methods` lists them
    #[arg(long, default_value = reconstruct::DEFAULT, value_name = "NAME[:KEY=VALUE,...]")]
    pub method: String,
    /// Megabytes that the reconstruction may use besides the layers; the image is the same
    #[arg(long, value_name = "MB", value_parser = clap::value_parser!(u64).range(1..1 << 40))]
    max_memory: Option<u64>,
    /// Exposure of png and jpg images, in powers of two: 1 makes them twice as bright
    #[arg(long, default_value_t = 0.0, value_name = "EV", allow_negative_numbers = true, value_parser = parse_exposure)]
    exposure: f32,
    /// Folder for the intermediate images of the method, as EXR files
    #[arg(long, value_name = "DIR")]
    notes: Option<PathBuf>,
}

fn parse_exposure(text: &str) -> Result<f32, String> {
    let exposure = text.parse().ok().filter(|exposure: &f32| exposure.abs() <= 100.0);
    exposure.ok_or_else(|| "an exposure is a number of powers of two, as in 1.5 or -2".into())
}

impl Args {
    /// The method, after making sure that its notes can be written.
    pub fn make(&self) -> Result<Box<dyn Reconstruction>> {
        let method = reconstruct::parse(&self.method)?;
        if let Some(folder) = &self.notes {
            std::fs::create_dir_all(folder).with_context(|| format!("cannot make the folder {}", folder.display()))?;
        }
        Ok(method)
    }

    /// Reconstructs with progress, takes the time and writes the notes.
    pub fn solve(
        &self,
        method: &dyn Reconstruction,
        frame: &Frame,
        quiet: bool,
        stats: &mut Stats,
    ) -> Result<Solution> {
        for warning in method.warnings(frame) {
            note!("warning: {warning}");
        }
        let start = Instant::now();
        let bar = progress::bar(quiet);
        let report = |what: &str, share| {
            bar.set_message(what);
            bar.set(share);
        };
        let solution = reconstruct::solve(method, frame, &self.context(&report))?;
        bar.finish();
        stats.seconds.reconstruct = start.elapsed().as_secs_f64();
        self.write_notes(&solution, frame)?;
        Ok(solution)
    }

    /// The context of a reconstruction.
    pub fn context<'a>(&self, progress: &'a dyn Fn(&str, f32)) -> Context<'a> {
        Context { progress, memory: self.max_memory.map(|megabytes| megabytes << 20), notes: self.notes.is_some() }
    }

    /// Writes intermediate images, if they are asked for.
    pub fn write_notes(&self, solution: &Solution, frame: &Frame) -> Result<()> {
        if let Some(folder) = &self.notes {
            if solution.notes.is_empty() {
                note!("warning: the method {} has no intermediate images", self.method);
            }
            for note in &solution.notes {
                let attributes = frame.provenance.attributes();
                let extras = Extras { attributes, window: frame.window, ..Extras::default() };
                io::write_color(&folder.join(format!("{}.exr", note.name)), &note.image, &extras)?;
            }
        }
        Ok(())
    }
}

/// Writes the image to every output, with estimated error, sample counts and the light of groups of emitters where the format has
/// layers, and takes the time; of it all only a part, if that is given. If it cannot be written anywhere, it goes to the folder for
/// temporary files.
pub fn write(
    (args, method, inner): (&Args, &dyn Reconstruction, Option<Crop>),
    outputs: &[PathBuf],
    solution: &Solution,
    frame: &Frame,
    stats: &mut Stats,
) -> Result<()> {
    let start = Instant::now();
    let lights = if outputs.iter().any(|path| io::has_layers(path)) {
        reconstruct::light_groups(method, frame, solution)?
    } else {
        Vec::new()
    };
    stats.seconds.reconstruct += start.elapsed().as_secs_f64();
    let start = Instant::now();
    let shown = |image: &Image| match inner {
        Some(Crop { x, y, width, height }) => image.part((x, y), (width, height)),
        None => image.clone(),
    };
    let error = solution.error.iter().map(|error| ("error".to_owned(), shown(error)));
    let samples = frame.get(Layer::Samples).map(|samples| ("samples".to_owned(), shown(samples)));
    let lights = lights.iter().map(|note| (format!("light.{}", note.name), shown(&note.image)));
    let layers: Vec<_> = error.chain(samples).chain(lights).collect();
    let alpha = solution.alpha.as_ref().or(frame.get(Layer::Alpha)).map(shown);
    let image = shown(&solution.image);
    let extras = Extras {
        alpha: alpha.as_ref(),
        layers: layers.iter().map(|(name, image)| (name.as_str(), image)).collect(),
        attributes: frame.provenance.attributes(),
        window: inner.map(|inner| inner.within(frame.window, (frame.width, frame.height))).or(frame.window),
        exposure: args.exposure,
    };
    let put = |path: &Path| io::write_color(path, &image, &extras);
    let (mut written, mut failed) = (Vec::new(), Vec::new());
    for path in outputs {
        match put(path) {
            Ok(()) => written.push(path.display().to_string()),
            Err(error) => failed.push(error.to_string()),
        }
    }
    stats.seconds.write += start.elapsed().as_secs_f64();
    if failed.is_empty() {
        return Ok(());
    }
    // An image that took hours must not be lost because one disk is full.
    let rescue = std::env::temp_dir().join(format!("fluxion-{}.exr", std::process::id()));
    if written.is_empty() && put(&rescue).is_ok() {
        written.push(rescue.display().to_string());
    }
    let kept = match written.as_slice() {
        [] => "nothing could be written".to_owned(),
        written => format!("the image is in {}", written.join(", ")),
    };
    bail!("{}; {kept}", failed.join("; "))
}
