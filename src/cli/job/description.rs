//! The plan of a job, as `job.json` holds it, and what its second round has been allocated.

use std::path::{Path, PathBuf};

use anyhow::{Result, bail};
use fluxion::adaptive::{self, Allocator};
use fluxion::error::Error;
use fluxion::files;
use fluxion::film::BINS;
use fluxion::scene::load;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Version of the format of `job.json`.
const FORMAT: u32 = 1;

/// Least digits of a frame's number in names.
const DIGITS: usize = 4;

/// A job, as `job.json` holds it.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
pub struct Job {
    format: u32,
    /// Version of the program: samples of the same number are the same in one version only.
    version: String,
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
    /// Seed of all samples.
    pub seed: u64,
    /// Options of `fluxion render` for all chunks.
    pub options: Vec<String>,
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
    /// Seed of all samples.
    pub seed: u64,
    /// Name of the allocator that allocates the samples of a second round, if there are two.
    pub adaptive: Option<&'a str>,
    /// Options of `fluxion render`.
    pub options: &'a [String],
}

impl FirstRound {
    /// The first round of a job of so many samples and chunks an image: its chunks have about as many samples as those of the second.
    fn new(allocator: &str, spp: u32, chunks: u32) -> Result<Self> {
        let first = adaptive::first_round(spp);
        if chunks < 2 || first >= spp {
            let what = format!("two rounds take --chunks 2 and more than {first} samples a pixel, or more");
            bail!(Error::Usage(what));
        }
        let share = u64::from(chunks) * u64::from(first) / u64::from(spp);
        let chunks = (share as u32).clamp(1, first / BINS as u32);
        Ok(Self { allocator: allocator.to_owned(), spp: first, chunks })
    }

    /// The allocator that allocates the second round.
    pub fn allocator(&self) -> Result<&'static dyn Allocator> {
        Ok(adaptive::allocator(&self.allocator)?)
    }
}

impl Job {
    /// A job of so many chunks an image. Chunks are of multiples of eight samples, so that bins stay whole. The scenes of all images
    /// are loaded: what is wrong with them, or with the options, is found out before any machine works.
    pub fn new(settings: &Settings) -> Result<Self> {
        let Settings { frames, spp, chunks: parts, seed, .. } = *settings;
        let most = spp.div_ceil(BINS as u32);
        if parts > most {
            let what = format!("{spp} samples make at most {most} chunks of eight: give --chunks {most} or fewer");
            bail!(Error::Usage(what));
        }
        let absolute = |path: &PathBuf| path.canonicalize().map_err(|error| Error::io(path, error));
        let scenes = settings.scenes.iter().map(absolute).collect::<Result<Vec<_>, _>>()?;
        for (k, scene) in scenes.iter().enumerate() {
            let name = load::name(scene);
            if scenes[..k].iter().any(|other| load::name(other) == name) {
                bail!(Error::Usage(format!("two scenes are called {name}: give their files other names")));
            }
        }
        let adaptive = settings.adaptive.map(|allocator| FirstRound::new(allocator, spp, parts)).transpose()?;
        let (version, options) = (env!("CARGO_PKG_VERSION").to_owned(), settings.options.to_vec());
        let (folder, contents, allocated) = (settings.folder.to_path_buf(), Vec::new(), None);
        let mut job = Self {
            format: FORMAT,
            version,
            scenes,
            frames,
            contents,
            spp,
            parts,
            seed,
            options,
            adaptive,
            folder,
            allocated,
        };
        for image in 0..job.images() {
            let Some(chunk) = job.chunk(job.first_round(image).start)? else { continue };
            let render = job.render(&chunk, Path::new("chunk.ckpt"))?;
            render.check_chunk()?;
            if let Some(first) = &job.adaptive {
                render.check_allocator(first.allocator()?)?;
            }
            job.contents.push(render.content()?);
        }
        Ok(job)
    }

    /// Reads the plan in a folder.
    pub fn load(folder: &Path) -> Result<Self> {
        let path = folder.join("job.json");
        let text = std::fs::read_to_string(&path).map_err(|error| Error::io(&path, error))?;
        let mut job: Self = serde_json::from_str(&text).map_err(|error| Error::bad_data(&path, error))?;
        if (job.format, job.version.as_str()) != (FORMAT, env!("CARGO_PKG_VERSION")) {
            bail!(Error::mismatch(
                &path,
                format!("is of fluxion {}, whose samples are others: plan anew", job.version)
            ));
        }
        if job.parts == 0 || job.spp == 0 || job.images() == 0 || job.contents.len() != job.images() {
            bail!(Error::mismatch(&path, "has no chunks"));
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
                bail!(Error::mismatch(&path, "is of another job"));
            }
            job.allocated = Some(allocated);
        }
        Ok(job)
    }

    /// Writes the plan into its folder.
    pub fn save(&self) -> Result<()> {
        let text = serde_json::to_string_pretty(self)?;
        Ok(files::write(&self.folder.join("job.json"), text + "\n")?)
    }

    /// Writes the numbers of samples that divide the second rounds of all images.
    pub fn allocate(&self, bounds: &[Vec<u32>]) -> Result<()> {
        Ok(files::write(&self.allocation(), serde_json::to_string(bounds)? + "\n")?)
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
            (scene, None) => load::name(scene),
            (scene, Some(frame)) => format!("{}_{frame:0DIGITS$}", load::name(scene)),
        }
    }

    /// File of the sample counts that an image's pixels are to have.
    pub fn goals(&self, image: usize) -> PathBuf {
        self.folder.join(format!("{}.goals.exr", self.name(image)))
    }
}
