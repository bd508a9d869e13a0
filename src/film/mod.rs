//! The result of rendering: running statistics per pixel ([`Film`]), developed into means and variances ([`Frame`]),
//! which reconstructions see and EXR files hold.
//!
//! ```text
//! Sample --add--> Tile (table of statistics) --develop--> Frame (table of layers) --edges--> Edges
//! ```

mod aovs;
mod develop;
mod edge_layers;
mod edges;
pub mod exr;
mod frame;
mod joined;
pub mod layer;
mod layer_lookup;
mod light_layers;
mod needs;
mod neighbours;
mod provenance;
mod sample;
mod source;
mod statistic;
mod statistics;
mod stored;
mod tile;
mod views;

pub use self::edges::{Cross, EdgeParts, Edges, HalfEdge};
pub use self::frame::{Frame, half};
pub use self::layer::Layer;
pub use self::light_layers::LightLayers;
pub use self::needs::{EdgeNeed, Needs, RecordedSet};
pub use self::neighbours::{CROSS, Neighbours, STEPS, StepWeights, beside, opposite};
pub use self::provenance::Provenance;
pub use self::sample::{Differences, Features, GroupLight, Rejected, Sample, Scattering, Taken, Values};
pub use self::statistic::bin_count;
pub use self::statistics::{Asker, NEWEST, RECORDED, Recorded, RecordedInfo};
pub use self::tile::Tile;

use std::sync::Arc;

/// Number of disjoint groups of samples, with means of their own: sample i of a pixel belongs to bin i mod 8.
pub const BINS: usize = 8;

/// Side of the square tiles that a film is rendered in.
pub const TILE: usize = 16;

/// Running statistics of every pixel, in tiles.
#[derive(Clone, Debug, PartialEq)]
pub struct Film {
    /// Pixels in a row.
    pub width: usize,
    /// Number of rows.
    pub height: usize,
    /// Statistics that are recorded.
    pub needs: Needs,
    /// Names of the groups of emitters whose light is recorded by itself.
    pub lights: Vec<String>,
    kernel: Kernel,
    tiles: Vec<Tile>,
}

/// The half-edges that a film records.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum Kernel {
    /// To the four direct neighbours of every pixel.
    #[default]
    Cross,
    /// None, until the neighbours are chosen.
    Pending,
    /// To neighbours that were chosen for every pixel.
    Chosen(Arc<Neighbours>),
}

impl Kernel {
    /// The neighbours, if they were chosen.
    pub fn neighbours(&self) -> Option<&Neighbours> {
        if let Self::Chosen(neighbours) = self { Some(neighbours) } else { None }
    }
}

impl Film {
    /// An empty film.
    pub fn new(width: usize, height: usize, needs: Needs) -> Self {
        let tiles = Tile::all((width, height), needs, &Kernel::Cross).collect();
        Self { width, height, needs, lights: Vec::new(), kernel: Kernel::Cross, tiles }
    }

    /// The film with the names of its groups of emitters.
    #[must_use]
    pub fn with_lights(self, names: &[String]) -> Self {
        assert_eq!(names.len(), usize::from(self.needs.lights), "names of other groups of emitters");
        Self { lights: names.to_vec(), ..self }
    }

    /// A film of all its tiles, with the names of its groups of emitters.
    pub(crate) fn of_tiles(
        (width, height): (usize, usize),
        (needs, lights): (Needs, &[String]),
        kernel: Kernel,
        tiles: Vec<Tile>,
    ) -> Self {
        Self { width, height, needs, lights: Vec::new(), kernel, tiles }.with_lights(lights)
    }

    /// The film without half-edges, which are recorded from when its neighbours are chosen.
    pub fn pending(mut self) -> Self {
        let needs = self.needs;
        self.tiles.iter_mut().for_each(|tile| tile.set_half_edges(needs, |_| 0));
        self.kernel = Kernel::Pending;
        self
    }

    /// Chooses the neighbours that edges lead to, and their weights. Edges that were recorded to other neighbours are lost.
    pub fn choose(&mut self, neighbours: Neighbours) {
        assert_eq!(neighbours.size(), (self.width, self.height), "neighbours of another film");
        if !matches!(&self.kernel, Kernel::Chosen(before) if before.masks() == neighbours.masks()) {
            self.tiles.iter_mut().for_each(|tile| tile.set_neighbours(self.needs, &neighbours));
        }
        self.kernel = Kernel::Chosen(Arc::new(neighbours));
    }

    /// The half-edges that are recorded.
    pub fn kernel(&self) -> &Kernel {
        &self.kernel
    }

    /// All tiles, to be rendered by different threads.
    pub fn tiles_mut(&mut self) -> &mut [Tile] {
        &mut self.tiles
    }

    /// All tiles.
    pub fn tiles(&self) -> &[Tile] {
        &self.tiles
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

    /// Mean number of samples of a pixel.
    pub fn mean_spp(&self) -> f64 {
        self.samples() as f64 / (self.width * self.height) as f64
    }

    /// Samples that were not finite.
    pub fn rejected(&self) -> u64 {
        self.tiles.iter().flat_map(|tile| &tile.rejected).map(|&count| u64::from(count)).sum()
    }

    /// Adds the samples of a film of the same size, needs and kernel as if they had been taken after those here.
    pub fn merge(&mut self, other: &Self) {
        assert_eq!((self.width, self.height, self.needs), (other.width, other.height, other.needs), "films differ");
        assert_eq!(self.kernel, other.kernel, "kernels differ");
        self.tiles.iter_mut().zip(&other.tiles).for_each(|(mine, theirs)| mine.merge(theirs));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::{Rgb, Vec3, vec3};

    fn sample(i: u32) -> Sample {
        let value = (i as f32 * 0.7).sin() + 1.5;
        let features = Features { albedo: Rgb::splat(0.5), normal: Vec3::Z, depth: value, ..Features::default() };
        let mut values = Values::default();
        values.set(Recorded::Occlusion, [0.5 * value]);
        values.set(Recorded::Position, [value; 3]);
        values.set(Recorded::Alpha, [1.0]);
        Sample { color: vec3(value, 2.0, 0.0), direct: Rgb::ONE, features, ambient: Rgb::splat(value), values }
    }

    /// Adds sample `i` to a pixel, with differences of its size if asked for.
    fn add(film: &mut Film, pixel: usize, i: u32, shifted: bool) {
        let edges = [Rgb::splat(sample(i).features.depth); 4];
        let differences = Some(Differences { color: &edges, ambient: &edges }).filter(|_| shifted);
        film.tiles_mut()[0].add(pixel, Taken { differences, ..Taken::alone(&sample(i)) }).unwrap();
    }

    #[test]
    fn means_and_variances_are_those_of_the_samples() {
        let mut film = Film::new(1, 1, Needs::ALL);
        let values: Vec<f64> = (0..100).map(|i| f64::from(sample(i).color.x)).collect();
        (0..100).for_each(|i| add(&mut film, 0, i, true));
        let mean = values.iter().sum::<f64>() / 100.0;
        let variance = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / 99.0 / 100.0;
        let frame = film.develop();
        assert!((f64::from(frame.get(Layer::Color).unwrap().data[0]) - mean).abs() < 1e-6);
        assert!((f64::from(frame.get(Layer::ColorVariance).unwrap().data[0]) / variance - 1.0).abs() < 1e-4);
        // Constant channels have no variance at all, not a rounded one.
        assert_eq!(frame.get(Layer::ColorVariance).unwrap().data[1..], [0.0, 0.0]);
        let bins: f64 = (0..8)
            .map(|b| f64::from(frame.get(Layer::BinColor(b)).unwrap().data[0]) * f64::from(bin_count(100, b as usize)))
            .sum::<f64>()
            / 100.0;
        assert!((bins - mean).abs() < 1e-6);
    }

    #[test]
    fn merging_is_adding_the_samples() {
        let mut halves = [Film::new(1, 1, Needs::ALL), Film::new(1, 1, Needs::ALL)];
        let mut whole = Film::new(1, 1, Needs::ALL);
        for i in 0..64 {
            add(&mut halves[usize::from(i >= 24)], 0, i, true);
            add(&mut whole, 0, i, true);
        }
        let [mut merged, second] = halves;
        merged.merge(&second);
        let (a, b) = (merged.develop(), whole.develop());
        assert_eq!(a.present().count(), Layer::COUNT - 1);
        for (layer, a) in a.present() {
            let b = b.get(layer).unwrap();
            a.data.iter().zip(&b.data).for_each(|(a, b)| assert!((a - b).abs() < 1e-5, "{layer:?}: {a} {b}"));
        }
    }

    #[test]
    fn samples_that_are_not_finite_count_as_zero_and_are_reported() {
        let mut film = Film::new(2, 1, Needs::ALL);
        let bad = Sample { color: vec3(f32::NAN, 1.0, 1.0), ..sample(0) };
        assert!(film.tiles_mut()[0].add(1, Taken::alone(&bad)).is_err());
        film.tiles_mut()[0].add(1, Taken::alone(&Sample { color: Rgb::ONE, ..sample(0) })).unwrap();
        assert_eq!((film.rejected(), film.samples()), (1, 2));
        assert_eq!(film.develop().get(Layer::Color).unwrap().pixel(1, 0), [0.5; 3]);
    }

    #[test]
    fn edges_that_are_sampled_less_often_have_counts_of_their_own() {
        let (mut film, mut dense) = (Film::new(2, 1, Needs::ALL), Film::new(2, 1, Needs::ALL));
        for (i, pixel) in (0..32).flat_map(|i| [(i, 0), (i, 1)]) {
            add(&mut film, pixel, i, i % 4 == 1);
            if i % 4 == 1 {
                add(&mut dense, pixel, i, true);
            }
        }
        assert_eq!((film.tiles_mut()[0].count(0), film.tiles_mut()[0].edge_count(0)), (32, 8));
        let mut bytes = Vec::new();
        film.write(&mut bytes).unwrap();
        let mut tile = Tile::all((2, 1), Needs::ALL, &Kernel::Cross).next().unwrap();
        tile.read(NEWEST, &mut bytes.as_slice()).unwrap();
        assert_eq!(tile, film.tiles[0]);
        // The edges are those of the samples that had differences, as if there had been no others.
        let (frame, dense) = (film.develop(), dense.develop());
        for layer in [Layer::Dx, Layer::DxVariance, Layer::BinDx(3), Layer::BinAmbientDx(7)] {
            assert_eq!(frame.get(layer), dense.get(layer), "{layer:?}");
        }
        assert_eq!(frame.get(Layer::EdgeSamples).unwrap().data, [8.0; 2]);
        assert_eq!(dense.get(Layer::EdgeSamples), None);
        let mut twice = film.clone();
        twice.merge(&film);
        assert_eq!(twice.develop().get(Layer::EdgeSamples).unwrap().data, [16.0; 2]);
        assert_eq!(twice.develop().get(Layer::Dx), frame.get(Layer::Dx));
    }

    #[test]
    fn known_zeros_are_developed_without_being_recorded() {
        let mut film = Film::new(3, 2, Needs { edges: EdgeNeed::KnownZero, ..Needs::ALL });
        add(&mut film, 0, 1, false);
        let frame = film.develop();
        assert_eq!(frame.get(Layer::BinAmbientDy(5)), None);
        for layer in [Layer::Dx, Layer::DyVariance, Layer::BinDx(2)] {
            assert!(frame.get(layer).unwrap().data.iter().all(|&value| value == 0.0), "{layer:?}");
        }
        assert!(film.needs.bytes_per_pixel() < Needs::ALL.bytes_per_pixel());
        assert!(film.needs.cover(Needs { edges: EdgeNeed::KnownZero, ..Needs::default() }));
        assert!(!film.needs.cover(Needs::EDGES));
    }
}
