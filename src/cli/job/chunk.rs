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

/// A job, as `job.json` holds it.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Job {
    format: u32,
    /// Version of the program: samples of the same number are the same in one version only.
    version: String,
    /// Scene files, by absolute paths.
    pub scenes: Vec<PathBuf>,
    /// Samples of every pixel.
    pub spp: u32,
    /// Chunks of every scene.
    pub parts: u32,
    /// Seed of all samples.
    pub seed: u64,
    /// Options of `fluxion render` for all chunks.
    pub options: Vec<String>,
}

/// A part of the samples of a scene.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Chunk {
    /// Number of the scene.
    pub scene: usize,
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

impl Job {
    /// A job of so many chunks a scene. Chunks are of multiples of eight samples, so that bins stay whole.
    pub fn new(scenes: &[PathBuf], (spp, parts): (u32, u32), seed: u64, options: &[String]) -> Result<Self> {
        let most = spp.div_ceil(BINS as u32);
        if parts > most {
            let what = format!("{spp} samples make at most {most} chunks of eight: give --chunks {most} or fewer");
            bail!(Error::Usage(what));
        }
        let absolute = |path: &PathBuf| path.canonicalize().map_err(|error| Error::io(path, error));
        let scenes = scenes.iter().map(absolute).collect::<Result<Vec<_>, _>>()?;
        let version = env!("CARGO_PKG_VERSION").to_owned();
        let job = Self { format: FORMAT, version, scenes, spp, parts, seed, options: options.to_vec() };
        for scene in 0..job.scenes.len() {
            if (0..scene).any(|other| job.name(other) == job.name(scene)) {
                let what = format!("two scenes are called {}: give their files other names", job.name(scene));
                bail!(Error::Usage(what));
            }
        }
        // Options that are wrong are found out before any machine works.
        job.render(&job.chunk(0)?, Path::new("chunk.ckpt"))?.check_merging()?;
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
        if job.parts == 0 || job.scenes.is_empty() || job.spp == 0 {
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
        self.scenes.len() * self.parts as usize
    }

    /// Name of a scene for files.
    pub fn name(&self, scene: usize) -> String {
        load::name(&self.scenes[scene])
    }

    /// A chunk by its number.
    pub fn chunk(&self, number: usize) -> Result<Chunk> {
        if number >= self.chunks() {
            bail!(Error::Usage(format!("there is no chunk {number}: there are {}, from 0 on", self.chunks())));
        }
        let (scene, part) = (number / self.parts as usize, (number % self.parts as usize) as u64);
        let start = |part: u64| {
            let eights = u64::from(self.spp.div_ceil(BINS as u32)) * part / u64::from(self.parts);
            (BINS as u64 * eights).min(u64::from(self.spp)) as u32
        };
        Ok(Chunk { scene, first: start(part), spp: start(part + 1) - start(part) })
    }

    /// The command that renders a chunk into a checkpoint.
    pub fn render(&self, chunk: &Chunk, checkpoint: &Path) -> Result<Box<render::Args>> {
        let Chunk { scene, first, spp } = chunk;
        let own = ["--spp", &spp.to_string(), "--first", &first.to_string(), "--seed", &self.seed.to_string()]
            .map(str::to_owned);
        let scene = self.scenes[*scene].display().to_string();
        let checkpoint = ["--checkpoint".to_owned(), checkpoint.display().to_string(), "--resume".to_owned()];
        let line = ["fluxion".to_owned(), "render".to_owned(), scene].into_iter().chain(own).chain(checkpoint);
        match Args::try_parse_from(line.chain(self.options.iter().cloned())) {
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
