//! Film to frame: sums become means, and the two ends of every edge are joined.

use super::sample::Moments;
use super::{BINS, Bin, Film, Frame, Layer, Tile};
use crate::image::Image;

/// Positions of right, left, down and up among a pixel's twelve edge values.
const RIGHT: usize = 0;
const LEFT: usize = 3;
const DOWN: usize = 6;
const UP: usize = 9;

impl Film {
    /// Means and variances of the mean of everything recorded so far.
    pub fn develop(&self) -> Frame {
        let mut frame = Frame::new(self.width, self.height);
        frame.set(Layer::Color, self.image(3, |tile, i, c| tile.color[i].mean[c]));
        frame.set(Layer::ColorVariance, self.image(3, |tile, i, c| tile.color[i].variance_of_mean(c, tile.counts[i])));
        frame.set(Layer::Direct, self.image(3, |tile, i, c| tile.direct.get(i).map_or(0.0, |direct| direct.mean[c])));
        frame.set(
            Layer::DirectVariance,
            self.image(3, |tile, i, c| {
                tile.direct.get(i).map_or(0.0, |direct| direct.variance_of_mean(c, tile.counts[i]))
            }),
        );
        frame.set(Layer::Samples, self.image(1, |tile, i, _| tile.counts[i] as f32));
        frame
            .set(Layer::Rejected, self.image(1, |tile, i, _| tile.rejected.get(i).copied().unwrap_or_default() as f32));
        if self.needs.features {
            self.develop_moments(&mut frame, [Layer::Albedo, Layer::AlbedoVariance], 0, |tile, i| &tile.features[i]);
            self.develop_moments(&mut frame, [Layer::Normal, Layer::NormalVariance], 3, |tile, i| &tile.features[i]);
            self.develop_moments(&mut frame, [Layer::Depth, Layer::DepthVariance], 6, |tile, i| &tile.features[i]);
        }
        if self.needs.occlusion {
            let layers = [Layer::Occlusion, Layer::OcclusionVariance];
            self.develop_moments(&mut frame, layers, 0, |tile, i| &tile.places[i]);
        }
        if self.needs.position {
            self.develop_moments(&mut frame, [Layer::Position, Layer::PositionVariance], 1, |tile, i| &tile.places[i]);
        }
        if self.needs.edges {
            for (mean, variance, here, there) in
                [(Layer::Dx, Layer::DxVariance, RIGHT, LEFT), (Layer::Dy, Layer::DyVariance, DOWN, UP)]
            {
                let step = if here == RIGHT { (1, 0) } else { (0, 1) };
                frame.set(
                    mean,
                    self.edge_image(step, |tile, i, near, c| {
                        let end = if near { here } else { there };
                        tile.edges[i].mean[end + c] * if near { 1.0 } else { -1.0 }
                    }),
                );
                frame.set(
                    variance,
                    self.edge_image(step, |tile, i, near, c| {
                        let moments: &Moments<12> = &tile.edges[i];
                        moments.variance_of_mean(if near { here } else { there } + c, tile.counts[i])
                    }),
                );
            }
        }
        for k in 0..BINS as u8 {
            if self.needs.bins {
                let layers = [Layer::BinColor(k), Layer::BinDx(k), Layer::BinDy(k)];
                self.develop_bin(&mut frame, layers, |tile, i| &tile.bins[i][k as usize]);
            }
            if self.needs.ambient {
                let layers = [Layer::BinAmbient(k), Layer::BinAmbientDx(k), Layer::BinAmbientDy(k)];
                self.develop_bin(&mut frame, layers, |tile, i| &tile.ambient[i][k as usize]);
            }
        }
        frame
    }

    /// Mean and variance of values from `first` on.
    fn develop_moments<const N: usize>(
        &self,
        frame: &mut Frame,
        [mean, variance]: [Layer; 2],
        first: usize,
        moments: fn(&Tile, usize) -> &Moments<N>,
    ) {
        let channels = mean.info().channels.len();
        frame.set(mean, self.image(channels, |tile, i, c| moments(tile, i).mean[first + c]));
        let of_mean = |tile: &Tile, i: usize, c| moments(tile, i).variance_of_mean(first + c, tile.counts[i]);
        frame.set(variance, self.image(channels, of_mean));
    }

    fn develop_bin(&self, frame: &mut Frame, [color, dx, dy]: [Layer; 3], bin: impl Fn(&Tile, usize) -> &Bin) {
        frame.set(color, self.image(3, |tile, i, c| bin(tile, i).color[c]));
        if !self.needs.edges {
            return;
        }
        for (layer, step, here, there) in [(dx, (1, 0), RIGHT, LEFT), (dy, (0, 1), DOWN, UP)] {
            frame.set(
                layer,
                self.edge_image(step, |tile, i, near, c| {
                    let end = if near { here } else { there } / 3;
                    bin(tile, i).edges[end][c] * if near { 1.0 } else { -1.0 }
                }),
            );
        }
    }

    /// The tile of a pixel and its position in it.
    fn at(&self, x: usize, y: usize) -> (&Tile, usize) {
        let columns = self.width.div_ceil(super::TILE);
        let tile = &self.tiles[y / super::TILE * columns + x / super::TILE];
        (tile, (y - tile.y) * tile.width + (x - tile.x))
    }

    fn image(&self, channels: usize, value: impl Fn(&Tile, usize, usize) -> f32) -> Image {
        let mut image = Image::new(self.width, self.height, channels);
        for tile in &self.tiles {
            for i in 0..tile.counts.len() {
                let pixel = image.pixel_mut(tile.x + i % tile.width, tile.y + i / tile.width);
                pixel.iter_mut().enumerate().for_each(|(c, slot)| *slot = value(tile, i, c));
            }
        }
        image
    }

    /// Sums of a value at the near end (`true`) and the far end (`false`) of every edge along `step`.
    fn edge_image(&self, step: (usize, usize), value: impl Fn(&Tile, usize, bool, usize) -> f32) -> Image {
        let mut image = Image::new(self.width, self.height, 3);
        for y in 0..self.height - step.1 {
            for x in 0..self.width - step.0 {
                let ((near, i), (far, j)) = (self.at(x, y), self.at(x + step.0, y + step.1));
                // Half an edge is no estimate of it.
                if near.counts[i] == 0 || far.counts[j] == 0 {
                    continue;
                }
                let pixel = image.pixel_mut(x, y);
                pixel
                    .iter_mut()
                    .enumerate()
                    .for_each(|(c, slot)| *slot = value(near, i, true, c) + value(far, j, false, c));
            }
        }
        image
    }
}
