//! The channels of a file that are its colours, and how their samples become linear Rec. 709.

use std::path::Path;

use crate::error::{Error, Result};
use crate::math::{Rgb, srgb_decode, vec3};
use crate::pixels::{OpenImage, Storage};

/// How the samples of a channel become linear numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Decoding {
    /// They are linear.
    Linear,
    /// Display-encoded, as integers of any size are outside of exr files.
    Srgb,
    /// Gamma-encoded with exponent one over this.
    Gamma(f32),
    /// Integers of an exr file, which OpenImageIO gives as shares of the largest.
    Integer,
}

impl Decoding {
    /// A sample as a linear number.
    #[inline]
    pub fn decode(self, value: f32) -> f32 {
        match self {
            Self::Linear => value,
            Self::Srgb => srgb_decode(value),
            Self::Gamma(gamma) => value.max(0.0).powf(gamma),
            Self::Integer => (f64::from(value) * f64::from(u32::MAX)).round() as f32,
        }
    }
}

/// How a reader wants the integers of display formats.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Integers {
    /// As colours in sRGB.
    #[default]
    Srgb,
    /// As plain numbers.
    Raw,
    /// As colours that were encoded by a power of one over this.
    Gamma(f32),
}

/// Red, green and blue in a file.
#[derive(Clone, Debug)]
pub struct ColorChannels {
    /// Channel of each; the same one thrice for grey.
    pub order: [usize; 3],
    /// How each is decoded.
    pub decoding: [Decoding; 3],
    /// Rows of the matrix to Rec. 709, where the file has other primaries.
    pub to_rec709: Option<[Rgb; 3]>,
}

/// X, Y and Z to Rec. 709.
const FROM_XYZ: [Rgb; 3] = [
    vec3(3.240_479, -1.537_15, -0.498_535),
    vec3(-0.969_256, 1.875_991, 0.041_556),
    vec3(0.055_648, -0.204_043, 1.057_311),
];

/// Names of the layer that is the picture.
const BEAUTY: &[&str] = &["combined", "beauty", "rgba", "c"];

/// Names of a single channel of luminance.
const GREY: &[&str] = &["y", "l", "i", "grey", "gray", "luminance"];

/// Names of a single channel that is taken for grey: those of luminance, red alone, and masks.
const ALONE: &[&str] = &["y", "l", "i", "grey", "gray", "luminance", "r", "a"];

impl ColorChannels {
    /// The colours of a file: R, G and B, or X, Y and Z, or grey, with or without alpha; if all its channels belong to one
    /// layer, that layer's.
    pub fn of(file: &impl OpenImage, path: &Path, integers: Integers) -> Result<Self> {
        let (order, is_xyz) = choose(&file.channels).ok_or_else(|| {
            let names = file.channels.join(", ");
            Error::io(
                path,
                format!(
                    "no colours were found among the channels {names}; give it R, G and B, or Y, or one layer of them"
                ),
            )
        })?;
        let own = || file.attribute("chromaticities").and_then(|text| primaries(&text));
        let is_grey = order[0] == order[1];
        let to_rec709 = if is_xyz { Some(FROM_XYZ) } else { own().filter(|_| !is_grey && file.format == "openexr") };
        Ok(Self { order, decoding: order.map(|channel| decoding(file, channel, integers)), to_rec709 })
    }

    /// A single channel by its name, as grey. Alpha is linear in every file.
    pub fn single(file: &impl OpenImage, path: &Path, name: &str, integers: Integers) -> Result<Self> {
        let wanted = name.to_lowercase();
        let fits = |other: &String| {
            let other = other.to_lowercase();
            other == wanted || (GREY.contains(&other.as_str()) && ["l", "y"].contains(&wanted.as_str()))
        };
        let channel = file
            .channels
            .iter()
            .position(fits)
            .ok_or_else(|| Error::io(path, format!("no channel `{name}` among {}", file.channels.join(", "))))?;
        let decoding = decoding(file, channel, if wanted == "a" { Integers::Raw } else { integers });
        Ok(Self { order: [channel; 3], decoding: [decoding; 3], to_rec709: None })
    }

    /// Channel of the alpha that belongs to the colours, if there is one.
    pub fn alpha(&self, file: &impl OpenImage) -> Option<usize> {
        let layer = |name: &str| name.rsplit_once('.').map_or(String::new(), |(layer, _)| layer.to_lowercase());
        let own = layer(&file.channels[self.order[0]]);
        let is_alpha = |name: &String| name.rsplit('.').next().is_some_and(|part| part.eq_ignore_ascii_case("a"));
        file.channels.iter().position(|name| is_alpha(name) && layer(name) == own).filter(|at| !self.order.contains(at))
    }

    /// The linear colour of a pixel's samples.
    #[inline]
    pub fn color(&self, pixel: &[f32]) -> Rgb {
        let value = |k: usize| self.decoding[k].decode(pixel[self.order[k]]);
        let color = vec3(value(0), value(1), value(2));
        self.to_rec709.map_or(color, |rows| vec3(rows[0].dot(color), rows[1].dot(color), rows[2].dot(color)))
    }

    /// Whether each channel is eight bits of sRGB or of plain numbers, for tables of all values.
    pub fn is_eight_bit(&self, file: &impl OpenImage) -> bool {
        let simple = |decoding: &Decoding| *decoding == self.decoding[0] && !matches!(decoding, Decoding::Gamma(_));
        file.is_eight_bit() && self.to_rec709.is_none() && self.decoding.iter().all(simple)
    }
}

fn decoding(file: &impl OpenImage, channel: usize, integers: Integers) -> Decoding {
    match file.storage[channel] {
        Storage::Unsigned(_) if file.format == "openexr" => Decoding::Integer,
        Storage::Unsigned(_) => match integers {
            Integers::Srgb => Decoding::Srgb,
            Integers::Raw => Decoding::Linear,
            Integers::Gamma(gamma) => Decoding::Gamma(gamma),
        },
        _ => Decoding::Linear,
    }
}

/// Positions of the colours, and whether they are X, Y and Z.
fn choose(channels: &[String]) -> Option<([usize; 3], bool)> {
    let names: Vec<_> = channels.iter().map(|name| name.to_lowercase()).collect();
    let split = |name: &'_ str| match name.rsplit_once('.') {
        Some((layer, channel)) => (layer.to_owned(), channel.to_owned()),
        None => (String::new(), name.to_owned()),
    };
    let parts: Vec<_> = names.iter().map(|name| split(name)).collect();
    let of_layer = |layer: &str| {
        let find = |wanted: &str| parts.iter().position(|(other, channel)| other == layer && channel == wanted);
        let three = |names: [&str; 3]| Some([find(names[0])?, find(names[1])?, find(names[2])?]);
        let own = || parts.iter().enumerate().filter(|(_, (other, channel))| other == layer && channel != "a");
        let grey = || match (own().next(), own().count()) {
            (Some((at, (_, channel))), 1) if GREY.contains(&channel.as_str()) => Some([at; 3]),
            _ => None,
        };
        let rgb = three(["r", "g", "b"]).map(|order| (order, false));
        rgb.or_else(|| Some((three(["x", "y", "z"])?, true))).or_else(|| Some((grey()?, false)))
    };
    let mut layers: Vec<_> = parts.iter().map(|(layer, _)| layer.as_str()).filter(|layer| !layer.is_empty()).collect();
    layers.sort_unstable();
    layers.dedup();
    match (of_layer(""), parts.as_slice(), layers.as_slice()) {
        (Some(found), ..) => Some(found),
        (None, [(_, only)], _) => ALONE.contains(&only.as_str()).then_some(([0; 3], false)),
        (None, _, [layer]) if parts.iter().all(|(other, _)| other == layer) => of_layer(layer),
        // Of several layers the picture itself, as Blender and compositors name it, or the only one with colours.
        (None, _, layers) => {
            let of_name = |name: &&str| -> Vec<_> {
                let named = || layers.iter().filter(|layer| layer.rsplit('.').next() == Some(name));
                // What a compositor has made of the others counts where there are no others.
                let composed = |layer: &&&&str| layer.starts_with("composite.");
                let rendered: Vec<_> = named().filter(|layer| !composed(&layer)).collect();
                let chosen = if rendered.is_empty() { named().collect() } else { rendered };
                chosen.into_iter().filter_map(|layer| of_layer(layer)).collect()
            };
            let named = BEAUTY.iter().map(of_name).find(|found| !found.is_empty()).unwrap_or_default();
            let colored = layers.iter().filter_map(|layer| of_layer(layer)).filter(|(order, _)| order[0] != order[1]);
            let colored: Vec<_> = colored.filter(|(_, is_xyz)| !is_xyz).collect();
            match (named.as_slice(), colored.as_slice()) {
                ([found], _) | ([], [found]) => Some(*found),
                _ => None,
            }
        }
    }
}

/// Rows of the matrix from the primaries of an exr file (x and y of red, green, blue and white) to Rec. 709; none if they
/// are its own. White is left as it is.
fn primaries(text: &str) -> Option<[Rgb; 3]> {
    const REC709: [f32; 8] = [0.64, 0.33, 0.30, 0.60, 0.15, 0.06, 0.3127, 0.3290];
    let numbers: Vec<f32> = text.split([',', ' ']).filter_map(|number| number.trim().parse().ok()).collect();
    let found: [f32; 8] = numbers.try_into().ok()?;
    if found.iter().zip(REC709).all(|(a, b)| (a - b).abs() < 1e-3) {
        return None;
    }
    let xyz = |k: usize| vec3(found[2 * k], found[2 * k + 1], 1.0 - found[2 * k] - found[2 * k + 1]);
    let columns = glam::Mat3::from_cols(xyz(0), xyz(1), xyz(2));
    let white = xyz(3) / found[7];
    if columns.determinant().abs() < 1e-9 || !white.is_finite() {
        return None;
    }
    let scale = columns.inverse() * white;
    let to_xyz = columns * glam::Mat3::from_diagonal(scale);
    let from_xyz = glam::Mat3::from_cols(FROM_XYZ[0], FROM_XYZ[1], FROM_XYZ[2]).transpose();
    let rows = (from_xyz * to_xyz).transpose();
    Some([rows.x_axis, rows.y_axis, rows.z_axis])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colours_are_told_from_the_names_of_channels() {
        let names = |text: &str| text.split(' ').map(String::from).collect::<Vec<_>>();
        for (channels, expected) in [
            ("R G B", Some(([0, 1, 2], false))),
            ("A B G R", Some(([3, 2, 1], false))),
            ("r g b", Some(([0, 1, 2], false))),
            (".R .G .B", Some(([0, 1, 2], false))),
            ("beauty.B beauty.G beauty.R", Some(([2, 1, 0], false))),
            ("beauty.Y beauty.A", Some(([0; 3], false))),
            ("X Y Z", Some(([0, 1, 2], true))),
            ("Y", Some(([0; 3], false))),
            ("A Y", Some(([1; 3], false))),
            ("depth", None),
            ("Z", None),
            ("depth.Z", None),
            ("R", Some(([0; 3], false))),
            ("depth.Z rgba.R rgba.G rgba.B", Some(([1, 2, 3], false))),
            ("depth.Z N.X N.Y N.Z main.B main.G main.R", Some(([6, 5, 4], false))),
            ("depth.Z N.X N.Y N.Z", None),
            (
                "back.Combined.R back.Combined.G back.Combined.B front.Combined.R front.Combined.G front.Combined.B",
                None,
            ),
            ("R G B depth.Z normal.X", Some(([0, 1, 2], false))),
            ("R G", None),
            ("U V", None),
            ("A", Some(([0; 3], false))),
            ("Y RY BY", None),
            ("a.R a.G a.B b.R b.G b.B", None),
            ("V.Depth.Z V.Combined.R V.Combined.G V.Combined.B V.Combined.A", Some(([1, 2, 3], false))),
        ] {
            assert_eq!(choose(&names(channels)), expected, "{channels}");
        }
    }

    /// Expected colours are those that Mitsuba 3.9.1 shows for (0.3, 0.7, 2.5) with the primaries of Rec. 2020.
    #[test]
    fn other_primaries_become_those_of_rec_709() {
        let rows = primaries("0.708, 0.292, 0.17, 0.797, 0.131, 0.046, 0.3127, 0.329").unwrap();
        let color = vec3(0.3, 0.7, 2.5);
        let converted = vec3(rows[0].dot(color), rows[1].dot(color), rows[2].dot(color));
        assert!(converted.distance(vec3(-0.095_326, 0.734_791, 2.720_97)) < 2e-3, "{converted}");
        assert!(primaries("0.64 0.33 0.3 0.6 0.15 0.06 0.3127 0.329").is_none());
        assert!(primaries("0 0 0 0 0 0 0 0").is_none() && primaries("nonsense").is_none());
    }
}
