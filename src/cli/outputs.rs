//! Output files, claimed before the work so that nothing is rendered in vain.

use std::path::{Path, PathBuf};

use anyhow::{Result, bail};
use fluxion::error::Error;
use fluxion::image::io;
use fluxion::internals::files;

/// Removes the empty files that were claimed and never written, when the work has failed.
pub struct Claims(Vec<PathBuf>);

impl Claims {
    /// Claims images and other files, all of them different from each other and from the inputs. Files of layers are exr files.
    pub fn of_layers(
        images: &[PathBuf],
        layers: &[&Option<PathBuf>],
        others: &[&Option<PathBuf>],
        inputs: &[&Path],
    ) -> Result<Self> {
        for path in layers.iter().filter_map(|path| path.as_ref()) {
            if !io::has_layers(path) {
                bail!(Error::Usage(format!("{}: layers are written to exr files only", path.display())));
            }
        }
        Self::new(images, &[layers, others].concat(), inputs)
    }

    /// The same without files of layers.
    pub fn new(images: &[PathBuf], others: &[&Option<PathBuf>], inputs: &[&Path]) -> Result<Self> {
        let others: Vec<_> = others.iter().filter_map(|path| path.as_ref()).collect();
        let mut taken: Vec<_> = inputs.iter().map(|path| identity(path)).collect();
        let mut claims = Self(Vec::new());
        for path in images {
            io::check_writable(path)?;
        }
        for path in images.iter().chain(others) {
            let path_identity = identity(path);
            if taken.contains(&path_identity) {
                let what = format!("{} would be written over: give every file its own name", path.display());
                bail!(Error::Usage(what));
            }
            taken.push(path_identity);
            claims.0.push(path.clone());
            files::claim(path)?;
        }
        Ok(claims)
    }
}

/// The same for two names of a file, whether it is there or not.
fn identity(path: &Path) -> PathBuf {
    let folder = path.parent().filter(|parent| !parent.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let folder = folder.canonicalize().unwrap_or_else(|_| folder.to_path_buf());
    folder.join(path.file_name().unwrap_or_default())
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
