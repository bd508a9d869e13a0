//! A statistic: how values of samples become those of a pixel. Tiles, checkpoint files, merging and the memory of a film are driven by
//! the [table](super::statistics) of them.

use std::ops::Range;

use super::{BINS, Needs, Recorded, Sample, Taken};
use crate::math::Rgb;

/// A statistic of every pixel.
pub(super) struct Statistic {
    /// Number of values in a sample, of a half-edge, or of a group of emitters.
    pub values: usize,
    pub kind: Kind,
    /// Whether it has values of every half-edge, and counts the samples with differences instead of all samples.
    pub of_edges: bool,
    /// Whether it has values of every group of emitters.
    pub of_lights: bool,
    /// If set, the statistic takes no memory in a tile until it says that a sample has a value other than zero.
    pub sparse: Option<fn(&Sample) -> bool>,
    /// Has to be asked for by this name; if none, every film records it.
    pub asked: Option<Recorded>,
    /// Version of checkpoint files that first had it.
    pub since: u32,
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

impl Statistic {
    /// Moments of values that every film records.
    pub const fn moments(values: usize, accumulate: fn(Slot, Taken)) -> Self {
        let (kind, asked) = (Kind::Moments, None);
        Self { values, kind, of_edges: false, of_lights: false, sparse: None, asked, since: 2, accumulate }
    }

    /// Means in bins.
    pub const fn bins(values: usize, accumulate: fn(Slot, Taken)) -> Self {
        Self { kind: Kind::Bins, ..Self::moments(values, accumulate) }
    }

    /// The statistic for films that were asked for it.
    pub const fn asked(self, name: Recorded) -> Self {
        Self { asked: Some(name), ..self }
    }

    /// The statistic with values of every half-edge.
    pub const fn of_edges(self) -> Self {
        Self { of_edges: true, ..self }
    }

    /// The statistic with values of every group of emitters.
    pub const fn of_lights(self) -> Self {
        Self { of_lights: true, ..self }
    }

    /// The statistic that takes no memory in a tile until `nonzero` is true of a sample.
    pub const fn sparse(self, nonzero: fn(&Sample) -> bool) -> Self {
        Self { sparse: Some(nonzero), ..self }
    }

    /// The statistic that checkpoint files have from a version on.
    pub const fn since(self, version: u32) -> Self {
        Self { since: version, ..self }
    }

    /// Whether a film with these needs has it.
    pub fn is_recorded(&self, needs: Needs) -> bool {
        self.asked.is_none_or(|name| needs.has(name))
            && (!self.of_edges || needs.edges.is_sampled())
            && (!self.of_lights || needs.lights > 0)
    }
}

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
    pub fn add<const N: usize>(self, values: [f32; N]) {
        self.add_all(N, values.into_iter());
    }

    /// The same for the colours of all half-edges.
    #[inline(always)]
    pub fn add_colors(self, colors: &[Rgb]) {
        match <&[Rgb; 4]>::try_from(colors) {
            Ok(cross) => self.add(flatten(cross)),
            Err(_) => self.add_all(3 * colors.len(), colors.iter().flat_map(|color| color.to_array())),
        }
    }

    #[inline(always)]
    pub fn add_all(self, count: usize, values: impl Iterator<Item = f32>) {
        let (means, deviations) = self.values.split_at_mut(count);
        for ((mean, deviation), value) in means.iter_mut().zip(deviations).zip(values) {
            let before = value - *mean;
            *mean += before * self.ordinal.share;
            *deviation += before * (value - *mean);
        }
    }

    /// Updates the means of the sample's bin.
    #[inline(always)]
    pub fn add_to_bin<const N: usize>(self, values: [f32; N]) {
        self.add_all_to_bin(N, values.into_iter());
    }

    /// The same for the colours of all half-edges.
    #[inline(always)]
    pub fn add_colors_to_bin(self, colors: &[Rgb]) {
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

/// Samples in bin `k` of a pixel that has `n` of them: sample i is in bin i mod [`BINS`].
pub fn bin_count(n: u32, k: usize) -> u32 {
    (n + (BINS - 1 - k) as u32) / BINS as u32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bins_share_the_samples_in_turn() {
        let counts: Vec<u32> = (0..BINS).map(|k| bin_count(19, k)).collect();
        assert_eq!(counts, [3, 3, 3, 2, 2, 2, 2, 2]);
    }
}
