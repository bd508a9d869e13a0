//! A progress bar on standard error, only where someone is watching.

use std::time::Duration;

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

const STEPS: u64 = 1000;

/// A bar with the time left.
pub fn bar(quiet: bool) -> ProgressBar {
    let bar = ProgressBar::new(STEPS);
    bar.set_draw_target(if quiet { ProgressDrawTarget::hidden() } else { ProgressDrawTarget::stderr_with_hz(5) });
    if let Ok(style) = ProgressStyle::with_template("{msg:12} [{bar:40}] {percent:>3}%  {elapsed} elapsed, {eta} left")
    {
        bar.set_style(style.progress_chars("=> "));
    }
    bar
}

/// Moves the bar to a share in [0, 1].
pub fn set(bar: &ProgressBar, share: f32) {
    bar.set_position((share.clamp(0.0, 1.0) * STEPS as f32) as u64);
}

/// Seconds with as many digits as are worth reading.
pub fn seconds(duration: Duration) -> String {
    let seconds = duration.as_secs_f64();
    if seconds < 10.0 { format!("{seconds:.2} s") } else { format!("{seconds:.1} s") }
}
