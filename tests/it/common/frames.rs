//! Frames whose truth is known, with normal noise.

use fluxion::film::{Frame, Layer};
use fluxion::image::Image;
use fluxion::internals::math::{Rgb, vec3};
use fluxion::internals::synthetic::{Distribution, Noise, noisy};

pub const WIDTH: usize = 80;
pub const HEIGHT: usize = 60;

/// Standard deviations of a mean of all samples: of colours and of differences.
pub const COLOR: f32 = 0.1;
pub const EDGE: f32 = 0.02;

/// The picture of a frame.
pub struct Truth {
    pub color: fn(usize, usize) -> Rgb,
    pub albedo: fn(usize, usize) -> Rgb,
}

pub fn image(pixel: impl Fn(usize, usize) -> Rgb) -> Image {
    Image::from_rgb(WIDTH, HEIGHT, pixel)
}

/// A frame with all layers and normal noise; the mean of all samples is that of the bins.
pub fn frame(seed: u64, Truth { color, albedo }: &Truth) -> Frame {
    let noise = Noise { color: COLOR, edge: EDGE, distribution: Distribution::Normal };
    let mut frame = noisy(&image(color), noise, seed);
    frame.set(Layer::Albedo, image(albedo));
    frame.set(Layer::Normal, image(|_, _| vec3(0.0, 1.0, 0.0)));
    frame
}
