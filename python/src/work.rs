//! Long work on a thread of its own, without the interpreter's lock, while this one listens for Ctrl-C and reports progress.

use std::ffi::CString;
use std::panic::resume_unwind;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread;
use std::time::Duration;

use fluxion::error::{Error, Result};
use fluxion::pipeline::{Host, RENDERING};
use pyo3::exceptions::{PyRuntimeError, PyUserWarning, PyValueError};
use pyo3::prelude::*;

use crate::error::raised;

/// Time between two looks for signals.
const PAUSE: Duration = Duration::from_millis(50);
/// Threads whose start does not yet take longer than the work.
const MOST_THREADS: usize = 1024;
/// Stack of the thread, as that of a program's first one.
const STACK: usize = 8 << 20;

/// Connections of the work to its caller.
#[derive(Clone, Default)]
pub struct Link {
    /// Set when the caller has gone away.
    pub stop: Arc<AtomicBool>,
    stage: Arc<Mutex<(String, f32)>>,
    warnings: Arc<Mutex<Vec<String>>>,
}

impl Link {
    /// Sets the stage and the finished share, and ends the thread if nobody waits for it any more.
    pub fn report(&self, stage: &str, share: f32) {
        if self.stop.load(Ordering::Relaxed) {
            // There is nobody left to return to: what unwinds is let go of with the thread.
            resume_unwind(Box::new("interrupted"));
        }
        self.set(stage, share);
    }

    /// Sets the stage and the finished share.
    pub fn set(&self, stage: &str, share: f32) {
        let mut now = self.stage.lock().unwrap_or_else(PoisonError::into_inner);
        if now.0 != stage {
            stage.clone_into(&mut now.0);
        }
        now.1 = share;
    }

    /// Does some work of the pipeline whose host is the caller.
    pub fn hosted<T>(&self, work: impl FnOnce(&Host) -> T) -> T {
        let progress = |stage: &str, share| match stage {
            // Threads of a render must not unwind: they end by the flag.
            RENDERING => self.set(stage, share),
            _ => self.report(stage, share),
        };
        let warn = |text: &str| self.warnings.lock().unwrap_or_else(PoisonError::into_inner).push(text.to_owned());
        work(&Host { stop: &self.stop, progress: &progress, warn: &warn, sinks: &[] })
    }

    /// Hands the warnings of the work to Python, whose filters may make errors of them.
    fn warn(&self, py: Python<'_>) -> PyResult<()> {
        let category = py.get_type::<PyUserWarning>();
        let warnings = std::mem::take(&mut *self.warnings.lock().unwrap_or_else(PoisonError::into_inner));
        warnings.iter().try_for_each(|text| PyErr::warn(py, &category, &CString::new(text.replace('\0', " "))?, 2))
    }

    fn stage(&self) -> (String, f32) {
        self.stage.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }
}

/// Does the work with so many threads (0: one per core). `progress` is called with the stage and the finished share. What an
/// exception interrupts ends soon after, by itself.
pub fn run<T: Send + 'static>(
    py: Python<'_>,
    threads: usize,
    progress: Option<&Bound<'_, PyAny>>,
    work: impl FnOnce(&Link) -> Result<T> + Send + 'static,
) -> PyResult<T> {
    if threads > MOST_THREADS {
        return Err(PyValueError::new_err(format!("threads are a number up to {MOST_THREADS}")));
    }
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
    let pool = (threads > 0).then(|| pool.build()).transpose();
    let pool = pool.map_err(|error| raised(Error::Usage(format!("{threads} threads: {error}"))))?;
    let link = Link::default();
    let (sender, receiver) = channel();
    let receiver = Mutex::new(receiver);
    let of_thread = link.clone();
    let work = move || {
        let done = match &pool {
            Some(pool) => pool.install(|| work(&of_thread)),
            None => work(&of_thread),
        };
        // Nobody may be waiting any more.
        let _ = sender.send(done);
    };
    thread::Builder::new().stack_size(STACK).spawn(work)?;
    loop {
        let wait = || receiver.lock().unwrap_or_else(PoisonError::into_inner).recv_timeout(PAUSE);
        match py.detach(wait) {
            Ok(done) => {
                let done = done.map_err(raised)?;
                link.warn(py)?;
                return Ok(done);
            }
            Err(RecvTimeoutError::Timeout) => {
                let report = |progress: &Bound<'_, PyAny>| progress.call1(link.stage()).map(drop);
                let heard = py.check_signals().and_then(|()| progress.map_or(Ok(()), report));
                if heard.is_err() {
                    link.stop.store(true, Ordering::Relaxed);
                    heard?;
                }
            }
            Err(RecvTimeoutError::Disconnected) => {
                return Err(PyRuntimeError::new_err("the work ended without a result: a fault of fluxion itself"));
            }
        }
    }
}
