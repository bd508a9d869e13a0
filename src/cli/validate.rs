//! `fluxion validate`: bundled scenes against their bundled references.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use super::terminal::out;
use anyhow::{Context, Result, bail};
use fluxion::error::Error;
use fluxion::reference::{Verdict, check_folder};

/// Options of `validate`.
#[derive(clap::Args)]
pub struct Args {
    /// Folders with a scene.xml and a reference.exr [default: all below scenes/]
    scenes: Vec<PathBuf>,
    /// Samples per pixel to check with
    #[arg(long, default_value_t = 256, value_parser = clap::value_parser!(u32).range(1..))]
    spp: u32,
    /// Seed to check with
    #[arg(long, default_value_t = 1)]
    seed: u64,
}

/// Checks every scene and prints a table.
pub fn run(args: &Args) -> Result<ExitCode> {
    let folders = if args.scenes.is_empty() { below(Path::new("scenes"))? } else { args.scenes.clone() };
    if folders.is_empty() {
        bail!(Error::Usage("there is no folder with a scene.xml below scenes/; name one".into()));
    }
    out!("{:<28} {:>9} {:>9} {:>9} {:>7} {:>9}", "scene", "mean R", "mean G", "mean B", "z rms", "|z| > 4")?;
    let mut failed = 0;
    for folder in &folders {
        let verdict = check_folder(folder, args.spp, args.seed)?;
        let Verdict { mean_ratio: [r, g, b], z_rms, outliers, passed } = verdict;
        let mark = if passed { "" } else { "  FAILED" };
        out!(
            "{:<28} {r:>9.4} {g:>9.4} {b:>9.4} {z_rms:>7.3} {:>8.3}%{mark}",
            folder.display().to_string(),
            100.0 * outliers
        )?;
        failed += usize::from(!passed);
    }
    out!("{} of {} scenes agree with their references", folders.len() - failed, folders.len())?;
    Ok(if failed == 0 { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

/// Folders with a scene.xml at any depth, sorted.
fn below(root: &Path) -> Result<Vec<PathBuf>> {
    let mut found = Vec::new();
    let mut open = vec![root.to_path_buf()];
    while let Some(folder) = open.pop() {
        if folder.join("scene.xml").is_file() {
            found.push(folder.clone());
        }
        let entries = std::fs::read_dir(&folder).with_context(|| format!("cannot read {}", folder.display()))?;
        open.extend(entries.filter_map(|entry| Some(entry.ok()?.path())).filter(|path| path.is_dir()));
    }
    found.sort();
    Ok(found)
}
