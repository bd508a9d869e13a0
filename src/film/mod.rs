//! What rendering leaves behind: running statistics per pixel ([`Film`]), developed into means and variances
//! ([`Frame`]), which reconstructions see and EXR files hold.

mod develop;
pub mod exr;
mod frame;
pub mod layer;
mod sample;
mod stored;

use serde::{Deserialize, Serialize};

pub use self::frame::Frame;
pub use self::layer::Layer;
use self::sample::Moments;
pub use self::sample::{EDGES, Features, Rejected, Sample, bin_count};
use crate::math::Rgb;

/// Samples are dealt in turn to this many groups, whose statistics are independent of each other.
pub const BINS: usize = 8;

/// Side of the square tiles that a film is worked on in.
pub const TILE: usize = 16;

/// What a method wants recorded besides colour.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Needs {
    /// Albedo, normal and depth with their variances.
    pub features: bool,
    /// Differences to the neighbours with their variances.
    pub edges: bool,
    /// Colour and edges for each of the [`BINS`].
    pub bins: bool,
    /// Ambient occlusion with its variance.
    pub occlusion: bool,
    /// World position with its variance.
    pub position: bool,
    /// Bins of what an ambient light would add.
    pub ambient: bool,
}

impl Needs {
    /// Everything.
    pub const ALL: Self =
        Self { features: true, edges: true, bins: true, occlusion: true, position: true, ambient: true };

    /// Bytes that a film takes a pixel, as long as the camera sees no emitter; 24 more where it does.
    pub fn bytes_per_pixel(self) -> usize {
        let when = |needed: bool, bytes: usize| if needed { bytes } else { 0 };
        size_of::<u32>()
            + size_of::<Moments<3>>()
            + when(self.features, size_of::<Moments<7>>())
            + when(self.occlusion || self.position, size_of::<Moments<4>>())
            + when(self.edges, size_of::<Moments<12>>())
            + when(self.bins, size_of::<[Bin; BINS]>())
            + when(self.ambient, size_of::<[Bin; BINS]>())
    }

    /// Whether everything that `other` wants is there.
    pub fn cover(self, other: Self) -> bool {
        self.union(other) == self
    }

    /// What either wants.
    pub fn union(self, other: Self) -> Self {
        Self {
            features: self.features || other.features,
            edges: self.edges || other.edges,
            bins: self.bins || other.bins,
            occlusion: self.occlusion || other.occlusion,
            position: self.position || other.position,
            ambient: self.ambient || other.ambient,
        }
    }
}

/// Colour and edges, in the order of [`EDGES`]: of a sample, or the means of a bin.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Bin {
    /// Radiance.
    pub color: Rgb,
    /// One end's share of the differences neighbour minus pixel.
    pub edges: [Rgb; 4],
}

impl Bin {
    /// Takes in other means, which make up `share` of both.
    fn add(&mut self, other: &Self, share: f32) {
        self.color += (other.color - self.color) * share;
        let edges = self.edges.iter_mut().zip(other.edges);
        edges.for_each(|(mean, edge)| *mean += (edge - *mean) * share);
    }
}

/// The statistics of a tile's pixels, row by row. A tile has one writer at a time, so nothing is locked.
#[derive(Clone, Debug, PartialEq)]
pub struct Tile {
    /// Left column in the film.
    pub x: usize,
    /// Top row in the film.
    pub y: usize,
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    counts: Vec<u32>,
    /// Empty until there is one.
    rejected: Vec<u32>,
    color: Vec<Moments<3>>,
    /// Empty until the camera sees an emitter.
    direct: Vec<Moments<3>>,
    /// Albedo, normal and depth; empty when not needed.
    features: Vec<Moments<7>>,
    /// Occlusion and position; empty when neither is needed.
    places: Vec<Moments<4>>,
    /// Empty when not needed.
    edges: Vec<Moments<12>>,
    /// Empty when not needed.
    bins: Vec<[Bin; BINS]>,
    /// Those of the ambient light; empty when not needed.
    ambient: Vec<[Bin; BINS]>,
}

impl Tile {
    fn new(x: usize, y: usize, width: usize, height: usize, needs: Needs) -> Self {
        let pixels = width * height;
        let when = |needed: bool| if needed { pixels } else { 0 };
        Self {
            x,
            y,
            width,
            height,
            counts: vec![0; pixels],
            rejected: Vec::new(),
            color: vec![Moments::default(); pixels],
            direct: Vec::new(),
            features: vec![Moments::default(); when(needs.features)],
            places: vec![Moments::default(); when(needs.occlusion || needs.position)],
            edges: vec![Moments::default(); when(needs.edges)],
            bins: vec![[Bin::default(); BINS]; when(needs.bins)],
            ambient: vec![[Bin::default(); BINS]; when(needs.ambient)],
        }
    }

    /// Number of samples pixel `index` has, and so the number of its next sample.
    pub fn count(&self, index: usize) -> u32 {
        self.counts[index]
    }

    /// Samples of all pixels.
    pub fn samples(&self) -> u64 {
        self.counts.iter().map(|&count| u64::from(count)).sum()
    }

    /// Adds a sample to pixel `index`. One that is not finite is counted as zero, and reported.
    pub fn add(&mut self, index: usize, sample: &Sample) -> Result<(), Rejected> {
        let (sample, outcome) = match sample.check() {
            Ok(()) => (*sample, Ok(())),
            Err(reason) => {
                self.rejected.resize(self.counts.len(), 0);
                self.rejected[index] += 1;
                (Sample::default(), Err(reason))
            }
        };
        let bin = self.counts[index] as usize % BINS;
        let bin_share = 1.0 / (self.counts[index] as usize / BINS + 1) as f32;
        self.counts[index] += 1;
        let share = 1.0 / self.counts[index] as f32;
        self.color[index].add(sample.color.to_array(), share);
        if self.direct.is_empty() && sample.direct != Rgb::ZERO {
            self.direct.resize(self.counts.len(), Moments::default());
        }
        if let Some(direct) = self.direct.get_mut(index) {
            direct.add(sample.direct.to_array(), share);
        }
        if let Some(features) = self.features.get_mut(index) {
            features.add(sample.features.to_array(), share);
        }
        if let Some(places) = self.places.get_mut(index) {
            places.add(sample.features.place(), share);
        }
        if let Some(edges) = self.edges.get_mut(index) {
            edges.add(sample::flatten(&sample.edges), share);
        }
        if let Some(bins) = self.bins.get_mut(index) {
            bins[bin].add(&Bin { color: sample.color, edges: sample.edges }, bin_share);
        }
        if let Some(bins) = self.ambient.get_mut(index) {
            bins[bin].add(&sample.ambient, bin_share);
        }
        outcome
    }

    fn merge(&mut self, other: &Self) {
        self.direct.resize(self.direct.len().max(other.direct.len()), Moments::default());
        self.rejected.resize(self.rejected.len().max(other.rejected.len()), 0);
        for index in 0..self.counts.len() {
            let (n, m) = (self.counts[index], other.counts[index]);
            if m == 0 {
                continue;
            }
            let share = f64::from(m) / (f64::from(n) + f64::from(m));
            self.color[index].merge(&other.color[index], n, share);
            if let Some(direct) = self.direct.get_mut(index) {
                direct.merge(other.direct.get(index).unwrap_or(&Moments::default()), n, share);
            }
            if let Some(features) = self.features.get_mut(index) {
                features.merge(&other.features[index], n, share);
            }
            if let Some(places) = self.places.get_mut(index) {
                places.merge(&other.places[index], n, share);
            }
            if let Some(edges) = self.edges.get_mut(index) {
                edges.merge(&other.edges[index], n, share);
            }
            for (bins, theirs) in [(&mut self.bins, &other.bins), (&mut self.ambient, &other.ambient)] {
                let Some(bins) = bins.get_mut(index) else { continue };
                // Their samples come after ours: the first of them is in the bin that is next.
                for (k, theirs) in theirs[index].iter().enumerate() {
                    let to = (n as usize + k) % BINS;
                    let (a, b) = (f64::from(sample::bin_count(n, to)), f64::from(sample::bin_count(m, k)));
                    bins[to].add(theirs, if b > 0.0 { (b / (a + b)) as f32 } else { 0.0 });
                }
            }
            self.counts[index] = n + m;
            if let Some(rejected) = self.rejected.get_mut(index) {
                *rejected += other.rejected.get(index).copied().unwrap_or_default();
            }
        }
    }
}

/// Running statistics of every pixel, in tiles.
#[derive(Clone, Debug, PartialEq)]
pub struct Film {
    /// Pixels in a row.
    pub width: usize,
    /// Number of rows.
    pub height: usize,
    /// What is recorded.
    pub needs: Needs,
    tiles: Vec<Tile>,
}

impl Film {
    /// An empty film.
    pub fn new(width: usize, height: usize, needs: Needs) -> Self {
        let mut tiles = Vec::new();
        for y in (0..height).step_by(TILE) {
            for x in (0..width).step_by(TILE) {
                tiles.push(Tile::new(x, y, TILE.min(width - x), TILE.min(height - y), needs));
            }
        }
        Self { width, height, needs, tiles }
    }

    /// All tiles, to be worked on by different threads.
    pub fn tiles_mut(&mut self) -> &mut [Tile] {
        &mut self.tiles
    }

    /// Samples of all pixels.
    pub fn samples(&self) -> u64 {
        self.tiles.iter().map(Tile::samples).sum()
    }

    /// Samples of every pixel, row by row.
    pub fn counts(&self) -> Vec<u32> {
        let mut counts = vec![0; self.width * self.height];
        for tile in &self.tiles {
            for (row, from) in tile.counts.chunks_exact(tile.width).enumerate() {
                counts[(tile.y + row) * self.width + tile.x..][..tile.width].copy_from_slice(from);
            }
        }
        counts
    }

    /// Samples of the pixel that has the fewest.
    pub fn fewest_samples(&self) -> u32 {
        self.tiles.iter().flat_map(|tile| &tile.counts).copied().min().unwrap_or(0)
    }

    /// Samples of the pixel that has the most.
    pub fn most_samples(&self) -> u32 {
        self.tiles.iter().flat_map(|tile| &tile.counts).copied().max().unwrap_or(0)
    }

    /// Samples that were not finite.
    pub fn rejected(&self) -> u64 {
        self.tiles.iter().flat_map(|tile| &tile.rejected).map(|&count| u64::from(count)).sum()
    }

    /// Adds the samples of a film of the same size and needs as if they had been taken after those here.
    pub fn merge(&mut self, other: &Self) {
        assert_eq!((self.width, self.height, self.needs), (other.width, other.height, other.needs), "films differ");
        self.tiles.iter_mut().zip(&other.tiles).for_each(|(mine, theirs)| mine.merge(theirs));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::{Vec3, vec3};

    fn sample(i: u32) -> Sample {
        let value = (i as f32 * 0.7).sin() + 1.5;
        let features = Features {
            albedo: Rgb::splat(0.5),
            normal: Vec3::Z,
            depth: value,
            occlusion: 0.5 * value,
            position: Vec3::splat(value),
        };
        let ambient = Bin { color: Rgb::splat(value), edges: [Rgb::splat(value); 4] };
        Sample { color: vec3(value, 2.0, 0.0), direct: Rgb::ONE, features, edges: [Rgb::splat(value); 4], ambient }
    }

    #[test]
    fn means_and_variances_are_those_of_the_samples() {
        let mut film = Film::new(1, 1, Needs::ALL);
        let values: Vec<f64> = (0..100).map(|i| f64::from(sample(i).color.x)).collect();
        (0..100).for_each(|i| film.tiles_mut()[0].add(0, &sample(i)).unwrap());
        let mean = values.iter().sum::<f64>() / 100.0;
        let variance = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / 99.0 / 100.0;
        let frame = film.develop();
        assert!((f64::from(frame.get(Layer::Color).unwrap().data[0]) - mean).abs() < 1e-6);
        assert!((f64::from(frame.get(Layer::ColorVariance).unwrap().data[0]) / variance - 1.0).abs() < 1e-4);
        // Constant channels have no variance at all, not a rounded one.
        assert_eq!(frame.get(Layer::ColorVariance).unwrap().data[1..], [0.0, 0.0]);
        let bins: f64 = (0..8)
            .map(|b| {
                f64::from(frame.get(Layer::BinColor(b)).unwrap().data[0])
                    * f64::from(sample::bin_count(100, b as usize))
            })
            .sum::<f64>()
            / 100.0;
        assert!((bins - mean).abs() < 1e-6);
    }

    #[test]
    fn merging_is_adding_the_samples() {
        let mut halves = [Film::new(1, 1, Needs::ALL), Film::new(1, 1, Needs::ALL)];
        let mut whole = Film::new(1, 1, Needs::ALL);
        for i in 0..64 {
            halves[usize::from(i >= 24)].tiles_mut()[0].add(0, &sample(i)).unwrap();
            whole.tiles_mut()[0].add(0, &sample(i)).unwrap();
        }
        let [mut merged, second] = halves;
        merged.merge(&second);
        let (a, b) = (merged.develop(), whole.develop());
        for layer in Layer::all() {
            let (a, b) = (a.get(layer).unwrap(), b.get(layer).unwrap());
            a.data.iter().zip(&b.data).for_each(|(a, b)| assert!((a - b).abs() < 1e-5, "{layer:?}: {a} {b}"));
        }
    }

    #[test]
    fn samples_that_are_not_finite_count_as_zero_and_are_reported() {
        let mut film = Film::new(2, 1, Needs::ALL);
        let bad = Sample { color: vec3(f32::NAN, 1.0, 1.0), ..sample(0) };
        assert!(film.tiles_mut()[0].add(1, &bad).is_err());
        film.tiles_mut()[0].add(1, &Sample { color: Rgb::ONE, ..sample(0) }).unwrap();
        assert_eq!((film.rejected(), film.samples()), (1, 2));
        assert_eq!(film.develop().get(Layer::Color).unwrap().pixel(1, 0), [0.5; 3]);
    }
}
