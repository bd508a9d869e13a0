//! Checkpoints of `render`: when they are written, and how they are resumed.

use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard};
use std::time::{Duration, Instant};

use anyhow::{Result, bail};
use fluxion::adaptive::{Journal, Start};
use fluxion::checkpoint::{self, Checkpoint, Origin};
use fluxion::error::Error;
use fluxion::ffi::memory::say_what_is_kept;
use fluxion::files::Lock;
use fluxion::render::{self, RenderOutcome};

use super::terminal::note;
use super::{interrupt, progress};

/// Options of checkpoints.
#[derive(clap::Args)]
pub struct Args {
    /// File to save all samples in from time to time, so that an interrupted render can be resumed
    #[arg(long, value_name = "FILE")]
    pub checkpoint: Option<PathBuf>,
    /// Time between checkpoints; slow ones are written less often, so that they take at most a hundredth of the time
    #[arg(long, default_value = "60s", value_parser = super::parse_time, requires = "checkpoint", value_name = "TIME")]
    checkpoint_every: Duration,
    /// Resume from the checkpoint, if it exists
    #[arg(long, requires = "checkpoint")]
    resume: bool,
}

/// Share of the time, inverted, that writing checkpoints may take.
const SHARE: u32 = 100;

impl Args {
    /// Fails if there is a checkpoint that is not to be resumed. To be called before the file is claimed.
    pub fn check(&self) -> Result<()> {
        match &self.checkpoint {
            Some(path) if !self.resume && is_there(path) => bail!(Error::Usage(format!(
                "{} exists already: continue it by --resume, or remove it first",
                path.display()
            ))),
            _ => Ok(()),
        }
    }

    /// Locks the checkpoint's file, so that no twin of this process works on it.
    pub fn lock(&self) -> Result<Option<Lock>> {
        Ok(self.checkpoint.as_deref().map(Lock::new).transpose()?)
    }

    /// The checkpoint to resume from, if there is one and it is asked for.
    pub fn load(&self, wanted: &Origin) -> Result<Option<Checkpoint>> {
        let Some(path) = self.checkpoint.as_ref().filter(|path| self.resume && is_there(path)) else {
            return Ok(None);
        };
        let checkpoint = checkpoint::load(path)?;
        checkpoint.origin.resumes(wanted).map_err(|why| Error::mismatch(path, why))?;
        Ok(Some(checkpoint))
    }

    /// The writer of checkpoints of a render, if they are asked for.
    pub fn sink<'a>(&'a self, origin: Origin, start: &Start<'a>, lock: Lock) -> Option<CheckpointWriter<'a>> {
        let now = Instant::now();
        let kept = start.render.film.samples();
        let state = State { next: now + self.checkpoint_every, kept, taken: now, failed: None };
        let (path, every) = (self.checkpoint.as_deref()?, self.checkpoint_every);
        say_what_is_kept(format!("; the last checkpoint, if there was time for one, is kept in {}", path.display()));
        Some(CheckpointWriter { path, every, origin, journal: start.journal, state: Mutex::new(state), _lock: lock })
    }
}

fn is_there(path: &Path) -> bool {
    std::fs::metadata(path).is_ok_and(|found| found.len() > 0)
}

/// Writes checkpoints while a render is under way.
pub struct CheckpointWriter<'a> {
    path: &'a Path,
    every: Duration,
    origin: Origin,
    journal: &'a Mutex<Journal>,
    state: Mutex<State>,
    _lock: Lock,
}

struct State {
    next: Instant,
    /// Samples in the last complete checkpoint, and its time.
    kept: u64,
    taken: Instant,
    /// Error of the last checkpoint, if it could not be written.
    failed: Option<Error>,
}

impl CheckpointWriter<'_> {
    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(|poisoned| poisoned.into_inner())
    }

    /// The result of a render: it has failed, too, if its last checkpoint could not be written. The error says which
    /// samples are saved all the same.
    pub fn conclude(&self, made: Result<()>) -> Result<()> {
        let mut state = self.state();
        match (made, state.failed.take()) {
            (Ok(()), None) => {
                interrupt::saved();
                Ok(())
            }
            (Ok(()), Some(failed)) => Err(failed.into()),
            (Err(error), _) if state.kept == 0 => Err(error),
            (Err(error), _) => Err(error.context(format!(
                "the samples are kept: `fluxion reconstruct {}` makes an image of them",
                self.path.display()
            ))),
        }
    }

    /// Writes a checkpoint. The error says which one is still there.
    fn write(&self, outcome: &RenderOutcome) -> Result<(), Error> {
        let journal = self.journal.lock().unwrap_or_else(|poisoned| poisoned.into_inner());
        // Runs without decisions have no journal.
        let decided = !journal.notes.passes.is_empty() || !journal.goals.is_empty();
        let start = Instant::now();
        let saved = checkpoint::save(self.path, &self.origin, outcome, decided.then_some(&*journal));
        let mut state = self.state();
        state.next = Instant::now() + self.every.max(start.elapsed() * SHARE);
        saved.inspect(|()| (state.kept, state.taken) = (outcome.film.samples(), start)).map_err(|error| {
            let pixels = (outcome.film.width * outcome.film.height) as f64;
            let kept = match (state.kept as f64 / pixels, progress::seconds(state.taken.elapsed())) {
                (0.0, _) => "no checkpoint is kept yet".to_owned(),
                (spp, ago) => format!("the checkpoint of {ago} ago is kept, with {spp:.1} samples per pixel"),
            };
            match error {
                Error::Io { path, what } => Error::io(&path, format!("{what}; {kept}")),
                other => other,
            }
        })
    }
}

impl render::FilmSink for CheckpointWriter<'_> {
    fn due(&self) -> bool {
        Instant::now() >= self.state().next
    }

    fn put(&self, outcome: &RenderOutcome) {
        let failed = self.write(outcome).err();
        if let Some(error) = &failed {
            note!("warning: no new checkpoint: {error}");
        }
        self.state().failed = failed;
    }
}
