//! Chunks of a job: consecutive samples of one seed of an image, and their files. Chunks of an adaptive job are of two rounds: those of the
//! second follow those of the first of all images, and are known when these have been allocated.

use std::ops::Range;
use std::path::PathBuf;

use serde::Serialize;

use super::description::Job;
use crate::checkpoint;
use crate::error::{Error, Result};
use crate::film::BINS;
use crate::pipeline::Recipe;

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
    allocated: bool,
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
    /// Its samples are not allocated yet.
    Waiting,
    /// The file of a complete chunk is damaged, or not of this chunk.
    Wrong,
}

impl Job {
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

    /// A chunk by its number, unless it is not allocated yet.
    pub fn chunk(&self, number: usize) -> Result<Option<Chunk>> {
        let [first, second] = self.rounds();
        if second.contains(&number) {
            let chunks = self.second_chunks() as usize;
            let (image, part) = ((number - second.start) / chunks, (number - second.start) % chunks);
            let bounds = self.allocated.as_ref().map(|allocated| (allocated[image][part], allocated[image][part + 1]));
            return Ok(bounds.map(|(start, end)| Chunk { image, first: start, spp: end - start, allocated: true }));
        }
        if !first.contains(&number) {
            let what = format!("there is no chunk {number}: there are {}, from 0 on", self.chunks());
            return Err(Error::Usage(what));
        }
        let (spp, chunks) = (self.adaptive.as_ref().map_or(self.spp, |first| first.spp), self.first_chunks());
        let (image, part) = (number / chunks as usize, (number % chunks as usize) as u64);
        let start = |part: u64| {
            let eights = u64::from(spp.div_ceil(BINS as u32)) * part / u64::from(chunks);
            (BINS as u64 * eights).min(u64::from(spp)) as u32
        };
        Ok(Some(Chunk { image, first: start(part), spp: start(part + 1) - start(part), allocated: false }))
    }

    /// The recipe of a chunk: the job's, with its own samples and the frame's number.
    pub fn recipe(&self, chunk: &Chunk) -> Recipe {
        let &Chunk { image, first, spp, allocated } = chunk;
        let mut recipe = Recipe { first, goals: allocated.then(|| self.goals(image)), ..self.recipe.clone() };
        recipe.limits.spp = Some(spp);
        if let (_, Some(frame)) = self.image(image) {
            recipe.scene.parameters.insert(0, ("frame".into(), frame.to_string()));
        }
        recipe
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
        let fits = |found: checkpoint::Summary| matches!(found.origin.runs.as_slice(), [run] if (run.seed, run.first, run.samples) == (self.recipe.seed, chunk.first, chunk.spp));
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
