//! Statistics that a film records: asked for by methods, decided by the plan.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::statistic::STATISTICS;
use super::tile::CROSS;

/// Statistics that a method asks for besides the colour, or that a film records.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Needs {
    /// Albedo, normal and depth with their variances.
    pub features: bool,
    /// Differences to the neighbouring pixels with their variances.
    pub edges: EdgeNeed,
    /// Means of the [`BINS`](super::BINS) sample groups, of colour and of edges.
    pub bins: bool,
    /// Ambient occlusion with its variance.
    pub occlusion: bool,
    /// World position with its variance.
    pub position: bool,
    /// Bins of the radiance that an ambient light would add, and of its differences.
    pub ambient: bool,
    /// Share of every pixel that is covered.
    #[serde(default)]
    pub alpha: bool,
    /// Number of groups of emitters whose light is recorded by itself.
    #[serde(default)]
    pub lights: u8,
}

/// How a film gets the differences between pixels.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum EdgeNeed {
    /// There are none.
    #[default]
    Off,
    /// The scene scatters no light, so every difference is zero: nothing is sampled, and frames hold zeros.
    KnownZero,
    /// They are sampled by shifted paths, in fewer samples where that is costly.
    Thinned,
    /// They are sampled by shifted paths, in every sample.
    Sampled,
}

impl EdgeNeed {
    /// Whether paths have to be shifted.
    pub fn is_sampled(self) -> bool {
        self >= Self::Thinned
    }

    /// Whether frames have differences, sampled or not.
    pub fn is_on(self) -> bool {
        self != Self::Off
    }
}

impl Needs {
    /// Everything that can be recorded of a scene without groups of emitters.
    pub const ALL: Self = Self {
        features: true,
        edges: EdgeNeed::Sampled,
        bins: true,
        occlusion: true,
        position: true,
        ambient: true,
        alpha: true,
        lights: 0,
    };

    /// Colour alone.
    pub const NONE: Self = Self {
        features: false,
        edges: EdgeNeed::Off,
        bins: false,
        occlusion: false,
        position: false,
        ambient: false,
        alpha: false,
        lights: 0,
    };

    /// Colour and sampled edges.
    pub const EDGES: Self = Self { edges: EdgeNeed::Sampled, ..Self::NONE };

    /// Bytes per pixel of a film with the edges of the cross, as long as the camera sees no emitter directly; 24 more where it
    /// does.
    pub fn bytes_per_pixel(self) -> usize {
        let counts = size_of::<u32>() * (1 + usize::from(self.edges.is_sampled()));
        let recorded = STATISTICS.iter().filter(|statistic| (statistic.recorded)(self) && statistic.sparse.is_none());
        counts
            + recorded
                .map(|statistic| size_of::<f32>() * statistic.span(0, &CROSS, usize::from(self.lights)).len())
                .sum::<usize>()
    }

    /// The same, with sampled differences in every sample.
    pub fn with_every_difference(self) -> Self {
        let edges = if self.edges.is_sampled() { EdgeNeed::Sampled } else { self.edges };
        Self { edges, ..self }
    }

    /// Whether everything that `other` asks for is recorded.
    pub fn cover(self, other: Self) -> bool {
        self.union(other) == self
    }

    /// Everything that either asks for.
    pub fn union(self, other: Self) -> Self {
        Self {
            features: self.features || other.features,
            edges: self.edges.max(other.edges),
            bins: self.bins || other.bins,
            occlusion: self.occlusion || other.occlusion,
            position: self.position || other.position,
            ambient: self.ambient || other.ambient,
            alpha: self.alpha || other.alpha,
            lights: self.lights.max(other.lights),
        }
    }
}
