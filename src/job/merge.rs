//! The images of a job, of all chunks that are complete.

use std::path::PathBuf;

use super::description::Job;
use super::ranges::ranges;
use crate::checkpoint;
use crate::error::{Error, Result};
use crate::pipeline::{Host, MethodRecipe, Outputs, Stats};

/// An image of a job.
#[derive(Clone, Debug, PartialEq)]
pub struct Merged {
    /// The checkpoint of all of its samples.
    pub film: PathBuf,
    /// Mean samples per pixel.
    pub spp: f64,
    /// Number of the chunks that it is of.
    pub chunks: usize,
    /// The image, if it was asked for.
    pub image: Option<PathBuf>,
}

impl Job {
    /// Merges an image's chunks into `NAME.ckpt` and, if asked for, reconstructs `NAME.exr` by the method that they were rendered for. The
    /// error says which chunks are missing; if it is to be `partial`, they may be, with a warning.
    pub fn merge(&self, image: usize, partial: bool, reconstruct: bool, host: &Host) -> Result<Merged> {
        let (films, left) = self.films(self.first_round(image).chain(self.second_round(image)))?;
        let name = self.name(image);
        if !left.is_empty() {
            let what = format!("chunks {} of {name} are not complete", ranges(&left));
            if !partial || films.is_empty() {
                return Err(Error::Usage(format!("{what}: run them, or merge what there is by --partial")));
            }
            (host.warn)(&format!("{what}: the image has fewer samples"));
        }
        let film = self.folder.join(format!("{name}.ckpt"));
        let found = checkpoint::merge(&films, &film)?;
        let spp = found.samples as f64 / (found.origin.size.0 * found.origin.size.1) as f64;
        let path = reconstruct.then(|| self.folder.join(format!("{name}.exr")));
        if let Some(path) = &path {
            let frame = checkpoint::load(&film)?.develop();
            let method = MethodRecipe { name: found.origin.method, ..self.recipe.method.clone() }.make()?;
            let outputs = Outputs { images: vec![path.clone()], ..Outputs::default() };
            let mut stats = Stats::default();
            let solution = method.solve(&frame, host, &mut stats)?;
            outputs.write_image(&method, (&frame, &solution), None, &mut stats)?;
        }
        Ok(Merged { film, spp, chunks: films.len(), image: path })
    }
}
