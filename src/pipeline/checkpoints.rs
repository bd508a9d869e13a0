//! Checkpoints of a run: when they are written, and how they are resumed.

use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard};
use std::time::{Duration, Instant};

use super::host::Host;
use super::prepare::Prepared;
use crate::adaptive::{Journal, Start};
use crate::checkpoint::{self, Origin};
use crate::error::{Error, Result};
use crate::files::Lock;
use crate::render::{FilmSink, RenderOutcome};
use crate::sync::lock;

/// A file that all samples are saved in from time to time.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Checkpoints {
    /// The file.
    pub file: PathBuf,
    /// Time between checkpoints. Slow ones are written less often, so that they take at most a hundredth of the time.
    pub every: Duration,
    /// Whether an existing file is resumed.
    pub resume: bool,
}

/// Share of the time, inverted, that writing checkpoints may take.
const SHARE: u32 = 100;

impl Checkpoints {
    /// Time between checkpoints if none is given.
    pub const EVERY: Duration = Duration::from_secs(60);

    /// Locks the file, so that no twin of this process works on it. The error says that it is locked, or that there is a checkpoint that is
    /// not to be resumed. To be called before the file is claimed.
    pub fn lock(&self) -> Result<Lock> {
        let lock = Lock::new(&self.file)?;
        if !self.resume && is_there(&self.file) {
            let what = format!("{} exists already: continue it by --resume, or remove it first", self.file.display());
            return Err(Error::Usage(what));
        }
        Ok(lock)
    }

    /// Does some work that renders, from the checkpoint if there is one to be resumed, and writes checkpoints on the way. The work
    /// has failed, too, if the last checkpoint could not be written. The error says which samples are saved all the same.
    pub fn keep<T>(
        &self,
        (prepared, origin): (&Prepared, Origin),
        host: &Host,
        work: impl FnOnce(Start, &Host) -> Result<T>,
    ) -> Result<T> {
        let journal = Mutex::default();
        let start = if self.resume && is_there(&self.file) {
            let there = checkpoint::summary(&self.file)?.origin;
            if let Err(why) = there.resumes(&origin) {
                // A header that is damaged is no other scene's.
                checkpoint::verify(&self.file)?;
                return Err(Error::mismatch(&self.file, why));
            }
            checkpoint::load(&self.file)?.resume(&journal)
        } else {
            prepared.start(&journal)
        };
        let now = Instant::now();
        let (next, kept) = (now + self.every, start.render.film.samples());
        let state = Mutex::new(State { next, kept, taken: now, failed: None });
        let writer =
            CheckpointWriter { path: &self.file, every: self.every, origin, journal: &journal, warn: host.warn, state };
        let sinks: Vec<_> = std::iter::once(&writer as &dyn FilmSink).chain(host.sinks.iter().copied()).collect();
        let done = work(start, &Host { sinks: &sinks, ..*host });
        writer.conclude(done)
    }
}

fn is_there(path: &Path) -> bool {
    std::fs::metadata(path).is_ok_and(|found| found.len() > 0)
}

/// Writes checkpoints while a render is under way.
struct CheckpointWriter<'a> {
    path: &'a Path,
    every: Duration,
    origin: Origin,
    journal: &'a Mutex<Journal>,
    warn: &'a (dyn Fn(&str) + Sync),
    state: Mutex<State>,
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
        lock(&self.state)
    }

    fn conclude<T>(&self, made: Result<T>) -> Result<T> {
        let mut state = self.state();
        match (made, state.failed.take()) {
            (Ok(made), None) => Ok(made),
            (Ok(_), Some(failed)) => Err(failed),
            (Err(error), _) if state.kept == 0 => Err(error),
            (Err(error), _) => Err(Error::Kept { path: self.path.to_path_buf(), error: Box::new(error) }),
        }
    }

    /// Writes a checkpoint. The error says which one is still there.
    fn write(&self, outcome: &RenderOutcome) -> Result<(), Error> {
        let journal = lock(self.journal);
        // Runs without decisions have no journal.
        let decided = !journal.notes.passes.is_empty() || !journal.goals.is_empty();
        let start = Instant::now();
        let saved = checkpoint::save(self.path, &self.origin, outcome, decided.then_some(&*journal));
        let mut state = self.state();
        state.next = Instant::now() + self.every.max(start.elapsed() * SHARE);
        saved.inspect(|()| (state.kept, state.taken) = (outcome.film.samples(), start)).map_err(|error| {
            let pixels = (outcome.film.width * outcome.film.height) as f64;
            let kept = match (state.kept as f64 / pixels, state.taken.elapsed().as_secs_f64()) {
                (0.0, _) => "no checkpoint is kept yet".to_owned(),
                (spp, ago) => format!("the checkpoint of {ago:.1} s ago is kept, with {spp:.1} samples per pixel"),
            };
            match error {
                Error::Io { path, what } => Error::io(&path, format!("{what}; {kept}")),
                other => other,
            }
        })
    }
}

impl FilmSink for CheckpointWriter<'_> {
    fn due(&self) -> bool {
        Instant::now() >= self.state().next
    }

    fn put(&self, outcome: &RenderOutcome) {
        let failed = self.write(outcome).err();
        if let Some(error) = &failed {
            (self.warn)(&format!("no new checkpoint: {error}"));
        }
        self.state().failed = failed;
    }
}
