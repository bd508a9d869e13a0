//! Signals that ask a long command to stop.

use std::process::ExitCode;
use std::sync::Once;
use std::sync::atomic::{AtomicBool, AtomicI32, Ordering};

use anyhow::Result;
use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};
use signal_hook::iterator::Signals;

use super::terminal::note;

/// The first signal that came; 0 for none.
static SIGNAL: AtomicI32 = AtomicI32::new(0);

/// Whether a checkpoint holds everything that was done.
static SAVED: AtomicBool = AtomicBool::new(false);

/// Exit code of work that was stopped and can be resumed, by which schedulers requeue it: a temporary failure, `EX_TEMPFAIL`.
const RESUMABLE: u8 = 75;

/// Exit codes of programs that a signal ended, less the signal's number.
const SIGNALLED: i32 = 128;

/// The flag that the first signal sets.
static STOP: AtomicBool = AtomicBool::new(false);

/// Listens to signals from the first call on. The first one sets the flag. A second Ctrl-C ends the program; a second request to
/// terminate does not, since schedulers send several.
pub fn stop_on_signal() -> Result<&'static AtomicBool> {
    static LISTENING: Once = Once::new();
    if LISTENING.is_completed() {
        return Ok(&STOP);
    }
    let mut signals = Signals::new([SIGINT, SIGTERM, SIGHUP])?;
    std::thread::Builder::new().name("signals".into()).spawn(move || {
        for signal in signals.forever() {
            if STOP.swap(true, Ordering::Relaxed) {
                if signal == SIGINT {
                    std::process::exit(SIGNALLED + SIGINT);
                }
                continue;
            }
            SIGNAL.store(signal, Ordering::Relaxed);
            note!("\nstopping after the running tiles; once more Ctrl-C ends at once");
        }
    })?;
    LISTENING.call_once(|| ());
    Ok(&STOP)
}

/// The exit code of a command that was stopped by a signal: [`RESUMABLE`] if everything was saved.
pub fn stopped() -> Option<ExitCode> {
    let signal = SIGNAL.load(Ordering::Relaxed);
    let code = if SAVED.load(Ordering::Relaxed) { RESUMABLE } else { (SIGNALLED + signal) as u8 };
    (signal != 0).then(|| ExitCode::from(code))
}

/// Says that what was done so far is saved and can be resumed.
pub fn saved() {
    SAVED.store(true, Ordering::Relaxed);
}
