//! Film to frame: sums become means and variances, and the two ends of every edge are joined.

use rayon::prelude::*;

use super::source::{Axis, Source};
use super::statistic::Statistic;
use super::statistics::Record;
use super::{BINS, Edges, Film, Frame, Kernel, Layer, Tile};
use crate::image::Image;

impl Film {
    /// Means, and variances of the means, of everything recorded so far.
    pub fn develop(&self) -> Frame {
        let mut frame = Frame::new(self.width, self.height);
        for layer in Layer::all() {
            if let Some(image) = self.develop_layer(layer) {
                frame.set(layer, image);
            }
        }
        match &self.kernel {
            Kernel::Cross => {}
            Kernel::Pending => frame.set_edges(Edges::new((self.width, self.height), [])),
            Kernel::Chosen(neighbours) => frame.set_edges(self.joined(neighbours)),
        }
        frame.lights = self.develop_lights();
        frame
    }

    /// The image of a layer, if the film has it.
    fn develop_layer(&self, layer: Layer) -> Option<Image> {
        let (channels, source) = (layer.info().channels.len(), layer.info().source);
        if !source.is_developed(self.needs) {
            return None;
        }
        let of_edges = source.record().is_some_and(|record| record.statistic().of_edges);
        if of_edges && self.kernel != Kernel::Cross {
            return None;
        }
        if source.record().is_some_and(|record| record.is_known_zero(self.needs)) {
            return Some(Image::new(self.width, self.height, channels));
        }
        let bin = layer.bin_number().unwrap_or(0) as usize;
        Some(match source {
            Source::SampleCount => self.image(1, |tile, i, _| tile.counts[i] as f32),
            Source::RejectedCount => {
                self.image(1, |tile, i, _| tile.rejected.get(i).copied().unwrap_or_default() as f32)
            }
            Source::EdgeSampleCount => {
                let differ = |tile: &Tile| !tile.edge_counts.is_empty() && tile.edge_counts != tile.counts;
                if !self.tiles.iter().any(differ) {
                    return None;
                }
                self.image(1, |tile, i, _| tile.edge_count(i) as f32)
            }
            Source::Mean(record, first) => {
                self.image(channels, |tile, i, c| tile.values(record, i).map_or(0.0, |values| values[first + c]))
            }
            Source::Variance(record, first) => self.image(channels, |tile, i, c| tile.variance(record, i, first + c)),
            Source::Bin(record) => self.image(channels, |tile, i, c| tile.bin(record, i, bin)[c]),
            Source::EdgeMean(record, axis) => self.edge_image(axis, |tile, i, end, c| {
                tile.values(record, i).map_or(0.0, |values| end.sign() * values[end.first(axis) + c])
            }),
            Source::EdgeVariance(record, axis) => {
                self.edge_image(axis, |tile, i, end, c| tile.variance(record, i, end.first(axis) + c))
            }
            Source::EdgeBin(record, axis) => {
                self.edge_image(axis, |tile, i, end, c| end.sign() * tile.bin(record, i, bin)[end.first(axis) + c])
            }
        })
    }

    /// The tile of a pixel and the pixel's index in it.
    pub(super) fn at(&self, x: usize, y: usize) -> (&Tile, usize) {
        let tile = &self.tiles[y / super::TILE * self.columns() + x / super::TILE];
        (tile, (y - tile.y) * tile.width + (x - tile.x))
    }

    /// An image from a function of tile, index in the tile, and channel.
    pub(super) fn image(&self, channels: usize, value: impl Fn(&Tile, usize, usize) -> f32 + Sync) -> Image {
        let mut image = Image::new(self.width, self.height, channels);
        let row = self.width * channels;
        let bands = image.data.par_chunks_mut(super::TILE * row.max(1));
        bands.zip(self.tiles.par_chunks(self.columns())).for_each(|(band, tiles)| {
            for tile in tiles {
                for i in 0..tile.counts.len() {
                    let at = i / tile.width * row + (tile.x + i % tile.width) * channels;
                    let pixel = band[at..at + channels].iter_mut().enumerate();
                    pixel.for_each(|(c, slot)| *slot = value(tile, i, c));
                }
            }
        });
        image
    }

    /// Sums of a value at the near and at the far end of every edge along an axis. An edge that has been sampled from
    /// one end only is left zero: half of it is no estimate.
    fn edge_image(&self, axis: Axis, value: impl Fn(&Tile, usize, End, usize) -> f32 + Sync) -> Image {
        let mut image = Image::new(self.width, self.height, 3);
        let rows = image.data.par_chunks_mut(3 * self.width.max(1)).enumerate().take(self.height - axis.step.1);
        rows.for_each(|(y, row)| {
            for (x, pixel) in row.chunks_exact_mut(3).enumerate().take(self.width - axis.step.0) {
                let ((near, i), (far, j)) = (self.at(x, y), self.at(x + axis.step.0, y + axis.step.1));
                if near.edge_count(i) == 0 || far.edge_count(j) == 0 {
                    continue;
                }
                let slots = pixel.iter_mut().enumerate();
                slots.for_each(|(c, slot)| *slot = value(near, i, End::Near, c) + value(far, j, End::Far, c));
            }
        });
        image
    }

    /// Tiles in a row of them.
    fn columns(&self) -> usize {
        self.width.div_ceil(super::TILE).max(1)
    }
}

/// An end of an edge.
#[derive(Clone, Copy, PartialEq)]
enum End {
    Near,
    Far,
}

impl End {
    /// Sign with which the end's own "neighbour minus pixel" enters "far minus near".
    fn sign(self) -> f32 {
        if self == Self::Near { 1.0 } else { -1.0 }
    }

    /// Position of the end's values among the differences of its pixel.
    fn first(self, axis: Axis) -> usize {
        if self == Self::Near { axis.near } else { axis.far }
    }
}

impl Tile {
    /// Values of a statistic at pixel `i`; none if it is sparse and zero in the whole tile.
    pub(super) fn values(&self, record: Record, i: usize) -> Option<&[f32]> {
        self.planes[record as usize].get(self.span(record.statistic(), i))
    }

    pub(super) fn variance(&self, record: Record, i: usize, value: usize) -> f32 {
        let count = self.count_of(record.statistic().of_edges, i);
        self.values(record, i).map_or(0.0, |values| Statistic::variance_of_mean(values, value, count))
    }

    /// Means of bin `k` at pixel `i`.
    pub(super) fn bin(&self, record: Record, i: usize, k: usize) -> &[f32] {
        let span = self.span(record.statistic(), i);
        let count = span.len() / BINS;
        &self.planes[record as usize][span.start + k * count..][..count]
    }
}
