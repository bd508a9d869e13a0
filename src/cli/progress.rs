//! Progress: a bar where someone is watching, lines where nobody is, or where a program reads them.

use fluxion::internals::sync::lock;
use std::io::IsTerminal;
use std::sync::Mutex;
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use schemars::JsonSchema;
use serde::Serialize;

use super::machine::{self, Style};
use super::terminal::{note, out};

/// Progress of one piece of work.
pub struct Progress {
    drawn: ProgressBar,
    lines: Option<Mutex<Lines>>,
}

/// State of progress in lines.
struct Lines {
    style: Style,
    stage: String,
    start: Instant,
    /// When the next line is due.
    next: Instant,
}

/// A line of progress for programs.
#[derive(Serialize, JsonSchema)]
pub struct Line {
    /// Work that is under way.
    stage: String,
    /// Share of it that is done, from 0 to 1.
    share: f32,
    /// Seconds that it has taken.
    seconds: f64,
    /// Seconds that are left at the same speed.
    left: f64,
}

const STEPS: u64 = 1000;

/// Progress that starts now.
pub fn bar() -> Progress {
    let quiet = machine::is_quiet();
    let drawn = ProgressBar::new(STEPS);
    let style = match machine::style() {
        Style::Auto if std::io::stderr().is_terminal() => None,
        Style::Auto => Some(Style::Plain),
        style => Some(style),
    };
    let hidden = quiet || style.is_some();
    drawn.set_draw_target(if hidden { ProgressDrawTarget::hidden() } else { ProgressDrawTarget::stderr_with_hz(5) });
    if let Ok(style) = ProgressStyle::with_template("{msg:12} [{bar:40}] {percent:>3}%  {elapsed} elapsed, {eta} left")
    {
        drawn.set_style(style.progress_chars("=> "));
    }
    let now = Instant::now();
    let lines = style
        .filter(|_| !quiet)
        .map(|style| Mutex::new(Lines { style, stage: String::new(), start: now, next: now + pause(style) }));
    Progress { drawn, lines }
}

/// Time between two lines.
fn pause(style: Style) -> Duration {
    Duration::from_secs(if style == Style::Plain { 30 } else { 1 })
}

impl Progress {
    /// Names the stage.
    pub fn set_message(&self, stage: &str) {
        self.drawn.set_message(stage.to_owned());
        if let Some(lines) = &self.lines {
            stage.clone_into(&mut lock(lines).stage);
        }
    }

    /// Begins a stage, with a clock of its own.
    pub fn restart(&self, stage: &str) {
        self.drawn.reset();
        self.set_message(stage);
        if let Some(lines) = &self.lines {
            lock(lines).restart();
        }
    }

    /// Shows something else while the bar is away.
    pub fn suspend(&self, show: impl FnOnce()) {
        self.drawn.suspend(show);
    }

    /// Moves to a share in [0, 1].
    pub fn set(&self, share: f32) {
        let share = share.clamp(0.0, 1.0);
        self.drawn.set_position((share * STEPS as f32) as u64);
        if let Some(lines) = &self.lines {
            lock(lines).report(share);
        }
    }

    /// Takes the bar away.
    pub fn finish(&self) {
        self.drawn.finish_and_clear();
    }
}

impl Lines {
    fn restart(&mut self) {
        self.start = Instant::now();
        self.next = self.start + pause(self.style);
    }

    /// Writes a line, if one is due.
    fn report(&mut self, share: f32) {
        let now = Instant::now();
        if now < self.next {
            return;
        }
        self.next = now + pause(self.style);
        let (elapsed, percent) = (self.start.elapsed().as_secs_f64(), (100.0 * share) as u32);
        let left = elapsed / f64::from(share.max(1e-6)) - elapsed;
        // Nobody may be reading, which is no reason to stop.
        let _ = match self.style {
            Style::Json => {
                let line = Line { stage: self.stage.clone(), share, seconds: elapsed, left };
                note!("{}", serde_json::to_string(&line).unwrap_or_default());
                Ok(())
            }
            Style::Alf => out!("ALF_PROGRESS {percent}%"),
            Style::Openjd => out!("openjd_progress: {percent}"),
            Style::Auto | Style::Plain => {
                note!("{} {percent} %, {elapsed:.0} s elapsed, {left:.0} s left", self.stage);
                Ok(())
            }
        };
    }
}

/// Seconds with as many digits as are worth reading.
pub fn seconds(duration: Duration) -> String {
    let seconds = duration.as_secs_f64();
    if seconds < 10.0 { format!("{seconds:.2} s") } else { format!("{seconds:.1} s") }
}
