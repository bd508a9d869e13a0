//! Options that every command takes: threads, and what is shown of long work.

use std::sync::OnceLock;

use anyhow::Result;
use clap::ValueEnum;

/// Options of the machine.
#[derive(Clone, Copy, Debug, Default, clap::Args)]
#[command(next_help_heading = "Machine")]
pub struct Args {
    /// Threads to work with (0: one per core)
    #[arg(long, global = true, default_value_t = 0, value_parser = parse_threads, value_name = "N")]
    threads: usize,
    /// Show no progress; warnings and errors are shown
    #[arg(short, long, global = true)]
    quiet: bool,
    /// Format of progress reports
    #[arg(long, global = true, default_value = "auto", value_enum, hide_short_help = true, value_name = "STYLE")]
    progress: Style,
}

/// How progress is shown.
#[derive(Clone, Copy, Debug, Default, PartialEq, clap::ValueEnum)]
pub enum Style {
    /// A bar on terminals, elsewhere a line every half minute.
    #[default]
    Auto,
    /// A line for people every half minute, on standard error.
    Plain,
    /// An object a line with stage, share and seconds, on standard error.
    Json,
    /// Lines that Alfred, Tractor and Afanasy read, on standard output.
    Alf,
    /// Lines that Open Job Description reads, on standard output.
    Openjd,
}

/// The options of this process.
static CHOSEN: OnceLock<Args> = OnceLock::new();

const MAX_THREADS: usize = 1024;

/// Threads, not so many that starting them takes longer than the work.
fn parse_threads(text: &str) -> Result<usize, String> {
    let threads = text.parse().ok().filter(|&threads| threads <= MAX_THREADS);
    threads.ok_or_else(|| format!("threads are a number up to {MAX_THREADS}"))
}

impl Args {
    /// The options that are given, as words of a command line.
    pub fn words(self) -> Vec<String> {
        let mut words = Vec::new();
        if self.threads > 0 {
            words.extend(["--threads".to_owned(), self.threads.to_string()]);
        }
        if self.quiet {
            words.push("--quiet".to_owned());
        }
        if let Some(style) = self.progress.to_possible_value().filter(|_| self.progress != Style::Auto) {
            words.extend(["--progress".to_owned(), style.get_name().to_owned()]);
        }
        words
    }

    /// Makes all work of this process follow the options.
    pub fn apply(self) -> Result<()> {
        let _ = CHOSEN.set(self);
        if self.threads > 0 {
            rayon::ThreadPoolBuilder::new().num_threads(self.threads).build_global()?;
        }
        Ok(())
    }
}

fn chosen() -> Args {
    CHOSEN.get().copied().unwrap_or_default()
}

/// Threads to work with; 0 means one per core.
pub fn threads() -> usize {
    chosen().threads
}

/// Whether no progress is shown.
pub fn is_quiet() -> bool {
    chosen().quiet
}

/// Format of progress reports.
pub fn style() -> Style {
    chosen().progress
}
