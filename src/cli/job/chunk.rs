//! The plan of a job, and its chunks: consecutive samples of one seed of a scene.

use std::path::{Path, PathBuf};

use anyhow::{Result, bail};
use clap::Parser;
use fluxion::checkpoint;
use fluxion::error::Error;
use fluxion::files;
use fluxion::film::BINS;
use fluxion::scene::load;
use serde::{Deserialize, Serialize};

use crate::cli::{Args, Command, render};

/// Version of the format of `job.json`.
const FORMAT: u32 = 1;

/// Least digits of a frame's number in names.
const DIGITS: usize = 4;

/// A job, as `job.json` holds it.
#[derive(Clone, Debug, Serialize, Deserialize)]
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
    contents: Vec<String>,
    /// Samples of every pixel.
    pub spp: u32,
    /// Chunks of every image.
    pub parts: u32,
    /// Seed of all samples.
    pub seed: u64,
    /// Options of `fluxion render` for all chunks.
    pub options: Vec<String>,
}

/// A part of the samples of an image.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Chunk {
    /// Number of the image.
    pub image: usize,
    /// Number of the first sample of every pixel.
    pub first: u32,
    /// Samples of every pixel.
    pub spp: u32,
}

/// State of a chunk's files.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum State {
    /// All samples are there.
    Complete,
    /// Some samples are there.
    Started,
    /// There is nothing.
    Missing,
    /// The file of a complete chunk is damaged, or not of this chunk.
    Wrong,
}

/// Everything that decides a job.
pub struct Settings<'a> {
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
    /// Options of `fluxion render`.
    pub options: &'a [String],
}

impl Job {
    /// A job of so many chunks an image. Chunks are of multiples of eight samples, so that bins stay whole. The scenes of all images
    /// are loaded: what is wrong with them, or with the options, is found out before any machine works.
    pub fn new(settings: &Settings) -> Result<Self> {
        let Settings { frames, spp, seed, .. } = *settings;
        let most = spp.div_ceil(BINS as u32);
        if settings.chunks > most {
            let what = format!("{spp} samples make at most {most} chunks of eight: give --chunks {most} or fewer");
            bail!(Error::Usage(what));
        }
        let absolute = |path: &PathBuf| path.canonicalize().map_err(|error| Error::io(path, error));
        let scenes = settings.scenes.iter().map(absolute).collect::<Result<Vec<_>, _>>()?;
        let (version, options) = (env!("CARGO_PKG_VERSION").to_owned(), settings.options.to_vec());
        let contents = Vec::new();
        let mut job =
            Self { format: FORMAT, version, scenes, frames, contents, spp, parts: settings.chunks, seed, options };
        for scene in 0..job.scenes.len() {
            let name = load::name(&job.scenes[scene]);
            if job.scenes[..scene].iter().any(|other| load::name(other) == name) {
                bail!(Error::Usage(format!("two scenes are called {name}: give their files other names")));
            }
        }
        for image in 0..job.images() {
            let render = job.render(&job.chunk(image * job.parts as usize)?, Path::new("chunk.ckpt"))?;
            render.check_merging()?;
            job.contents.push(render.content()?);
        }
        Ok(job)
    }

    /// Reads the plan in a folder.
    pub fn load(folder: &Path) -> Result<Self> {
        let path = folder.join("job.json");
        let text = std::fs::read_to_string(&path).map_err(|error| Error::io(&path, error))?;
        let job: Self = serde_json::from_str(&text).map_err(|error| Error::bad_data(&path, error))?;
        if (job.format, job.version.as_str()) != (FORMAT, env!("CARGO_PKG_VERSION")) {
            bail!(Error::mismatch(
                &path,
                format!("is of fluxion {}, whose samples are others: plan anew", job.version)
            ));
        }
        if job.parts == 0 || job.spp == 0 || job.images() == 0 || job.contents.len() != job.images() {
            bail!(Error::mismatch(&path, "has no chunks"));
        }
        Ok(job)
    }

    /// Writes the plan into a folder.
    pub fn save(&self, folder: &Path) -> Result<()> {
        let text = serde_json::to_string_pretty(self)?;
        Ok(files::write(&folder.join("job.json"), text + "\n")?)
    }

    /// Number of chunks.
    pub fn chunks(&self) -> usize {
        self.images() * self.parts as usize
    }

    /// Number of images: frame after frame of one scene after the other.
    pub fn images(&self) -> usize {
        self.scenes.len() * self.frames_per_scene()
    }

    fn frames_per_scene(&self) -> usize {
        self.frames.map_or(1, |(first, last)| last.checked_sub(first).map_or(0, |more| more as usize + 1))
    }

    /// The scene of an image, and the number of the frame if there are several.
    fn image(&self, image: usize) -> (&Path, Option<u32>) {
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

    /// A chunk by its number.
    pub fn chunk(&self, number: usize) -> Result<Chunk> {
        if number >= self.chunks() {
            bail!(Error::Usage(format!("there is no chunk {number}: there are {}, from 0 on", self.chunks())));
        }
        let (image, part) = (number / self.parts as usize, (number % self.parts as usize) as u64);
        let start = |part: u64| {
            let eights = u64::from(self.spp.div_ceil(BINS as u32)) * part / u64::from(self.parts);
            (BINS as u64 * eights).min(u64::from(self.spp)) as u32
        };
        Ok(Chunk { image, first: start(part), spp: start(part + 1) - start(part) })
    }

    /// The command that renders a chunk into a checkpoint.
    pub fn render(&self, chunk: &Chunk, checkpoint: &Path) -> Result<Box<render::Args>> {
        let &Chunk { image, first, spp } = chunk;
        let (scene, frame) = self.image(image);
        let option = |name: &str, value: String| [name.to_owned(), value];
        let mut line = vec!["fluxion".to_owned(), "render".to_owned(), scene.display().to_string()];
        line.extend(option("--spp", spp.to_string()));
        line.extend(option("--first", first.to_string()));
        line.extend(option("--seed", self.seed.to_string()));
        line.extend(option("--checkpoint", checkpoint.display().to_string()));
        line.push("--resume".to_owned());
        line.extend(frame.into_iter().flat_map(|frame| option("-D", format!("frame={frame}"))));
        line.extend(self.contents.get(image).into_iter().flat_map(|known| option("--content", known.clone())));
        line.extend(self.options.iter().cloned());
        match Args::try_parse_from(line) {
            Ok(Args { command: Command::Render(args), .. }) => Ok(args),
            Ok(_) => bail!(Error::Usage("options of the chunks are those of `fluxion render`".into())),
            Err(error) => bail!(Error::Usage(format!("options of the chunks: {error}"))),
        }
    }
}

/// The checkpoint of a complete chunk.
pub fn complete(folder: &Path, number: usize) -> PathBuf {
    folder.join(format!("{number:04}.ckpt"))
}

/// The checkpoint of a chunk that is not complete.
pub fn unfinished(folder: &Path, number: usize) -> PathBuf {
    folder.join(format!("{number:04}.part.ckpt"))
}

/// State of a chunk, by the headers of its files, or by all of their bytes.
pub fn state(job: &Job, folder: &Path, number: usize, verify: bool) -> Result<State> {
    let (chunk, path) = (job.chunk(number)?, complete(folder, number));
    if !path.exists() {
        return Ok(if unfinished(folder, number).exists() { State::Started } else { State::Missing });
    }
    let fits = |found: checkpoint::Summary| matches!(found.origin.runs.as_slice(), [run] if (run.seed, run.first, run.samples) == (job.seed, chunk.first, chunk.spp));
    let whole = checkpoint::summary(&path).is_ok_and(fits) && (!verify || checkpoint::verify(&path).is_ok());
    Ok(if whole { State::Complete } else { State::Wrong })
}
