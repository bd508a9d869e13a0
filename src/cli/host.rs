//! The program as the host of runs: signals stop them, and progress and warnings are shown.

use anyhow::Result;
use fluxion::pipeline::Host;
use fluxion::render::FilmSink;

use super::interrupt::stop_on_signal;
use super::progress;
use super::terminal::note;

/// Does some work under a progress bar, which an interrupt stops; `shows` says of which stages.
pub fn hosted<T>(
    sinks: &[&dyn FilmSink],
    shows: impl Fn(&str) -> bool + Sync,
    work: impl FnOnce(&Host) -> T,
) -> Result<T> {
    let stop = stop_on_signal()?;
    let bar = progress::bar();
    let report = |stage: &str, share| {
        if shows(stage) {
            bar.set_message(stage);
            bar.set(share);
        }
    };
    let done = work(&Host { stop, progress: &report, warn: &warn, sinks });
    bar.finish();
    Ok(done)
}

/// Shows a warning.
pub fn warn(text: &str) {
    note!("warning: {text}");
}
