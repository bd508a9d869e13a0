//! `fluxion stress`.

use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Instant;

use super::json;
use super::outputs::Claims;
use super::terminal::out;
use anyhow::{Result, bail};
use fluxion::error::Error;
use fluxion::internals::files;
use fluxion::internals::stress::{Check, cases};
use fluxion::report::stress::{Row, page};

/// Options of `stress`.
#[derive(clap::Args)]
pub struct Args {
    /// Only cases whose name contains one of these, as in frames/ or firefly
    #[arg(long, value_name = "TEXT")]
    filter: Vec<String>,
    /// Show every figure, not only the worst of each kind
    #[arg(short, long)]
    verbose: bool,
    /// List the cases and try none
    #[arg(long)]
    list: bool,
    #[command(flatten)]
    json: json::Args,
    /// Page for all figures
    #[arg(long, value_name = "FILE")]
    html: Option<PathBuf>,
}

/// Tries every case and prints a table.
pub fn run(args: &Args) -> Result<ExitCode> {
    let wanted = |name: &str| args.filter.is_empty() || args.filter.iter().any(|part| name.contains(part));
    let chosen: Vec<_> = cases().filter(|case| wanted(case.name)).collect();
    if chosen.is_empty() {
        bail!(Error::Usage(format!("no case has {} in its name; --list shows all", args.filter.join(" or "))));
    }
    if args.list {
        chosen.iter().try_for_each(|case| out!("{:<20} {}", case.name, case.summary))?;
        return Ok(ExitCode::SUCCESS);
    }
    let _claims = Claims::new(&[], &[&args.json.file(), &args.html], &[])?;
    let mut rows = Vec::new();
    for case in chosen {
        let start = Instant::now();
        let checks = case.check();
        let row = Row { name: case.name, summary: case.summary, seconds: start.elapsed().as_secs_f64(), checks };
        print(&row, args.verbose)?;
        rows.push(row);
    }
    args.json.write(&rows)?;
    if let Some(path) = &args.html {
        files::write(path, page(&rows))?;
    }
    let (passed, checks) =
        (rows.iter().filter(|row| row.checks.passed()).count(), rows.iter().map(|row| row.checks.list.len()));
    let seconds: f64 = rows.iter().map(|row| row.seconds).sum();
    out!("{passed} of {} cases passed, {} figures, {seconds:.0} s", rows.len(), checks.sum::<usize>())?;
    Ok(if passed == rows.len() { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

/// A line for each kind of figure: the one that is nearest to its bound, or beyond.
fn print(row: &Row, verbose: bool) -> Result<()> {
    let mark = if row.checks.passed() { "ok" } else { "FAILED" };
    out!("{:<20} {mark:<6} {:>6.1} s  {}", row.name, row.seconds, row.summary)?;
    let line = |check: &Check| {
        let mark = if check.passed() { ' ' } else { '!' };
        out!("  {mark} {:>9.1e} <= {:<7.0e} {}: {}", check.value, check.bound, check.measure, check.subject)
    };
    if verbose {
        row.checks.list.iter().try_for_each(line)?;
    } else {
        row.worst().iter().try_for_each(|check| line(check))?;
        row.checks.list.iter().filter(|check| !check.passed()).try_for_each(line)?;
    }
    if let Some(failed) = &row.checks.failed {
        out!("  ! {failed}")?;
    }
    Ok(())
}
