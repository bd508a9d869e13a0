//! Light of groups of emitters as images, by themselves and in files.

use super::statistics::{LIGHT, Record};
use super::{Film, Tile};
use crate::image::Image;

/// The light of a group of emitters.
#[derive(Clone, Debug, PartialEq)]
pub struct LightLayers {
    /// The group's name.
    pub name: String,
    /// Its share of the scattered radiance; those of all groups add up to the colour.
    pub color: Image,
    /// Its share of what the camera sees directly.
    pub direct: Image,
}

/// Beginnings of the names of channels, as in `light.key.R` and `light_direct.key.R`.
const NAMES: [&str; 2] = ["light", "light_direct"];

const RGB: [&str; 3] = ["R", "G", "B"];

/// Name of a channel.
fn channel_name(image: usize, group: &str, c: usize) -> String {
    format!("{}.{group}.{}", NAMES[image], RGB[c])
}

impl LightLayers {
    /// Its images in the order of their names.
    fn images(&self) -> [&Image; 2] {
        [&self.color, &self.direct]
    }

    /// Channels for files, by name, each with the values of all pixels.
    pub(super) fn channels(&self) -> Vec<(String, Vec<f32>)> {
        let channel = |image: usize, c: usize| {
            let values = self.images()[image].data.iter().skip(c).step_by(RGB.len()).copied();
            (channel_name(image, &self.name, c), values.collect())
        };
        (0..NAMES.len()).flat_map(|image| (0..RGB.len()).map(move |c| (image, c))).map(|(i, c)| channel(i, c)).collect()
    }

    /// The groups of a file with these channels; `channel` finds one by its name.
    pub(super) fn of_file(
        (width, height): (usize, usize),
        names: &[String],
        channel: impl Fn(&str) -> Option<Vec<f32>>,
    ) -> Vec<Self> {
        let group = |name: &String| Some(name.strip_prefix("light.")?.strip_suffix(".R")?.to_owned());
        let image = |image: usize, group: &str| {
            let planes = [0, 1, 2].map(|c| channel(&channel_name(image, group, c)));
            let [Some(r), Some(g), Some(b)] = planes else { return None };
            let data = r.iter().zip(&g).zip(&b).flat_map(|((r, g), b)| [*r, *g, *b]).collect();
            Some(Image { width, height, channels: RGB.len(), data })
        };
        let layers = |name: String| Some(Self { color: image(0, &name)?, direct: image(1, &name)?, name });
        names.iter().filter_map(group).filter_map(layers).collect()
    }
}

impl Film {
    /// Light of all groups of emitters.
    pub(super) fn develop_lights(&self) -> Vec<LightLayers> {
        let of_group = |group: usize| {
            let mean = |first: usize| {
                let value = move |tile: &Tile, i: usize, c: usize| {
                    tile.values(Record::Lights, i).map_or(0.0, |values| values[LIGHT * group + first + c])
                };
                self.image(RGB.len(), value)
            };
            let name = self.lights.get(group).cloned().unwrap_or_else(|| group.to_string());
            LightLayers { name, color: mean(0), direct: mean(RGB.len()) }
        };
        (0..usize::from(self.needs.lights)).map(of_group).collect()
    }
}
