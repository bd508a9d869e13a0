//! The plan of a job, and its chunks: consecutive samples of one seed of a scene. Chunks of an adaptive job are of two rounds: those of the
//! second follow those of the first of all images, and are known when these have been dealt.

use std::ops::Range;
use std::path::{Path, PathBuf};

use anyhow::{Result, bail};
use clap::Parser;
use fluxion::adaptive::{self, Allocator};
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
    /// The first of two rounds, by whose samples those of the second are dealt.
    #[serde(default)]
    adaptive: Option<FirstRound>,
    /// Folder of the job.
    #[serde(skip)]
    folder: PathBuf,
    /// Of every image, the numbers of samples that divide the second round into chunks, once they are dealt.
    #[serde(skip)]
    dealt: Option<Vec<Vec<u32>>>,
}

/// The round of even samples of an adaptive job.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct FirstRound {
    /// Name of the allocator that deals the second round.
    allocator: String,
    /// Samples of every pixel.
    pub spp: u32,
    /// Chunks of every image.
    chunks: u32,
}

/// A part of the samples of an image.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Chunk {
    /// Number of the image.
    pub image: usize,
    /// Number of the first sample of every pixel.
    pub first: u32,
    /// Samples of every pixel, or the most in a second round.
    pub spp: u32,
    /// Whether the pixels' goals say how many.
    dealt: bool,
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
    /// Its samples are not dealt yet.
    Waiting,
    /// The file of a complete chunk is damaged, or not of this chunk.
    Wrong,
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
    /// Name of the allocator that deals the samples of a second round, if there are two.
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

    /// The allocator that deals the second round.
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
        let (folder, contents, dealt) = (settings.folder.to_path_buf(), Vec::new(), None);
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
            dealt,
        };
        for image in 0..job.images() {
            let Some(chunk) = job.chunk(job.first_round(image).start)? else { continue };
            let render = job.render(&chunk, Path::new("chunk.ckpt"))?;
            render.check_merging()?;
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
        let path = job.dealing();
        if path.exists() {
            let text = std::fs::read_to_string(&path).map_err(|error| Error::io(&path, error))?;
            let dealt: Vec<Vec<u32>> = serde_json::from_str(&text).map_err(|error| Error::bad_data(&path, error))?;
            let second = job.second_chunks() as usize;
            if dealt.len() != job.images()
                || dealt.iter().any(|bounds| bounds.len() != second + 1 || !bounds.is_sorted())
            {
                bail!(Error::mismatch(&path, "is of another job"));
            }
            job.dealt = Some(dealt);
        }
        Ok(job)
    }

    /// Writes the plan into its folder.
    pub fn save(&self) -> Result<()> {
        let text = serde_json::to_string_pretty(self)?;
        Ok(files::write(&self.folder.join("job.json"), text + "\n")?)
    }

    /// Writes the numbers of samples that divide the second rounds of all images.
    pub fn deal(&self, bounds: &[Vec<u32>]) -> Result<()> {
        Ok(files::write(&self.dealing(), serde_json::to_string(bounds)? + "\n")?)
    }

    /// File of the second round's division.
    fn dealing(&self) -> PathBuf {
        self.folder.join("dealt.json")
    }

    /// The first of two rounds, if there are two.
    pub fn adaptive(&self) -> Option<&FirstRound> {
        self.adaptive.as_ref()
    }

    /// Whether the samples of the second round are known.
    pub fn is_dealt(&self) -> bool {
        self.dealt.is_some()
    }

    /// Chunks of every image in the first round.
    fn first_chunks(&self) -> u32 {
        self.adaptive.as_ref().map_or(self.parts, |first| first.chunks)
    }

    /// Chunks of every image in the second round.
    pub fn second_chunks(&self) -> u32 {
        self.parts.saturating_sub(self.first_chunks())
    }

    /// Numbers of an image's chunks in the first round.
    pub fn first_round(&self, image: usize) -> Range<usize> {
        let chunks = self.first_chunks() as usize;
        image * chunks..(image + 1) * chunks
    }

    /// Numbers of an image's chunks in the second round.
    pub fn second_round(&self, image: usize) -> Range<usize> {
        let (before, chunks) = (self.first_round(self.images()).start, self.second_chunks() as usize);
        before + image * chunks..before + (image + 1) * chunks
    }

    /// Numbers of all chunks in the first round, and in the second.
    pub fn rounds(&self) -> [Range<usize>; 2] {
        let last = self.images().saturating_sub(1);
        [0..self.first_round(last).end, self.second_round(0).start..self.second_round(last).end]
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

    /// A chunk by its number, unless it is not dealt yet.
    pub fn chunk(&self, number: usize) -> Result<Option<Chunk>> {
        let [first, second] = self.rounds();
        if second.contains(&number) {
            let chunks = self.second_chunks() as usize;
            let (image, part) = ((number - second.start) / chunks, (number - second.start) % chunks);
            let bounds = self.dealt.as_ref().map(|dealt| (dealt[image][part], dealt[image][part + 1]));
            return Ok(bounds.map(|(start, end)| Chunk { image, first: start, spp: end - start, dealt: true }));
        }
        if !first.contains(&number) {
            bail!(Error::Usage(format!("there is no chunk {number}: there are {}, from 0 on", self.chunks())));
        }
        let (spp, chunks) = (self.adaptive.as_ref().map_or(self.spp, |first| first.spp), self.first_chunks());
        let (image, part) = (number / chunks as usize, (number % chunks as usize) as u64);
        let start = |part: u64| {
            let eights = u64::from(spp.div_ceil(BINS as u32)) * part / u64::from(chunks);
            (BINS as u64 * eights).min(u64::from(spp)) as u32
        };
        Ok(Some(Chunk { image, first: start(part), spp: start(part + 1) - start(part), dealt: false }))
    }

    /// The command that renders a chunk into a checkpoint.
    pub fn render(&self, chunk: &Chunk, checkpoint: &Path) -> Result<Box<render::Args>> {
        let &Chunk { image, first, spp, dealt } = chunk;
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
        line.extend(dealt.then(|| option("--goals", self.goals(image).display().to_string())).into_iter().flatten());
        line.extend(self.options.iter().cloned());
        match Args::try_parse_from(line) {
            Ok(Args { command: Command::Render(args), .. }) => Ok(args),
            Ok(_) => bail!(Error::Usage("options of the chunks are those of `fluxion render`".into())),
            Err(error) => bail!(Error::Usage(format!("options of the chunks: {error}"))),
        }
    }
    /// File of the sample counts that an image's pixels are to have.
    pub fn goals(&self, image: usize) -> PathBuf {
        self.folder.join(format!("{}.goals.exr", self.name(image)))
    }

    /// The checkpoint of a complete chunk.
    pub fn complete(&self, number: usize) -> PathBuf {
        self.folder.join(format!("{number:04}.ckpt"))
    }

    /// The checkpoint of a chunk that is not complete.
    pub fn unfinished(&self, number: usize) -> PathBuf {
        self.folder.join(format!("{number:04}.part.ckpt"))
    }

    /// State of a chunk, by the headers of its files, or by all of their bytes.
    pub fn state(&self, number: usize, verify: bool) -> Result<State> {
        let Some(chunk) = self.chunk(number)? else { return Ok(State::Waiting) };
        let path = self.complete(number);
        if chunk.spp == 0 {
            return Ok(State::Complete);
        }
        if !path.exists() {
            return Ok(if self.unfinished(number).exists() { State::Started } else { State::Missing });
        }
        let fits = |found: checkpoint::Summary| matches!(found.origin.runs.as_slice(), [run] if (run.seed, run.first, run.samples) == (self.seed, chunk.first, chunk.spp));
        let whole = checkpoint::summary(&path).is_ok_and(fits) && (!verify || checkpoint::verify(&path).is_ok());
        Ok(if whole { State::Complete } else { State::Wrong })
    }

    /// The films of some chunks that are complete, and the numbers of those that are not.
    pub fn films(&self, numbers: impl IntoIterator<Item = usize>) -> Result<(Vec<PathBuf>, Vec<usize>)> {
        let (mut films, mut left) = (Vec::new(), Vec::new());
        for number in numbers {
            match self.state(number, false)? {
                State::Complete => films.extend(Some(self.complete(number)).filter(|path| path.exists())),
                _ => left.push(number),
            }
        }
        Ok((films, left))
    }
}
