//! Output files, claimed before the work so that nothing is rendered in vain.

use std::fs::OpenOptions;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use fluxion::image::io;

/// Fails on a path that cannot be written, or on an image format that is not known.
pub fn claim_image(path: &Path) -> Result<()> {
    io::check_writable(path)?;
    claim(path)
}

/// Fails on a path that cannot be written. A file that is there already keeps its content until it is replaced.
pub fn claim(path: &Path) -> Result<()> {
    let file = OpenOptions::new().create(true).append(true).open(path);
    file.map(drop).with_context(|| format!("cannot write {}", path.display()))
}

/// Removes the empty files that were claimed and never written, when the work has failed.
pub struct Claims(Vec<PathBuf>);

impl Claims {
    /// Claims images and other files.
    pub fn new(images: &[PathBuf], others: &[&Option<PathBuf>]) -> Result<Self> {
        let mut claims = Self(Vec::new());
        for path in images {
            claim_image(path)?;
            claims.0.push(path.clone());
        }
        for path in others.iter().filter_map(|path| path.as_ref()) {
            claim(path)?;
            claims.0.push(path.clone());
        }
        Ok(claims)
    }
}

impl Drop for Claims {
    fn drop(&mut self) {
        for path in &self.0 {
            if std::fs::metadata(path).is_ok_and(|found| found.is_file() && found.len() == 0) {
                // Best effort: an empty file left behind does no harm.
                let _ = std::fs::remove_file(path);
            }
        }
    }
}
