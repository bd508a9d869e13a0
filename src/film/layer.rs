//! The table of layers: every image that rendering can leave behind, with its name in files, unit and range.

use super::BINS;

/// A named image. The bins' layers carry the bin's number.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Layer {
    /// Scattered radiance.
    Color,
    /// Variance of [`Layer::Color`].
    ColorVariance,
    /// Radiance of emitters seen directly.
    Direct,
    /// Variance of [`Layer::Direct`].
    DirectVariance,
    /// Material colour.
    Albedo,
    /// Variance of [`Layer::Albedo`].
    AlbedoVariance,
    /// Shading normal.
    Normal,
    /// Variance of [`Layer::Normal`].
    NormalVariance,
    /// Distance.
    Depth,
    /// Variance of [`Layer::Depth`].
    DepthVariance,
    /// Ambient occlusion.
    Occlusion,
    /// Variance of [`Layer::Occlusion`].
    OcclusionVariance,
    /// World position.
    Position,
    /// Variance of [`Layer::Position`].
    PositionVariance,
    /// Horizontal differences.
    Dx,
    /// Variance of [`Layer::Dx`].
    DxVariance,
    /// Vertical differences.
    Dy,
    /// Variance of [`Layer::Dy`].
    DyVariance,
    /// Sample counts.
    Samples,
    /// Counts of samples that were not finite.
    Rejected,
    /// Colour of one bin.
    BinColor(u8),
    /// Horizontal differences of one bin.
    BinDx(u8),
    /// Vertical differences of one bin.
    BinDy(u8),
    /// Ambient light of one bin.
    BinAmbient(u8),
    /// Its horizontal differences.
    BinAmbientDx(u8),
    /// Its vertical differences.
    BinAmbientDy(u8),
}

/// What is to be known of a layer.
#[derive(Clone, Copy, Debug)]
pub struct Info {
    /// Part of the channel names before the dot; empty for the colour itself.
    pub name: &'static str,
    /// Channel names after the dot.
    pub channels: &'static [&'static str],
    /// Unit of the values.
    pub unit: &'static str,
    /// Range of the values.
    pub range: &'static str,
    /// The option of `render` that records it.
    pub flag: &'static str,
    /// What it is.
    pub summary: &'static str,
}

const RGB: &[&str] = &["R", "G", "B"];
const XYZ: &[&str] = &["X", "Y", "Z"];
const Z: &[&str] = &["Z"];
const Y: &[&str] = &["Y"];

const fn info(
    name: &'static str,
    channels: &'static [&'static str],
    [unit, range, flag]: [&'static str; 3],
    summary: &'static str,
) -> Info {
    Info { name, channels, unit, range, flag, summary }
}

/// Layers that are there once, in the order of the enumeration.
const SINGLE: [(Layer, Info); 20] = [
    (
        Layer::Color,
        info("", RGB, ["radiance", ">= 0", "always"], "scattered radiance without `direct`: mean of all samples"),
    ),
    (
        Layer::ColorVariance,
        info("variance", RGB, ["radiance²", ">= 0", "always"], "variance of the mean of the colour"),
    ),
    (
        Layer::Direct,
        info(
            "direct",
            RGB,
            ["radiance", ">= 0", "always"],
            "emitters that the camera sees directly; add it to the colour",
        ),
    ),
    (
        Layer::DirectVariance,
        info("direct_variance", RGB, ["radiance²", ">= 0", "always"], "variance of the mean of `direct`"),
    ),
    (
        Layer::Albedo,
        info(
            "albedo",
            RGB,
            ["1", "[0, 1]", "--layers"],
            "material colour at the first surface that is no mirror or clear glass",
        ),
    ),
    (
        Layer::AlbedoVariance,
        info("albedo_variance", RGB, ["1", ">= 0", "--layers"], "variance of the mean of the albedo"),
    ),
    (
        Layer::Normal,
        info("normal", XYZ, ["1", "[-1, 1]", "--layers"], "shading normal there, in world space, towards the viewer"),
    ),
    (
        Layer::NormalVariance,
        info("normal_variance", XYZ, ["1", ">= 0", "--layers"], "variance of the mean of the normal"),
    ),
    (
        Layer::Depth,
        info(
            "depth",
            Z,
            ["scene units", ">= 0", "--layers"],
            "length of the path to there; beyond the scene where nothing is hit",
        ),
    ),
    (
        Layer::DepthVariance,
        info("depth_variance", Z, ["scene units²", ">= 0", "--layers"], "variance of the mean of the depth"),
    ),
    (
        Layer::Occlusion,
        info(
            "occlusion",
            Y,
            ["1", "[0, 1]", "--occlusion"],
            "ambient occlusion there: share of directions, by their cosine, that are open for a tenth of the scene",
        ),
    ),
    (
        Layer::OcclusionVariance,
        info("occlusion_variance", Y, ["1", ">= 0", "--occlusion"], "variance of the mean of the occlusion"),
    ),
    (
        Layer::Position,
        info(
            "position",
            XYZ,
            ["scene units", "any", "--position"],
            "the point, in world space; beyond the scene where nothing is hit",
        ),
    ),
    (
        Layer::PositionVariance,
        info("position_variance", XYZ, ["scene units²", ">= 0", "--position"], "variance of the mean of the position"),
    ),
    (
        Layer::Dx,
        info(
            "dx",
            RGB,
            ["radiance", "any", "--method l2"],
            "colour(x + 1, y) - colour(x, y); zero in the last column, which has no edge",
        ),
    ),
    (Layer::DxVariance, info("dx_variance", RGB, ["radiance²", ">= 0", "--method l2"], "variance of dx")),
    (
        Layer::Dy,
        info(
            "dy",
            RGB,
            ["radiance", "any", "--method l2"],
            "colour(x, y + 1) - colour(x, y); zero in the last row, which has no edge",
        ),
    ),
    (Layer::DyVariance, info("dy_variance", RGB, ["radiance²", ">= 0", "--method l2"], "variance of dy")),
    (Layer::Samples, info("samples", Y, ["count", ">= 0", "always"], "samples of the pixel")),
    (
        Layer::Rejected,
        info("rejected", Y, ["count", ">= 0", "always"], "samples that were not finite and count as zero"),
    ),
];

const BINNED: [Info; 6] = [
    info("bin", RGB, ["radiance", ">= 0", "--bins"], "colour of the samples whose number is k modulo 8"),
    info("bin_dx", RGB, ["radiance", "any", "--bins"], "dx of those samples"),
    info("bin_dy", RGB, ["radiance", "any", "--bins"], "dy of those samples"),
    info(
        "bin_ambient",
        RGB,
        ["1", ">= 0", "--ambient"],
        "what an ambient light of radiance one, blocked by nothing, adds to their colour",
    ),
    info("bin_ambient_dx", RGB, ["1", "any", "--ambient"], "what it adds to their dx"),
    info("bin_ambient_dy", RGB, ["1", "any", "--ambient"], "what it adds to their dy"),
];

/// A bin's layers, in the order of [`BINNED`].
const OF_BIN: [fn(u8) -> Layer; BINNED.len()] =
    [Layer::BinColor, Layer::BinDx, Layer::BinDy, Layer::BinAmbient, Layer::BinAmbientDx, Layer::BinAmbientDy];

impl Layer {
    /// Whether a value below zero is a mistake: variances and counts. Radiance may be negative where someone has filtered
    /// it.
    pub fn is_never_negative(self) -> bool {
        matches!(self, Self::Samples | Self::Rejected) || self.info().name.ends_with("variance")
    }

    /// Number of layers.
    pub const COUNT: usize = SINGLE.len() + BINNED.len() * BINS;

    /// Every layer.
    pub fn all() -> impl Iterator<Item = Self> {
        let bins = (0..BINS as u8).flat_map(|k| OF_BIN.map(|layer| layer(k)));
        SINGLE.iter().map(|(layer, _)| *layer).chain(bins)
    }

    /// Position among all layers.
    pub fn index(self) -> usize {
        match self.bin() {
            Some((which, k)) => SINGLE.len() + BINNED.len() * k as usize + which,
            None => SINGLE.iter().position(|(layer, _)| *layer == self).unwrap_or_default(),
        }
    }

    /// Number of the bin, of layers that every bin has.
    pub fn bin_number(self) -> Option<u8> {
        self.bin().map(|(_, number)| number)
    }

    /// Row of [`BINNED`] and number of the bin.
    fn bin(self) -> Option<(usize, u8)> {
        match self {
            Self::BinColor(k) => Some((0, k)),
            Self::BinDx(k) => Some((1, k)),
            Self::BinDy(k) => Some((2, k)),
            Self::BinAmbient(k) => Some((3, k)),
            Self::BinAmbientDx(k) => Some((4, k)),
            Self::BinAmbientDy(k) => Some((5, k)),
            _ => None,
        }
    }

    /// The layer's row of the table; of a binned layer without its number.
    pub fn info(self) -> Info {
        match self.bin() {
            Some((which, _)) => BINNED[which],
            None => SINGLE[self.index()].1,
        }
    }

    /// Name in files, with the bin's number: `bin3_dx`.
    pub fn name(self) -> String {
        match self.bin() {
            Some((which, k)) => BINNED[which].name.replacen("bin", &format!("bin{k}"), 1),
            None => self.info().name.to_owned(),
        }
    }

    /// Channel names in files: `albedo.R`, or `R` for the colour.
    pub fn channel_names(self) -> Vec<String> {
        let name = self.name();
        let full = |channel: &&str| if name.is_empty() { (*channel).to_owned() } else { format!("{name}.{channel}") };
        self.info().channels.iter().map(full).collect()
    }
}

#[cfg(test)]
mod tests {
    use std::collections::HashSet;

    use super::*;

    #[test]
    fn every_layer_has_its_own_index_and_channel_names() {
        let layers: Vec<_> = Layer::all().collect();
        assert_eq!(layers.len(), Layer::COUNT);
        for (i, layer) in layers.iter().enumerate() {
            assert_eq!(layer.index(), i);
        }
        let names: HashSet<_> = layers.iter().flat_map(|layer| layer.channel_names()).collect();
        assert_eq!(names.len(), layers.iter().map(|layer| layer.info().channels.len()).sum::<usize>());
    }
}
