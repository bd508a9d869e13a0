//! Files of a frame: which there are, how they are called, and what is in their channels.

use std::path::{Path, PathBuf};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::error::Result;
use crate::film::{Frame, Layer, Needs};
use crate::image::Image;
use crate::image::io::{Kind, Pixels, write};
use crate::image::npy::{self, Number};
use crate::reconstruct::Solution;

/// Arrangement of the files.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Layout {
    /// Arrays of height, width and channels for NumPy: `NAME_0016spp.npy` with all layers, `NAME_ref.npy`.
    #[default]
    Npy,
    /// Images as the training of Open Image Denoise takes them: `NAME_0016spp.hdr.exr`, `.alb.exr`, `.nrm.exr`, and
    /// `NAME_ref.hdr.exr`.
    Oidn,
}

/// Everything that is known of the pixels at one number of samples.
pub struct Snapshot {
    /// All layers.
    pub frame: Frame,
    /// Layers to be stored, as statistics.
    pub layers: Needs,
    /// Images of methods, by their names.
    pub solutions: Vec<(String, Solution)>,
}

/// The image to be learned, directly seen emitters included, and the first half of its samples less the second.
pub struct Target {
    /// Mean of both halves.
    pub image: Image,
    /// First half less second.
    pub difference: Image,
}

impl Target {
    /// The target of two halves of the samples.
    pub fn new(first: &Image, second: &Image) -> Self {
        let combine = |f: fn(f32, f32) -> f32| {
            let data = first.data.iter().zip(&second.data).map(|(a, b)| f(*a, *b)).collect();
            Image { data, ..Image::new(first.width, first.height, first.channels) }
        };
        Self { image: combine(|a, b| 0.5 * (a + b)), difference: combine(|a, b| a - b) }
    }
}

const RGB: [&str; 3] = ["R", "G", "B"];

impl Layout {
    /// Writes the pixels at `spp` samples; the names of the channels.
    pub fn write(self, stem: &Path, spp: u32, snapshot: &Snapshot, number: Number) -> Result<Vec<String>> {
        let path = |end: &str| file(stem, &format!("_{spp:04}spp{end}"));
        match self {
            Self::Npy => {
                let planes = planes(snapshot);
                save(&path(".npy"), &planes, number)?;
                Ok(planes.into_iter().flat_map(|plane| plane.channels).collect())
            }
            Self::Oidn => {
                let frame = &snapshot.frame;
                let mut color = frame.require(Layer::Color)?.clone();
                color.add(frame.require(Layer::Direct)?);
                picture(&path(".hdr.exr"), &color, number)?;
                picture(&path(".alb.exr"), frame.require(Layer::Albedo)?, number)?;
                picture(&path(".nrm.exr"), frame.require(Layer::Normal)?, number)?;
                for (name, solution) in &snapshot.solutions {
                    picture(&path(&format!(".{name}.exr")), &solution.image, number)?;
                }
                Ok(RGB.map(String::from).to_vec())
            }
        }
    }

    /// Writes the target.
    pub fn write_target(self, stem: &Path, target: &Target, number: Number) -> Result<()> {
        match self {
            Self::Npy => {
                let difference = RGB.map(|channel| format!("difference.{channel}")).to_vec();
                let planes = [
                    Plane { channels: RGB.map(String::from).to_vec(), image: &target.image, root: false },
                    Plane { channels: difference, image: &target.difference, root: false },
                ];
                save(&file(stem, "_ref.npy"), &planes, number)
            }
            Self::Oidn => picture(&file(stem, "_ref.hdr.exr"), &target.image, number),
        }
    }
}

/// The path of a stem with something at its end.
pub fn file(stem: &Path, end: &str) -> PathBuf {
    let mut name = stem.file_name().unwrap_or_default().to_os_string();
    name.push(end);
    stem.with_file_name(name)
}

/// An image with the names of its channels in files.
struct Plane<'a> {
    channels: Vec<String>,
    image: &'a Image,
    /// Whether files have the square root: variances would be too small for half floats, standard deviations are not.
    root: bool,
}

/// Layers, then for every method its image, its expected error and its intermediate images: the same channels at every number of samples.
fn planes(snapshot: &Snapshot) -> Vec<Plane<'_>> {
    let mut planes: Vec<Plane> = snapshot
        .frame
        .present()
        // Its presence depends on the number of samples, and uncertainty is in the deviations.
        .filter(|(layer, _)| layer.is_in(snapshot.layers) && *layer != Layer::EdgeSamples)
        .map(|(layer, image)| {
            let names = layer.channel_names();
            let root = names[0].contains("variance");
            Plane { channels: names.iter().map(|name| name.replace("variance", "sigma")).collect(), image, root }
        })
        .collect();
    for (name, solution) in &snapshot.solutions {
        let channels = |name: &str| RGB.map(|channel| format!("{name}.{channel}")).to_vec();
        planes.push(Plane { channels: channels(name), image: &solution.image, root: false });
        let sigma = |image| Plane { channels: channels(&format!("{name}_sigma")), image, root: true };
        planes.extend(solution.error.as_ref().map(sigma));
        let whole = solution.notes.iter().filter(|note| note.image.shape() == solution.image.shape());
        planes.extend(whole.map(|note| Plane {
            channels: channels(&format!("{name}_{}", note.name)),
            image: &note.image,
            root: false,
        }));
    }
    planes
}

/// Writes planes as one array of height, width and channels.
fn save(path: &Path, planes: &[Plane], number: Number) -> Result<()> {
    let (width, height) = (planes[0].image.width, planes[0].image.height);
    let channels: usize = planes.iter().map(|plane| plane.image.channels).sum();
    let mut data = Vec::with_capacity(width * height * channels);
    for pixel in 0..width * height {
        for Plane { image, root, .. } in planes {
            let values = &image.data[pixel * image.channels..][..image.channels];
            data.extend(values.iter().map(|value| if *root { value.max(0.0).sqrt() } else { *value }));
        }
    }
    npy::write(path, &[height, width, channels], &data, number)
}

/// Writes an image of three channels as EXR.
fn picture(path: &Path, image: &Image, number: Number) -> Result<()> {
    let (kind, channels) = match number {
        Number::Float32 => (Kind::Float, RGB.map(String::from).to_vec()),
        Number::Float16 => (Kind::Half, RGB.map(String::from).to_vec()),
    };
    let (width, height) = (image.width, image.height);
    let limit = if number == Number::Float16 { half::f16::MAX.to_f32() } else { f32::MAX };
    let data = image.data.iter().map(|value| value.clamp(-limit, limit)).collect();
    write(path, &Pixels { width, height, channels, data, window: None, attributes: Vec::new() }, kind, Some("zip"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn channels_are_the_same_whether_some_samples_were_without_differences_or_not() {
        let channels = |thinned: bool| {
            let mut frame = Frame::new(3, 2);
            let layers = [Layer::Color, Layer::Samples, Layer::EdgeSamples];
            for layer in layers.into_iter().filter(|layer| thinned || *layer != Layer::EdgeSamples) {
                frame.set(layer, Image::new(3, 2, layer.channel_names().len()));
            }
            let snapshot = Snapshot { frame, layers: Needs::default(), solutions: Vec::new() };
            planes(&snapshot).into_iter().flat_map(|plane| plane.channels).collect::<Vec<_>>()
        };
        assert_eq!(channels(true), channels(false));
        assert_eq!(channels(true), ["R", "G", "B", "samples.Y"]);
    }
}
