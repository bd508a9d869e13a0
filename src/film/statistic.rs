//! The table of statistics: everything that a film accumulates per pixel. Tiles, checkpoint files, merging and the memory
//! of a film are driven by it; [`layer`](super::layer) says which images are developed from which statistic.

use std::ops::Range;

use super::{BINS, EdgeNeed, Needs, Sample, Taken};
use crate::math::Rgb;

/// Rows of [`STATISTICS`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Record {
    Color,
    Direct,
    /// Albedo, normal and depth.
    Surface,
    Occlusion,
    Position,
    /// One end's share of the differences, of every half-edge.
    Edges,
    ColorBins,
    EdgeBins,
    AmbientBins,
    AmbientEdgeBins,
    Alpha,
    /// Scattered and directly seen light of every group of emitters.
    Lights,
}

/// A statistic of every pixel.
pub(super) struct Statistic {
    /// Number of values in a sample, of a half-edge, or of a group of emitters.
    values: usize,
    pub kind: Kind,
    /// Whether it has values of every half-edge, and counts the samples with differences instead of all samples.
    pub of_edges: bool,
    /// Whether it has values of every group of emitters.
    of_lights: bool,
    /// If set, the statistic takes no memory in a tile until it says that a sample has a value other than zero.
    pub sparse: Option<fn(&Sample) -> bool>,
    /// Whether a film with these needs has it.
    pub recorded: fn(Needs) -> bool,
    accumulate: fn(Slot, Taken),
}

/// How samples are accumulated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    /// Mean of every value, then sum of the squared deviations from the mean of every value.
    Moments,
    /// Mean of every value in each bin, bin by bin.
    Bins,
}

const fn moments(values: usize, recorded: fn(Needs) -> bool, accumulate: fn(Slot, Taken)) -> Statistic {
    Statistic { values, kind: Kind::Moments, of_edges: false, of_lights: false, sparse: None, recorded, accumulate }
}

const fn bins(values: usize, recorded: fn(Needs) -> bool, accumulate: fn(Slot, Taken)) -> Statistic {
    Statistic { kind: Kind::Bins, ..moments(values, recorded, accumulate) }
}

const fn of_edges(statistic: Statistic) -> Statistic {
    Statistic { of_edges: true, ..statistic }
}

/// Every statistic, in the order of [`Record`] and of checkpoint files.
pub(super) const STATISTICS: [Statistic; 12] = [
    moments(3, |_| true, |slot, taken| slot.add(taken.sample.color.to_array())),
    Statistic {
        sparse: Some(|sample| sample.direct != Rgb::ZERO),
        ..moments(3, |_| true, |slot, taken| slot.add(taken.sample.direct.to_array()))
    },
    moments(7, |needs| needs.features, |slot, taken| slot.add(taken.sample.features.surface())),
    moments(1, |needs| needs.occlusion, |slot, taken| slot.add([taken.sample.features.occlusion])),
    moments(3, |needs| needs.position, |slot, taken| slot.add(taken.sample.features.position.to_array())),
    of_edges(moments(3, |needs| needs.edges.is_sampled(), |slot, taken| slot.add_colors(taken.colors()))),
    bins(3, |needs| needs.bins, |slot, taken| slot.add_to_bin(taken.sample.color.to_array())),
    of_edges(bins(
        3,
        |needs| needs.bins && needs.edges.is_sampled(),
        |slot, taken| slot.add_colors_to_bin(taken.colors()),
    )),
    bins(3, |needs| needs.ambient, |slot, taken| slot.add_to_bin(taken.sample.ambient.to_array())),
    of_edges(bins(
        3,
        |needs| needs.ambient && needs.edges.is_sampled(),
        |slot, taken| slot.add_colors_to_bin(taken.ambients()),
    )),
    moments(1, |needs| needs.alpha, |slot, taken| slot.add([taken.sample.alpha])),
    Statistic {
        of_lights: true,
        ..moments(
            LIGHT,
            |needs| needs.lights > 0,
            |slot, taken| {
                slot.add_all(LIGHT * taken.lights.len(), taken.lights.iter().flat_map(|light| light.values()));
            },
        )
    },
];

/// Values of a group of emitters: three of its scattered light, then three of what is directly seen.
pub(super) const LIGHT: usize = 6;

/// Position of a sample among those of its pixel, as the weights that means are updated with.
#[derive(Clone, Copy)]
pub(super) struct Ordinal {
    /// One over the number of samples, this one included.
    share: f32,
    bin: usize,
    /// One over the number of samples in its bin, this one included.
    bin_share: f32,
}

impl Ordinal {
    /// The sample that comes after `count` others.
    pub fn after(count: u32) -> Self {
        let count = count as usize;
        Self { share: 1.0 / (count as u32 + 1) as f32, bin: count % BINS, bin_share: 1.0 / (count / BINS + 1) as f32 }
    }
}

/// A pixel's values of one statistic, and the number of the sample to be added to them.
pub(super) struct Slot<'a> {
    values: &'a mut [f32],
    ordinal: Ordinal,
}

impl Slot<'_> {
    /// Updates means and sums of squared deviations (Welford 1962).
    #[inline(always)]
    fn add<const N: usize>(self, values: [f32; N]) {
        self.add_all(N, values.into_iter());
    }

    /// The same for the colours of all half-edges.
    #[inline(always)]
    fn add_colors(self, colors: &[Rgb]) {
        match <&[Rgb; 4]>::try_from(colors) {
            Ok(cross) => self.add(flatten(cross)),
            Err(_) => self.add_all(3 * colors.len(), colors.iter().flat_map(|color| color.to_array())),
        }
    }

    #[inline(always)]
    fn add_all(self, count: usize, values: impl Iterator<Item = f32>) {
        let (means, deviations) = self.values.split_at_mut(count);
        for ((mean, deviation), value) in means.iter_mut().zip(deviations).zip(values) {
            let before = value - *mean;
            *mean += before * self.ordinal.share;
            *deviation += before * (value - *mean);
        }
    }

    /// Updates the means of the sample's bin.
    #[inline(always)]
    fn add_to_bin<const N: usize>(self, values: [f32; N]) {
        self.add_all_to_bin(N, values.into_iter());
    }

    /// The same for the colours of all half-edges.
    #[inline(always)]
    fn add_colors_to_bin(self, colors: &[Rgb]) {
        match <&[Rgb; 4]>::try_from(colors) {
            Ok(cross) => self.add_to_bin(flatten(cross)),
            Err(_) => self.add_all_to_bin(3 * colors.len(), colors.iter().flat_map(|color| color.to_array())),
        }
    }

    #[inline(always)]
    fn add_all_to_bin(self, count: usize, values: impl Iterator<Item = f32>) {
        let means = &mut self.values[count * self.ordinal.bin..][..count];
        means.iter_mut().zip(values).for_each(|(mean, value)| *mean += (value - *mean) * self.ordinal.bin_share);
    }
}

fn flatten(colors: &[Rgb; 4]) -> [f32; 12] {
    let mut flat = [0.0; 12];
    flat.chunks_exact_mut(3).zip(colors).for_each(|(slot, color)| slot.copy_from_slice(&color.to_array()));
    flat
}

impl Statistic {
    /// Floats that a value takes.
    const fn floats(&self) -> usize {
        match self.kind {
            Kind::Moments => 2,
            Kind::Bins => BINS,
        }
    }

    /// The floats of pixel `index`, which has the given ones among the half-edges of its tile, in a plane of a film with so many
    /// groups of emitters.
    pub fn span(&self, index: usize, half_edges: &Range<usize>, lights: usize) -> Range<usize> {
        let first = self.values * self.floats() * if self.of_lights { lights } else { 1 };
        if self.of_edges {
            first * half_edges.start..first * half_edges.end
        } else {
            first * index..first * (index + 1)
        }
    }

    /// Adds a sample to the floats of a pixel.
    pub fn add(&self, values: &mut [f32], ordinal: Ordinal, taken: Taken) {
        (self.accumulate)(Slot { values, ordinal }, taken);
    }

    /// Adds the `m` samples of `other` to the `n` samples of `mine`, as if they had been taken after them.
    pub fn merge(&self, mine: &mut [f32], other: &[f32], n: u32, m: u32) {
        match self.kind {
            Kind::Moments => Self::merge_moments(mine, other, n, m),
            Kind::Bins => Self::merge_bins(mine, other, n, m),
        }
    }

    /// Pairwise update of means and sums of squared deviations (Chan et al. 1979).
    fn merge_moments(mine: &mut [f32], other: &[f32], n: u32, m: u32) {
        let share = f64::from(m) / (f64::from(n) + f64::from(m));
        let count = mine.len() / 2;
        let (means, deviations) = mine.split_at_mut(count);
        let (other_means, other_deviations) = other.split_at(count);
        for i in 0..count {
            let (mean, deviation) = (f64::from(means[i]), f64::from(deviations[i]));
            let distance = f64::from(other_means[i]) - mean;
            means[i] = (mean + distance * share) as f32;
            let between = distance * distance * f64::from(n) * share;
            deviations[i] = (deviation + f64::from(other_deviations[i]) + between) as f32;
        }
    }

    /// The first of the other samples belongs to the bin after that of our last one.
    fn merge_bins(mine: &mut [f32], other: &[f32], n: u32, m: u32) {
        let width = mine.len() / BINS;
        if width == 0 {
            return;
        }
        for (k, other) in other.chunks_exact(width).enumerate() {
            let to = (n as usize + k) % BINS;
            let (a, b) = (f64::from(bin_count(n, to)), f64::from(bin_count(m, k)));
            let share = if b > 0.0 { (b / (a + b)) as f32 } else { 0.0 };
            let means = &mut mine[width * to..][..width];
            means.iter_mut().zip(other).for_each(|(mean, other)| *mean += (other - *mean) * share);
        }
    }

    /// Variance of the mean of value `i` of a pixel, from its moments of `n` samples. A single sample says nothing about its
    /// variance: its own square stands in, rather than a certainty of zero.
    pub fn variance_of_mean(values: &[f32], i: usize, n: u32) -> f32 {
        match n {
            0 => 0.0,
            1 => values[i] * values[i],
            _ => (f64::from(values[values.len() / 2 + i]) / (f64::from(n) * f64::from(n - 1))).max(0.0) as f32,
        }
    }
}

impl Record {
    pub fn statistic(self) -> &'static Statistic {
        &STATISTICS[self as usize]
    }

    /// Whether a film with these needs has the statistic.
    pub fn is_recorded(self, needs: Needs) -> bool {
        (self.statistic().recorded)(needs)
    }

    /// Whether the statistic is not recorded because all of its values are known to be zero, in a scene that scatters no
    /// light. The ambient light is no part of the scene.
    pub fn is_known_zero(self, needs: Needs) -> bool {
        if self == Self::AmbientEdgeBins {
            return false;
        }
        let sampled = Needs { edges: EdgeNeed::Sampled, ..needs };
        needs.edges == EdgeNeed::KnownZero && self.statistic().of_edges && self.is_recorded(sampled)
    }
}

/// Samples in bin `k` of a pixel that has `n` of them: sample i is in bin i mod [`BINS`].
pub fn bin_count(n: u32, k: usize) -> u32 {
    (n + (BINS - 1 - k) as u32) / BINS as u32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_are_in_the_order_of_their_names() {
        let names = [
            (Record::Color, 3),
            (Record::Direct, 3),
            (Record::Surface, 7),
            (Record::Occlusion, 1),
            (Record::Position, 3),
            (Record::Edges, 3),
            (Record::ColorBins, 3),
            (Record::EdgeBins, 3),
            (Record::AmbientBins, 3),
            (Record::AmbientEdgeBins, 3),
            (Record::Alpha, 1),
            (Record::Lights, LIGHT),
        ];
        assert_eq!(names.len(), STATISTICS.len());
        for (k, (record, values)) in names.into_iter().enumerate() {
            assert_eq!((record as usize, record.statistic().values), (k, values));
        }
        assert!(Record::Direct.statistic().sparse.is_some() && Record::AmbientEdgeBins.statistic().of_edges);
    }

    #[test]
    fn bins_share_the_samples_in_turn() {
        let counts: Vec<u32> = (0..BINS).map(|k| bin_count(19, k)).collect();
        assert_eq!(counts, [3, 3, 3, 2, 2, 2, 2, 2]);
    }
}
