//! The render of a chunk.

use std::sync::atomic::Ordering;
use std::time::Instant;

use super::chunk::{Chunk, State};
use super::description::Job;
use crate::error::{Error, Result};
use crate::files;
use crate::pipeline::{Checkpoints, Host, Stats};

/// How the work on a chunk has ended.
#[derive(Clone, Debug)]
pub enum ChunkEnd {
    /// The chunk was complete before.
    Complete,
    /// The chunk has all samples now.
    Rendered(Chunk, Stats),
    /// The host has stopped the chunk; its samples are saved, to be resumed.
    Stopped(Chunk, Stats),
}

impl Job {
    /// Renders a chunk, unless it is complete; goes on with it if it was interrupted. It may be called any number of times, by several machines
    /// for different chunks.
    pub fn run(&self, number: usize, host: &Host) -> Result<ChunkEnd> {
        let (part, whole) = (self.unfinished(number), self.complete(number));
        match self.state(number, false)? {
            State::Complete => return Ok(ChunkEnd::Complete),
            State::Wrong => {
                let what = "is no checkpoint of this chunk: remove it, and run the chunk again";
                return Err(Error::mismatch(&whole, what));
            }
            _ => {}
        }
        let Some(chunk) = self.chunk(number)? else {
            let what =
                format!("the samples of chunk {number} are not allocated yet: run those of the first round, then");
            return Err(Error::Usage(format!("{what} `fluxion job allocate {}`", self.folder.display())));
        };
        let checkpoints = Checkpoints { file: part.clone(), every: self.checkpoint_every, resume: true };
        let _lock = checkpoints.lock()?;
        // A chunk that is being worked on is seen to be started.
        files::claim(&part)?;
        let done = self.render(&chunk, &checkpoints, host);
        if done.is_err() && std::fs::metadata(&part).is_ok_and(|found| found.len() == 0) {
            // Best effort: an empty file left behind does no harm.
            let _ = std::fs::remove_file(&part);
        }
        let stats = done?;
        if host.stop.load(Ordering::Relaxed) {
            return Ok(ChunkEnd::Stopped(chunk, stats));
        }
        std::fs::rename(&part, &whole).map_err(|error| Error::io(&whole, error))?;
        Ok(ChunkEnd::Rendered(chunk, stats))
    }

    fn render(&self, chunk: &Chunk, checkpoints: &Checkpoints, host: &Host) -> Result<Stats> {
        let (recipe, file, loading) = (self.recipe(chunk), self.image(chunk.image).0, Instant::now());
        let scene = recipe.load(file)?;
        let load = loading.elapsed().as_secs_f64();
        scene.warnings().iter().for_each(|warning| (host.warn)(warning));
        let prepared = recipe.prepare(&scene, file)?;
        let origin = prepared.origin()?;
        if self.contents.get(chunk.image).is_some_and(|known| *known != origin.content) {
            let what = "has changed since the plan was made, or a file that it names: plan anew";
            return Err(Error::mismatch(file, what));
        }
        let mut stats =
            checkpoints.keep((&prepared, origin), host, |start, host| Ok(prepared.run(start, host)?.stats))?;
        stats.seconds.load = load;
        Ok(stats)
    }
}
