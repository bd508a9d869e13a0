//! What one camera path leaves behind, and the running moments it is added to.

use super::{BINS, Bin};
use crate::math::{Rgb, Vec3};

/// The neighbours that differences are taken to, as steps in x and y. Each edge is sampled from both ends.
pub const EDGES: [(i32, i32); 4] = [(1, 0), (-1, 0), (0, 1), (0, -1)];

/// Auxiliary values at the first surface that is not a mirror or clear glass.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Features {
    /// Colour of the material, in [0, 1].
    pub albedo: Rgb,
    /// Shading normal in world space, towards the viewer.
    pub normal: Vec3,
    /// Length of the path so far, in scene units.
    pub depth: f32,
    /// Ambient occlusion: 1 where a direction from there was open, 0 where it was not.
    pub occlusion: f32,
    /// The point, in world space.
    pub position: Vec3,
}

impl Features {
    pub(super) fn to_array(self) -> [f32; 7] {
        let (a, n) = (self.albedo, self.normal);
        [a.x, a.y, a.z, n.x, n.y, n.z, self.depth]
    }

    pub(super) fn place(self) -> [f32; 4] {
        let p = self.position;
        [self.occlusion, p.x, p.y, p.z]
    }
}

/// The result of one camera path and its shifted copies.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Sample {
    /// Scattered radiance: an unbiased estimate of the pixel without `direct`.
    pub color: Rgb,
    /// Radiance of emitters that the camera sees directly.
    pub direct: Rgb,
    /// Auxiliary values.
    pub features: Features,
    /// One end's share of the difference neighbour minus pixel, in the order of [`EDGES`]; zero across the
    /// image's border.
    pub edges: [Rgb; 4],
    /// What an ambient light of radiance one, which nothing blocks, would add to the colour and the edges.
    pub ambient: Bin,
}

/// Why a sample was not taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Rejected(
    /// Which part of it was not finite.
    pub &'static str,
);

impl Rejected {
    const PARTS: [&'static str; 5] = ["color", "direct", "features", "ambient light", "edges"];

    /// The reason of a name.
    pub fn named(name: &str) -> Self {
        Self(Self::PARTS.into_iter().find(|part| *part == name).unwrap_or("something in them"))
    }
}

/// Values beyond this have squares whose sum over a million samples is no longer a float.
const LARGEST: f32 = 1e16;

impl Sample {
    /// Fails on what is no number, and on numbers that would make the variance none.
    pub(super) fn check(&self) -> Result<(), Rejected> {
        let finite = |ok: bool, what| if ok { Ok(()) } else { Err(Rejected(what)) };
        let value = |value: f32| value.abs() <= LARGEST;
        let color = |color: &Rgb| color.abs().max_element() <= LARGEST && !color.is_nan();
        finite(color(&self.color), "color")?;
        finite(color(&self.direct), "direct")?;
        let mut features = self.features.to_array().into_iter().chain(self.features.place());
        finite(features.all(value), "features")?;
        finite(color(&self.ambient.color) && self.ambient.edges.iter().all(color), "ambient light")?;
        finite(self.edges.iter().all(color), "edges")
    }
}

pub(super) fn flatten(edges: &[Rgb; 4]) -> [f32; 12] {
    let mut flat = [0.0; 12];
    flat.chunks_exact_mut(3).zip(edges).for_each(|(slot, edge)| slot.copy_from_slice(&edge.to_array()));
    flat
}

/// Samples in bin `k` of a pixel that has `n`.
pub fn bin_count(n: u32, k: usize) -> u32 {
    (n + (BINS - 1 - k) as u32) / BINS as u32
}

/// Running mean and sum of squared deviations (Welford 1962) of N values.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Moments<const N: usize> {
    pub mean: [f32; N],
    pub deviation: [f32; N],
}

impl<const N: usize> Default for Moments<N> {
    fn default() -> Self {
        Self { mean: [0.0; N], deviation: [0.0; N] }
    }
}

impl<const N: usize> Moments<N> {
    /// Adds a sample; `share` is one over the count with it.
    #[inline]
    pub fn add(&mut self, values: [f32; N], share: f32) {
        for ((mean, deviation), value) in self.mean.iter_mut().zip(&mut self.deviation).zip(values) {
            let before = value - *mean;
            *mean += before * share;
            *deviation += before * (value - *mean);
        }
    }

    /// Adds another group that makes up `share` of both together; this one has `n` samples (Chan et al. 1979).
    pub fn merge(&mut self, other: &Self, n: u32, share: f64) {
        for i in 0..N {
            let (mean, deviation) = (f64::from(self.mean[i]), f64::from(self.deviation[i]));
            let apart = f64::from(other.mean[i]) - mean;
            self.mean[i] = (mean + apart * share) as f32;
            let between = apart * apart * f64::from(n) * share;
            self.deviation[i] = (deviation + f64::from(other.deviation[i]) + between) as f32;
        }
    }

    /// Variance of the mean of `n` samples. A single sample says nothing of its variance: it gets its own
    /// square, rather than a certainty of zero.
    pub fn variance_of_mean(&self, i: usize, n: u32) -> f32 {
        match n {
            0 => 0.0,
            1 => self.mean[i] * self.mean[i],
            _ => (f64::from(self.deviation[i]) / (f64::from(n) * f64::from(n - 1))).max(0.0) as f32,
        }
    }
}
