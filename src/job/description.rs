//! The plan of a job, as `job.json` holds it, and what its second round has been allocated.

use std::path::{Path, PathBuf};
use std::time::Duration;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::schedulers;
use crate::adaptive::{self, Allocator};
use crate::error::{Error, Result};
use crate::files;
use crate::film::BINS;
use crate::mitsuba;
use crate::neighbours::Selector;
use crate::pipeline::{Outputs, Recipe};
use crate::render::EPOCH;

/// Version of the format of `job.json`.
const FORMAT: u32 = 2;

/// Name of the plan's file.
const FILE: &str = "job.json";

/// Least digits of a frame's number in names.
const DIGITS: usize = 4;

/// A job, as `job.json` holds it.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
pub struct Job {
    format: u32,
    /// Version of the program.
    version: String,
    /// [`EPOCH`] of the samples.
    epoch: u32,
    /// Scene files, by absolute paths.
    scenes: Vec<PathBuf>,
    /// First and last of the frames of every scene: each is an image, of the scene with `-D frame=NUMBER`.
    #[serde(default)]
    frames: Option<(u32, u32)>,
    /// Checksums of the scenes of all images and of the files that they name.
    pub contents: Vec<String>,
    /// Samples of every pixel.
    pub spp: u32,
    /// Chunks of every image.
    pub parts: u32,
    /// Recipe of all chunks, which differ by the numbers of their samples.
    pub recipe: Recipe,
    /// Time between checkpoints.
    pub checkpoint_every: Duration,
    /// The first of two rounds, by whose samples those of the second are allocated.
    #[serde(default)]
    pub adaptive: Option<FirstRound>,
    /// Folder of the job.
    #[serde(skip)]
    pub folder: PathBuf,
    /// Numbers of samples that divide the second round of every image into chunks, once they are allocated.
    #[serde(skip)]
    pub allocated: Option<Vec<Vec<u32>>>,
}

/// The round of even samples of an adaptive job.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
pub struct FirstRound {
    /// Name of the allocator that allocates the second round.
    allocator: String,
    /// Samples of every pixel.
    pub spp: u32,
    /// Chunks of every image.
    pub chunks: u32,
}

/// The part of a plan that says whether it can be read.
#[derive(Deserialize)]
struct Known {
    format: u32,
    version: String,
    #[serde(default)]
    epoch: u32,
}

/// Fails if a folder has a job already.
fn check_folder(folder: &Path) -> Result<()> {
    let what = || format!("{} has a job already: take another folder", folder.display());
    if folder.join(FILE).exists() { Err(Error::Usage(what())) } else { Ok(()) }
}

/// Fails if a recipe is not one of a chunk, whose film is merged with others and has the samples that its plan says.
fn check(recipe: &Recipe) -> Result<()> {
    let refused = |what: String| Err(Error::Usage(what));
    let Recipe { limits, allocator, goals, kernel, outputs, .. } = recipe;
    if allocator.is_some() || limits.error.is_some() || limits.time.is_some() || goals.is_some() {
        let what = "chunks cannot say how many samples they take: give --adaptive before the --, and neither --target-error nor --goals";
        return refused(what.into());
    }
    if Selector::parse(kernel, recipe.pilot)?.pilot() > 0 {
        return refused(format!("chunks cannot choose neighbours by pilots of their own: not --kernel {kernel}"));
    }
    if *outputs != Outputs::default() {
        return refused("chunks write checkpoints only: `fluxion job merge` makes the images of them".into());
    }
    Ok(())
}

/// Everything that decides a job.
pub struct Settings<'a> {
    /// Folder of the job.
    pub folder: &'a Path,
    /// Scene files.
    pub scenes: &'a [PathBuf],
    /// First and last of the frames, if there are several.
    pub frames: Option<(u32, u32)>,
    /// Samples of every pixel.
    pub spp: u32,
    /// Chunks of every image.
    pub chunks: u32,
    /// Name of the allocator that allocates the samples of a second round, if there are two.
    pub adaptive: Option<&'a str>,
    /// Recipe of all chunks; its samples are those of the job.
    pub recipe: &'a Recipe,
    /// Time between checkpoints.
    pub checkpoint_every: Duration,
}

impl FirstRound {
    /// The first round of a job of so many samples and chunks an image: its chunks have about as many samples as those of the second.
    fn new(allocator: &str, spp: u32, chunks: u32) -> Result<Self> {
        let first = adaptive::first_round(spp);
        if chunks < 2 || first >= spp {
            let what = format!("two rounds take --chunks 2 and more than {first} samples a pixel, or more");
            return Err(Error::Usage(what));
        }
        let share = u64::from(chunks) * u64::from(first) / u64::from(spp);
        let chunks = (share as u32).clamp(1, first / BINS as u32);
        Ok(Self { allocator: allocator.to_owned(), spp: first, chunks })
    }

    /// The allocator that allocates the second round.
    pub fn allocator(&self) -> Result<&'static dyn Allocator> {
        adaptive::allocator(&self.allocator)
    }
}

impl Job {
    /// A job in chunks. Chunks are of multiples of eight samples, so that bins stay whole. The scenes of all images
    /// are loaded: what is wrong with them, or with the options, is found out before any machine works.
    pub fn new(settings: &Settings, warn: &dyn Fn(&str)) -> Result<Self> {
        check_folder(settings.folder)?;
        let Settings { frames, spp, chunks: parts, checkpoint_every, .. } = *settings;
        let most = spp.div_ceil(BINS as u32);
        if parts > most {
            let what = format!("{spp} samples make at most {most} chunks of eight: give --chunks {most} or fewer");
            return Err(Error::Usage(what));
        }
        let absolute = |path: &PathBuf| path.canonicalize().map_err(|error| Error::io(path, error));
        let scenes = settings.scenes.iter().map(absolute).collect::<Result<Vec<_>, _>>()?;
        for (k, scene) in scenes.iter().enumerate() {
            let name = mitsuba::name(scene);
            if scenes[..k].iter().any(|other| mitsuba::name(other) == name) {
                let what = format!("two scenes are called {name}: give their files other names");
                return Err(Error::Usage(what));
            }
        }
        check(settings.recipe)?;
        let mut job = Self {
            format: FORMAT,
            version: env!("CARGO_PKG_VERSION").to_owned(),
            epoch: EPOCH,
            scenes,
            frames,
            contents: Vec::new(),
            spp,
            parts,
            recipe: settings.recipe.clone(),
            checkpoint_every,
            adaptive: settings.adaptive.map(|allocator| FirstRound::new(allocator, spp, parts)).transpose()?,
            folder: settings.folder.to_path_buf(),
            allocated: None,
        };
        for image in 0..job.images() {
            let Some(chunk) = job.chunk(job.first_round(image).start)? else { continue };
            let (recipe, file) = (job.recipe(&chunk), job.image(image).0);
            let scene = recipe.load(file)?;
            let prepared = recipe.prepare(&scene, file)?;
            scene.warnings().iter().chain(&prepared.warnings).for_each(|warning| warn(warning));
            if let Some(first) = &job.adaptive {
                adaptive::check(&*prepared.method.made, first.allocator()?.needs_error())?;
            }
            job.contents.push(prepared.origin()?.content);
        }
        Ok(job)
    }

    /// Makes the folder, with the plan and what hands its chunks to schedulers, with `options` of `fluxion job run`. The error says that the
    /// folder has a job already.
    pub fn create(&self, options: &[String]) -> Result<()> {
        let folder = &self.folder;
        check_folder(folder)?;
        let failed = |error| Error::io(folder, format!("cannot be made: {error}"));
        std::fs::create_dir_all(folder).map_err(failed)?;
        let absolute = folder.canonicalize().map_err(|error| Error::io(folder, error))?;
        schedulers::write(folder, &absolute, &self.rounds(), options)?;
        let text = serde_json::to_string_pretty(self).map_err(|error| Error::backend("json", error))?;
        files::write(&folder.join(FILE), text + "\n")
    }

    /// Reads the plan in a folder.
    pub fn load(folder: &Path) -> Result<Self> {
        let path = folder.join(FILE);
        let text = std::fs::read_to_string(&path).map_err(|error| Error::io(&path, error))?;
        let known: Known = serde_json::from_str(&text).map_err(|error| Error::bad_data(&path, error))?;
        if (known.format, known.epoch) != (FORMAT, EPOCH) {
            let what =
                format!("is of fluxion {}, epoch {}, whose samples are others: plan anew", known.version, known.epoch);
            return Err(Error::mismatch(&path, what));
        }
        let mut job: Self = serde_json::from_str(&text).map_err(|error| Error::bad_data(&path, error))?;
        if job.parts == 0 || job.spp == 0 || job.images() == 0 || job.contents.len() != job.images() {
            return Err(Error::mismatch(&path, "has no chunks"));
        }
        job.folder = folder.to_path_buf();
        let path = job.allocation();
        if path.exists() {
            let text = std::fs::read_to_string(&path).map_err(|error| Error::io(&path, error))?;
            let allocated: Vec<Vec<u32>> =
                serde_json::from_str(&text).map_err(|error| Error::bad_data(&path, error))?;
            let second = job.second_chunks() as usize;
            if allocated.len() != job.images()
                || allocated.iter().any(|bounds| bounds.len() != second + 1 || !bounds.is_sorted())
            {
                return Err(Error::mismatch(&path, "is of another job"));
            }
            job.allocated = Some(allocated);
        }
        Ok(job)
    }

    /// Writes the numbers of samples that divide the second rounds of all images.
    pub(super) fn save_allocation(&self, bounds: &[Vec<u32>]) -> Result<()> {
        let text = serde_json::to_string(bounds).map_err(|error| Error::backend("json", error))?;
        files::write(&self.allocation(), text + "\n")
    }

    /// File of the second round's division.
    fn allocation(&self) -> PathBuf {
        self.folder.join("allocated.json")
    }

    /// Number of images: frame after frame of one scene after the other.
    pub fn images(&self) -> usize {
        self.scenes.len() * self.frames_per_scene()
    }

    fn frames_per_scene(&self) -> usize {
        self.frames.map_or(1, |(first, last)| last.checked_sub(first).map_or(0, |more| more as usize + 1))
    }

    /// The scene of an image, and the number of the frame if there are several.
    pub fn image(&self, image: usize) -> (&Path, Option<u32>) {
        let (scene, frame) = (image / self.frames_per_scene(), (image % self.frames_per_scene()) as u32);
        (&self.scenes[scene], self.frames.map(|(first, _)| first + frame))
    }

    /// Name of an image for files.
    pub fn name(&self, image: usize) -> String {
        match self.image(image) {
            (scene, None) => mitsuba::name(scene),
            (scene, Some(frame)) => format!("{}_{frame:0DIGITS$}", mitsuba::name(scene)),
        }
    }

    /// File of the sample counts that an image's pixels are to have.
    pub fn goals(&self, image: usize) -> PathBuf {
        self.folder.join(format!("{}.goals.exr", self.name(image)))
    }
}
