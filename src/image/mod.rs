//! Images of floats: rows from the top, channels interleaved.

pub mod channels;
pub mod io;
pub mod nl_means;
pub mod npy;
pub mod planes;
#[cfg(any(test, not(feature = "openimageio")))]
mod pure;
mod radiance;

use crate::math::{Rgb, vec3};

/// `width * height` pixels of `channels` floats each.
#[derive(Clone, Debug, PartialEq, Default)]
pub struct Image {
    /// Pixels in a row.
    pub width: usize,
    /// Number of rows.
    pub height: usize,
    /// Floats in a pixel.
    pub channels: usize,
    /// All samples; pixel (x, y) starts at `(y * width + x) * channels`.
    pub data: Vec<f32>,
}

impl Image {
    /// An image of zeros.
    pub fn new(width: usize, height: usize, channels: usize) -> Self {
        Self { width, height, channels, data: vec![0.0; width * height * channels] }
    }

    /// An RGB image from a function of x and y.
    pub fn from_rgb(width: usize, height: usize, mut pixel: impl FnMut(usize, usize) -> Rgb) -> Self {
        let mut data = Vec::with_capacity(width * height * 3);
        for y in 0..height {
            for x in 0..width {
                data.extend_from_slice(&pixel(x, y).to_array());
            }
        }
        Self { width, height, channels: 3, data }
    }

    /// A part of the image from a pixel on.
    pub fn part(&self, (x, y): (usize, usize), (width, height): (usize, usize)) -> Self {
        let row = |row: usize| &self.data[(row * self.width + x) * self.channels..][..width * self.channels];
        let data = (y..y + height).flat_map(row).copied().collect();
        Self { width, height, channels: self.channels, data }
    }

    /// Whether there is no pixel.
    pub fn is_empty(&self) -> bool {
        self.width * self.height == 0
    }

    /// The samples of one pixel.
    pub fn pixel(&self, x: usize, y: usize) -> &[f32] {
        let at = (y * self.width + x) * self.channels;
        &self.data[at..at + self.channels]
    }

    /// The samples of one pixel, to write.
    pub fn pixel_mut(&mut self, x: usize, y: usize) -> &mut [f32] {
        let at = (y * self.width + x) * self.channels;
        &mut self.data[at..at + self.channels]
    }

    /// A pixel as a colour; an image of one channel is grey.
    pub fn rgb(&self, x: usize, y: usize) -> Rgb {
        match self.pixel(x, y) {
            [r, g, b, ..] => vec3(*r, *g, *b),
            [grey, ..] => Rgb::splat(*grey),
            [] => Rgb::ZERO,
        }
    }

    /// Channel `c` as doubles, row by row.
    pub fn channel(&self, c: usize) -> Vec<f64> {
        self.data.iter().skip(c).step_by(self.channels).map(|&value| f64::from(value)).collect()
    }

    /// Adds `other`, of the same shape, sample by sample.
    pub fn add(&mut self, other: &Self) {
        debug_assert_eq!((self.width, self.height, self.channels), (other.width, other.height, other.channels));
        self.data.iter_mut().zip(&other.data).for_each(|(sum, value)| *sum += value);
    }

    /// Column, row and channel of the first sample that is not finite.
    pub fn not_finite(&self) -> Option<(usize, usize, usize)> {
        self.find(|value| !value.is_finite())
    }

    /// Column, row and channel of the first sample of which something holds.
    pub fn find(&self, holds: impl Fn(f32) -> bool) -> Option<(usize, usize, usize)> {
        let at = self.data.iter().position(|&value| holds(value))?;
        let pixel = at / self.channels;
        Some((pixel % self.width, pixel / self.width, at % self.channels))
    }

    /// Width, height and channels, for comparison and messages.
    pub fn shape(&self) -> (usize, usize, usize) {
        (self.width, self.height, self.channels)
    }
}
