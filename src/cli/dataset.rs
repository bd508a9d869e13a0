//! `fluxion dataset`.

use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::{Context as _, Result, bail};
use clap::builder::{PossibleValue, PossibleValuesParser};
use fluxion::dataset::{self, Layout, Number, Settings};
use fluxion::error::Error;
use fluxion::film::{EdgeNeed, Needs, RECORDED, Recorded};
use fluxion::mitsuba;
use fluxion::reconstruct;

use super::terminal::out;
use super::{progress, statistics};

/// Options of `dataset`.
#[derive(clap::Args)]
pub struct Args {
    /// Scene files, Mitsuba XML; a frame has the name of its file, or of the folder of a scene.xml
    #[arg(required = true, value_name = "SCENE")]
    scenes: Vec<PathBuf>,
    /// Folder for the files
    #[arg(short, long, value_name = "DIR")]
    output: PathBuf,
    /// Numbers of samples per pixel; each includes the samples of those before it
    #[arg(long, value_delimiter = ',', default_value = "2,4,8,16,32,64,128", value_parser = clap::value_parser!(u32).range(1..1 << 24))]
    spp: Vec<u32>,
    /// Samples per pixel of the target, which has another seed
    #[arg(long, default_value_t = 4096, value_name = "SPP", value_parser = clap::value_parser!(u32).range(2..1 << 24))]
    reference: u32,
    /// Method that makes the target, without bias: `primal`, or `l2`, which has less noise
    #[arg(long, default_value = "primal", value_name = "METHOD")]
    target: String,
    /// Method whose image and estimated error are stored, too; may be given again
    #[arg(long = "method", value_name = "NAME[:KEY=VALUE,...]")]
    methods: Vec<String>,
    /// Store the intermediate images of these methods, too, without directly seen emitters
    #[arg(long, requires = "methods")]
    notes: bool,
    /// Statistics to store besides the colour
    #[arg(long, value_delimiter = ',', default_value = Recorded::Features.info().name, value_parser = part_names(), value_name = "WHAT")]
    layers: Vec<String>,
    /// Arrangement of the files
    #[arg(long, default_value = "npy", value_enum)]
    layout: Arrangement,
    /// Store half floats
    #[arg(long)]
    half: bool,
    /// Seed that every scene mixes its own with
    #[arg(long, default_value_t = 0)]
    seed: u64,
    #[command(flatten)]
    options: super::scene::Args,
    /// Keep the frames that are there, of the same settings, and make the rest
    #[arg(long)]
    resume: bool,
}

/// Names of what can be stored beside the statistics of the table.
const COLOR: &str = "color";
const GRADIENTS: &str = "gradients";

fn part_names() -> PossibleValuesParser {
    let others = [(COLOR, "nothing else"), (GRADIENTS, "differences to the neighbouring pixels")];
    let others = others.map(|(name, help)| PossibleValue::new(name).help(help));
    others.into_iter().chain(statistics::names()).collect::<Vec<_>>().into()
}

/// Names of the layouts.
#[derive(Clone, Copy, clap::ValueEnum)]
enum Arrangement {
    /// NumPy arrays of height, width and channels, a JSON beside them.
    Npy,
    /// EXR images as the training of Open Image Denoise takes them.
    Oidn,
}

impl Args {
    fn settings(&self) -> Result<Settings> {
        let (mut spp, has) = (self.spp.clone(), |name: &str| self.layers.iter().any(|part| part == name));
        spp.sort_unstable();
        spp.dedup();
        for method in self.methods.iter().chain([&self.target]) {
            reconstruct::parse(method)?;
        }
        if !self.reference.is_multiple_of(2) {
            bail!(Error::Usage("--reference is of two halves: give it an even number".into()));
        }
        let layout = match self.layout {
            Arrangement::Npy => Layout::Npy,
            Arrangement::Oidn => Layout::Oidn,
        };
        if layout == Layout::Oidn && (self.notes || self.layers != [Recorded::Features.info().name]) {
            bail!(Error::Usage("--layout oidn has albedo and normal only: leave --layers and --notes out".into()));
        }
        let columns: Vec<_> = self.methods.iter().map(|method| dataset::column(method)).collect();
        if let Some(k) = repeated(&columns) {
            bail!(Error::Usage(format!("--method {} would have the names of another one's images", self.methods[k])));
        }
        let edges = if has(GRADIENTS) { EdgeNeed::Sampled } else { EdgeNeed::Off };
        let layers =
            RECORDED.iter().fold(Needs { edges, ..Needs::NONE }, |needs, row| needs.with_if(row.id, has(row.name)));
        Ok(Settings {
            spp,
            reference: self.reference,
            target: self.target.clone(),
            methods: self.methods.clone(),
            notes: self.notes,
            layers,
            scene_options: self.options.as_text(),
            layout,
            number: if self.half { Number::Float16 } else { Number::Float32 },
            seed: self.seed,
        })
    }
}

/// Renders frame after frame.
pub fn run(args: &Args) -> Result<ExitCode> {
    let settings = args.settings()?;
    let folder = &args.output;
    std::fs::create_dir_all(folder).with_context(|| format!("cannot make the folder {}", folder.display()))?;
    let mut names: Vec<_> = args.scenes.iter().map(|path| mitsuba::name(path)).collect();
    if settings.layout == Layout::Oidn {
        // What follows the first underscore is the kind of image there.
        names.iter_mut().for_each(|name| *name = name.replace('_', "-"));
    }
    let mut due = Vec::new();
    if let Some(k) = repeated(&names) {
        bail!(Error::Usage(format!("two scenes would be the frame {}: give their files other names", names[k])));
    }
    for (k, name) in names.iter().enumerate() {
        let there = dataset::is_there(folder, name, &settings)?;
        if there && !args.resume {
            bail!(Error::Usage(format!("{} has the frame {name}: keep it with --resume", folder.display())));
        }
        due.extend((!there).then_some(k));
    }
    let (stop, bar) = (super::interrupt::stop_on_signal()?, progress::bar());
    let (mut there, total) = (names.len() - due.len(), due.len() as f32);
    for (done, &k) in due.iter().enumerate() {
        bar.set_message(&names[k]);
        let report = |share| bar.set((done as f32 + share) / total);
        report(0.0);
        let scene = super::scene::load(&args.scenes[k], &args.options.options())?;
        let frame = (folder.as_path(), names[k].as_str());
        if !dataset::make((&scene, &args.scenes[k]), frame, &settings, stop, &report)? {
            break;
        }
        there += 1;
    }
    bar.finish();
    out!("{}: {there} of {} frames", folder.display(), names.len())?;
    Ok(ExitCode::SUCCESS)
}

/// The first of some names that was there before.
fn repeated(names: &[String]) -> Option<usize> {
    (0..names.len()).find(|&k| names[..k].contains(&names[k]))
}
