//! The program as the host of runs: signals stop them, and progress and warnings are shown.

use std::sync::Mutex;
use std::sync::atomic::AtomicBool;

use anyhow::Result;
use fluxion::internals::sync::lock;
use fluxion::pipeline::Host;
use fluxion::render::FilmSink;

use super::interrupt::stop_on_signal;
use super::progress;
use super::terminal::note;

/// Does some work that takes samples under a progress bar, which a signal stops; `shows` says of which stages.
pub fn hosted<T>(
    sinks: &[&dyn FilmSink],
    shows: impl Fn(&str) -> bool + Sync,
    work: impl FnOnce(&Host) -> T,
) -> Result<T> {
    Ok(with_bar(&Host { stop: stop_on_signal()?, sinks, ..Host::QUIET }, shows, work))
}

/// Does some work under a progress bar that cannot be stopped half way: a signal ends the program.
pub fn watched<T>(work: impl FnOnce(&Host) -> T) -> T {
    with_bar(&Host { stop: &AtomicBool::new(false), ..Host::QUIET }, |_| true, work)
}

fn with_bar<T>(host: &Host, shows: impl Fn(&str) -> bool + Sync, work: impl FnOnce(&Host) -> T) -> T {
    let (bar, current) = (progress::bar(), Mutex::new(String::new()));
    let report = |stage: &str, share| {
        if !shows(stage) {
            return;
        }
        let mut current = lock(&current);
        if *current != stage {
            stage.clone_into(&mut current);
            bar.restart(stage);
        }
        bar.set(share);
    };
    let show = |text: &str| bar.suspend(|| warn(text));
    let done = work(&Host { progress: &report, warn: &show, ..*host });
    bar.finish();
    done
}

/// Shows a warning.
pub fn warn(text: &str) {
    note!("warning: {text}");
}
