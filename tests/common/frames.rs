//! Frames whose truth is known, with normal noise.

use fluxion::film::{BINS, Frame, Layer};
use fluxion::image::Image;
use fluxion::math::{Rgb, rng, vec3};

pub const WIDTH: usize = 80;
pub const HEIGHT: usize = 60;

/// Samples of a pixel, as frames claim.
pub const SPP: f32 = 64.0;

/// Deviations of a mean of all samples: of colours and of differences.
pub const COLOR: f32 = 0.1;
pub const EDGE: f32 = 0.02;

/// What a frame shows.
pub struct Truth {
    pub color: fn(usize, usize) -> Rgb,
    pub albedo: fn(usize, usize) -> Rgb,
}

/// A normal variate from hashes (Box and Muller 1958).
pub fn normal(seed: u64, i: usize) -> f32 {
    let u = |k: u64| rng::unit(rng::combine(rng::combine(seed, k), i as u64));
    (-2.0 * u(1).max(1e-7).ln()).sqrt() * (std::f32::consts::TAU * u(2)).cos()
}

pub fn image(pixel: impl Fn(usize, usize) -> Rgb) -> Image {
    Image::from_rgb(WIDTH, HEIGHT, pixel)
}

/// A frame with all layers and normal noise; the whole is the mean of its bins.
pub fn frame(seed: u64, Truth { color: truth, albedo }: &Truth) -> Frame {
    let mut frame = Frame::new(WIDTH, HEIGHT);
    let bins = BINS as f32;
    let layers = [
        (Layer::Color, Layer::ColorVariance, (0, 0), COLOR),
        (Layer::Dx, Layer::DxVariance, (1, 0), EDGE),
        (Layer::Dy, Layer::DyVariance, (0, 1), EDGE),
    ];
    for (which, (mean, variance, step, deviation)) in layers.into_iter().enumerate() {
        let bin = [Layer::BinColor, Layer::BinDx, Layer::BinDy][which];
        let exact = |x: usize, y: usize| match step {
            (0, 0) => truth(x, y),
            _ if x + step.0 >= WIDTH || y + step.1 >= HEIGHT => Rgb::ZERO,
            _ => truth(x + step.0, y + step.1) - truth(x, y),
        };
        let mut sum = image(|_, _| Rgb::ZERO);
        for k in 0..BINS {
            let seed = rng::combine(seed, (which * BINS + k) as u64);
            let noise = |x: usize, y: usize| {
                let at = 3 * (y * WIDTH + x);
                vec3(normal(seed, at), normal(seed, at + 1), normal(seed, at + 2)) * deviation * bins.sqrt()
            };
            let values = image(|x, y| exact(x, y) + noise(x, y));
            sum.add(&values);
            frame.set(bin(k as u8), values);
        }
        sum.data.iter_mut().for_each(|value| *value /= bins);
        frame.set(mean, sum);
        frame.set(variance, image(|_, _| Rgb::splat(deviation * deviation)));
    }
    let zero = |channels| Image::new(WIDTH, HEIGHT, channels);
    frame.set(Layer::Albedo, image(albedo));
    frame.set(Layer::Occlusion, Image { data: vec![1.0; WIDTH * HEIGHT], ..zero(1) });
    frame.set(Layer::OcclusionVariance, zero(1));
    frame.set(Layer::AlbedoVariance, zero(3));
    frame.set(Layer::Normal, image(|_, _| vec3(0.0, 1.0, 0.0)));
    frame.set(Layer::NormalVariance, zero(3));
    frame.set(Layer::Depth, Image { data: vec![2.0; WIDTH * HEIGHT], ..zero(1) });
    frame.set(Layer::DepthVariance, zero(1));
    frame.set(Layer::Samples, Image { data: vec![SPP; WIDTH * HEIGHT], ..zero(1) });
    frame
}
