//! Files of a render, and its images with layers of error, samples and lights.

use std::path::{Path, PathBuf};
use std::time::Instant;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::method::Method;
use super::stats::Stats;
use crate::error::{Error, Result};
use crate::film::{Frame, Layer};
use crate::image::Image;
use crate::image::io::{self, Extras};
use crate::reconstruct::{self, Solution};
use crate::scene::sensor::Crop;

/// Files that a render writes.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Outputs {
    /// Images, in the format of their extensions.
    pub images: Vec<PathBuf>,
    /// Whether an image is made though it is written nowhere: for its time, or to be used.
    pub image: bool,
    /// Exposure of images of 8 bits, in powers of two.
    pub exposure: f32,
    /// EXR file of all recorded layers.
    pub layers: Option<PathBuf>,
    /// EXR file of Cryptomatte layers.
    pub cryptomatte: Option<PathBuf>,
    /// Folder of single samples.
    pub samples: Option<PathBuf>,
    /// Folder of the method's intermediate images.
    pub notes: Option<PathBuf>,
}

impl Outputs {
    /// Whether an image has to be made.
    pub fn needs_image(&self) -> bool {
        self.image || !self.images.is_empty()
    }

    /// Writes intermediate images to their folder, and the image to every file; of the image only the part `inner`, if that is given.
    pub fn write_image(
        &self,
        method: &Method,
        (frame, solution): (&Frame, &Solution),
        inner: Option<Crop>,
        stats: &mut Stats,
    ) -> Result<()> {
        if let Some(folder) = &self.notes {
            write_notes(folder, frame, solution)?;
        }
        let start = Instant::now();
        let lights = if self.images.iter().any(|path| io::has_layers(path)) {
            reconstruct::light_groups(&*method.made, frame, solution)?
        } else {
            Vec::new()
        };
        stats.seconds.reconstruct += start.elapsed().as_secs_f64();
        let start = Instant::now();
        let shown = |image: &Image| match inner {
            Some(Crop { x, y, width, height }) => image.part((x, y), (width, height)),
            None => image.clone(),
        };
        let error = solution.error.iter().map(|error| ("error".to_owned(), shown(error)));
        let samples = frame.get(Layer::Samples).map(|samples| ("samples".to_owned(), shown(samples)));
        let lights = lights.iter().map(|note| (format!("light.{}", note.name), shown(&note.image)));
        let layers: Vec<_> = error.chain(samples).chain(lights).collect();
        let alpha = solution.alpha.as_ref().or(frame.get(Layer::Alpha)).map(shown);
        let image = shown(&solution.image);
        let extras = Extras {
            alpha: alpha.as_ref(),
            layers: layers.iter().map(|(name, image)| (name.as_str(), image)).collect(),
            attributes: frame.provenance.attributes(),
            window: inner.map(|inner| inner.within(frame.window, (frame.width, frame.height))).or(frame.window),
            exposure: self.exposure,
        };
        let written = put(&self.images, &image, &extras);
        stats.seconds.write += start.elapsed().as_secs_f64();
        written
    }
}

/// Writes an image to every file. If that fails everywhere, it is rescued: one that took hours must not be lost because one disk is full.
fn put(paths: &[PathBuf], image: &Image, extras: &Extras) -> Result<()> {
    let (mut written, mut failed) = (Vec::new(), Vec::new());
    for path in paths {
        match io::write_color(path, image, extras) {
            Ok(()) => written.push(path.display().to_string()),
            Err(error) => failed.push(error.to_string()),
        }
    }
    if failed.is_empty() {
        return Ok(());
    }
    let rescue = std::env::temp_dir().join(format!("fluxion-{}.exr", std::process::id()));
    if written.is_empty() && io::write_color(&rescue, image, extras).is_ok() {
        written.push(rescue.display().to_string());
    }
    let kept = match written.as_slice() {
        [] => "nothing could be written".to_owned(),
        written => format!("the image is in {}", written.join(", ")),
    };
    Err(Error::NotWritten(format!("{}; {kept}", failed.join("; "))))
}

fn write_notes(folder: &Path, frame: &Frame, solution: &Solution) -> Result<()> {
    for note in &solution.notes {
        let attributes = frame.provenance.attributes();
        let extras = Extras { attributes, window: frame.window, ..Extras::default() };
        io::write_color(&folder.join(format!("{}.exr", note.name)), &note.image, &extras)?;
    }
    Ok(())
}
