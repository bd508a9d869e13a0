//! The table of layers: every image that a film develops into, with its name in files, its unit and range, and the
//! statistic that its values come from.

use super::source::{Source, X, Y};

/// A named image. The bins' layers carry the bin's number.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Layer {
    /// Scattered radiance.
    Color,
    /// Variance of [`Layer::Color`].
    ColorVariance,
    /// Radiance of emitters that the camera sees directly.
    Direct,
    /// Variance of [`Layer::Direct`].
    DirectVariance,
    /// Albedo of the material.
    Albedo,
    /// Variance of [`Layer::Albedo`].
    AlbedoVariance,
    /// Shading normal.
    Normal,
    /// Variance of [`Layer::Normal`].
    NormalVariance,
    /// Path length from the camera.
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
    /// Share of the pixel that is covered.
    Alpha,
    /// Variance of [`Layer::Alpha`].
    AlphaVariance,
    /// Sample counts.
    Samples,
    /// Counts of samples with differences, where these are others than [`Layer::Samples`].
    EdgeSamples,
    /// Counts of samples that were not finite.
    Rejected,
    /// Colour of one bin.
    BinColor(u8),
    /// Horizontal differences of one bin.
    BinDx(u8),
    /// Vertical differences of one bin.
    BinDy(u8),
    /// Radiance that an ambient light would add, of one bin.
    BinAmbient(u8),
    /// Horizontal differences of the ambient light, of one bin.
    BinAmbientDx(u8),
    /// Vertical differences of the ambient light, of one bin.
    BinAmbientDy(u8),
}

/// A row of the table of layers.
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
    /// The option of `render` that records it; `always`, or a method as an example of those that need it.
    pub flag: &'static str,
    /// Description for tables.
    pub summary: &'static str,
    pub(super) source: Source,
}

const RGB: &[&str] = &["R", "G", "B"];
const XYZ: &[&str] = &["X", "Y", "Z"];

/// A row from its unit, range and flag.
const fn info(
    name: &'static str,
    channels: &'static [&'static str],
    [unit, range, flag]: [&'static str; 3],
    source: Source,
    summary: &'static str,
) -> Info {
    Info { name, channels, unit, range, flag, summary, source }
}

/// Layers that a frame has once, in the order of the enumeration.
pub(super) const SINGLE: &[(Layer, Info)] = {
    use self::Layer as L;
    use super::source::Source::{EdgeMean, EdgeSampleCount, EdgeVariance, Mean, RejectedCount, SampleCount, Variance};
    use super::statistics::Record::{Alpha, Color, Direct, Edges, Occlusion, Position, Surface};
    const RADIANCE: [&str; 3] = ["radiance", ">= 0", "always"];
    const RADIANCE_VARIANCE: [&str; 3] = ["radiance²", ">= 0", "always"];
    const DIFFERENCE: [&str; 3] = ["radiance", "any", "--method l2"];
    const DIFFERENCE_VARIANCE: [&str; 3] = ["radiance²", ">= 0", "--method l2"];
    const UNIT_VARIANCE: [&str; 3] = ["1", ">= 0", "--layers"];
    const COUNT: [&str; 3] = ["count", ">= 0", "always"];
    &[
        (L::Color, info("", RGB, RADIANCE, Mean(Color, 0), "scattered radiance without `direct`: mean of all samples")),
        (
            L::ColorVariance,
            info("variance", RGB, RADIANCE_VARIANCE, Variance(Color, 0), "variance of the mean of the colour"),
        ),
        (
            L::Direct,
            info(
                "direct",
                RGB,
                RADIANCE,
                Mean(Direct, 0),
                "emitters that the camera sees directly; add it to the colour",
            ),
        ),
        (
            L::DirectVariance,
            info("direct_variance", RGB, RADIANCE_VARIANCE, Variance(Direct, 0), "variance of the mean of `direct`"),
        ),
        (
            L::Albedo,
            info(
                "albedo",
                RGB,
                ["1", "[0, 1]", "--layers"],
                Mean(Surface, 0),
                "albedo of the first surface that is no mirror or clear glass",
            ),
        ),
        (
            L::AlbedoVariance,
            info("albedo_variance", RGB, UNIT_VARIANCE, Variance(Surface, 0), "variance of the mean of the albedo"),
        ),
        (
            L::Normal,
            info(
                "normal",
                XYZ,
                ["1", "[-1, 1]", "--layers"],
                Mean(Surface, 3),
                "shading normal of that surface, in world space, towards the viewer",
            ),
        ),
        (
            L::NormalVariance,
            info("normal_variance", XYZ, UNIT_VARIANCE, Variance(Surface, 3), "variance of the mean of the normal"),
        ),
        (
            L::Depth,
            info(
                "depth",
                &["Z"],
                ["scene units", ">= 0", "--layers"],
                Mean(Surface, 6),
                "length of the path to that surface; beyond the scene where nothing is hit",
            ),
        ),
        (
            L::DepthVariance,
            info(
                "depth_variance",
                &["Z"],
                ["scene units²", ">= 0", "--layers"],
                Variance(Surface, 6),
                "variance of the mean of the depth",
            ),
        ),
        (
            L::Occlusion,
            info(
                "occlusion",
                &["Y"],
                ["1", "[0, 1]", "--occlusion"],
                Mean(Occlusion, 0),
                "ambient occlusion of that surface: cosine-weighted share of directions that are free for a tenth of the scene's size",
            ),
        ),
        (
            L::OcclusionVariance,
            info(
                "occlusion_variance",
                &["Y"],
                ["1", ">= 0", "--occlusion"],
                Variance(Occlusion, 0),
                "variance of the mean of the occlusion",
            ),
        ),
        (
            L::Position,
            info(
                "position",
                XYZ,
                ["scene units", "any", "--position"],
                Mean(Position, 0),
                "the point on that surface, in world space; beyond the scene where nothing is hit",
            ),
        ),
        (
            L::PositionVariance,
            info(
                "position_variance",
                XYZ,
                ["scene units²", ">= 0", "--position"],
                Variance(Position, 0),
                "variance of the mean of the position",
            ),
        ),
        (
            L::Dx,
            info(
                "dx",
                RGB,
                DIFFERENCE,
                EdgeMean(Edges, X),
                "colour(x + 1, y) - colour(x, y); zero in the last column, which has no edge",
            ),
        ),
        (L::DxVariance, info("dx_variance", RGB, DIFFERENCE_VARIANCE, EdgeVariance(Edges, X), "variance of dx")),
        (
            L::Dy,
            info(
                "dy",
                RGB,
                DIFFERENCE,
                EdgeMean(Edges, Y),
                "colour(x, y + 1) - colour(x, y); zero in the last row, which has no edge",
            ),
        ),
        (L::DyVariance, info("dy_variance", RGB, DIFFERENCE_VARIANCE, EdgeVariance(Edges, Y), "variance of dy")),
        (
            L::Alpha,
            info(
                "",
                &["A"],
                ["1", "[0, 1]", "pixel_format"],
                Mean(Alpha, 0),
                "share of the samples that met something; colour and `direct` are multiplied by it already",
            ),
        ),
        (
            L::AlphaVariance,
            info(
                "alpha_variance",
                &["Y"],
                ["1", ">= 0", "pixel_format"],
                Variance(Alpha, 0),
                "variance of the mean of the alpha",
            ),
        ),
        (L::Samples, info("samples", &["Y"], COUNT, SampleCount, "samples of the pixel")),
        (
            L::EdgeSamples,
            info(
                "edge_samples",
                &["Y"],
                ["count", ">= 0", "--method l2"],
                EdgeSampleCount,
                "samples of the pixel that its differences were sampled with; absent where that is all of them",
            ),
        ),
        (L::Rejected, info("rejected", &["Y"], COUNT, RejectedCount, "samples that were not finite and count as zero")),
    ]
};

/// Layers that every bin has.
pub(super) const BINNED: [Info; 6] = {
    use super::source::Source::{Bin, EdgeBin};
    use super::statistics::Record::{AmbientBins, AmbientEdgeBins, ColorBins, EdgeBins};
    const DIFFERENCE: [&str; 3] = ["radiance", "any", "--bins"];
    const AMBIENT_DIFFERENCE: [&str; 3] = ["1", "any", "--ambient"];
    [
        info(
            "bin",
            RGB,
            ["radiance", ">= 0", "--bins"],
            Bin(ColorBins),
            "colour of the samples whose number is k modulo 8",
        ),
        info("bin_dx", RGB, DIFFERENCE, EdgeBin(EdgeBins, X), "dx of the samples of bin k"),
        info("bin_dy", RGB, DIFFERENCE, EdgeBin(EdgeBins, Y), "dy of the samples of bin k"),
        info(
            "bin_ambient",
            RGB,
            ["1", ">= 0", "--ambient"],
            Bin(AmbientBins),
            "radiance that an unoccluded ambient light of radiance one would add to the colour of bin k",
        ),
        info("bin_ambient_dx", RGB, AMBIENT_DIFFERENCE, EdgeBin(AmbientEdgeBins, X), "dx of that radiance"),
        info("bin_ambient_dy", RGB, AMBIENT_DIFFERENCE, EdgeBin(AmbientEdgeBins, Y), "dy of that radiance"),
    ]
};

/// Constructors of a bin's layers, in the order of [`BINNED`].
pub(super) const OF_BIN: [fn(u8) -> Layer; BINNED.len()] =
    [Layer::BinColor, Layer::BinDx, Layer::BinDy, Layer::BinAmbient, Layer::BinAmbientDx, Layer::BinAmbientDy];
