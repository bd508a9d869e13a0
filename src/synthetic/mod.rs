//! Frames made by formula, whose truth is known: for the stress cases, the tests and the benches.

use crate::film::{BINS, Frame, Layer};
use crate::image::Image;
use crate::math::{Rgb, rng, vec3};

/// Samples of every pixel that synthetic frames claim to have.
pub const SPP: f32 = 64.0;

/// Noise of the means of all samples. Every bin has as many samples, so that its deviation is √8 times as large.
#[derive(Clone, Copy, Debug)]
pub struct Noise {
    /// Standard deviation of colours, in radiance.
    pub color: f32,
    /// Standard deviation of differences, in radiance.
    pub edge: f32,
    /// Distribution of the noise.
    pub distribution: Distribution,
}

/// Distributions of mean zero and variance one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Distribution {
    /// Uniform between two bounds.
    Uniform,
    /// Normal.
    Normal,
}

impl Distribution {
    /// Variate number `i` of a sequence.
    fn variate(self, seed: u64, i: usize) -> f32 {
        match self {
            Self::Uniform => 12f32.sqrt() * (random(seed, i) - 0.5),
            Self::Normal => normal(seed, i),
        }
    }
}

/// A hash as a number in [0, 1).
pub fn random(seed: u64, i: usize) -> f32 {
    rng::unit(rng::combine(rng::mix(seed), i as u64))
}

/// A normal variate from hashes (Box and Muller 1958).
pub fn normal(seed: u64, i: usize) -> f32 {
    let u = |k: u64| rng::unit(rng::combine(rng::combine(seed, k), i as u64));
    (-2.0 * u(1).max(1e-7).ln()).sqrt() * (std::f32::consts::TAU * u(2)).cos()
}

/// A picture with steps, slopes and flat parts, between 0.3 and 3.
pub fn picture((width, height): (usize, usize)) -> Image {
    Image::from_rgb(width, height, |x, y| {
        let step = f32::from(u8::from(x > width / 3)) + f32::from(u8::from(y > height / 2));
        let (x, y) = (x as f32, y as f32);
        vec3(1.5 + (0.1 * x).sin(), 1.2 + 0.5 * (0.07 * y).cos(), 0.3 + step)
    })
}

/// A picture of one grey.
pub fn flat((width, height): (usize, usize), value: f32) -> Image {
    Image::from_rgb(width, height, |_, _| Rgb::splat(value))
}

/// Differences of a picture along `step`; zero where there is no edge.
pub fn differences(image: &Image, step: (usize, usize)) -> Image {
    Image::from_rgb(image.width, image.height, |x, y| {
        let (a, b) = (x + step.0, y + step.1);
        if a < image.width && b < image.height { image.rgb(a, b) - image.rgb(x, y) } else { Rgb::ZERO }
    })
}

/// Layers of a sampled quantity: its mean, its variance, and the means of its bins.
pub type Sampled = (Layer, Layer, fn(u8) -> Layer);

/// The sampled quantities: colour and differences.
pub const SAMPLED: [Sampled; 3] = [
    (Layer::Color, Layer::ColorVariance, Layer::BinColor),
    (Layer::Dx, Layer::DxVariance, Layer::BinDx),
    (Layer::Dy, Layer::DyVariance, Layer::BinDy),
];

/// Noise-free values of a layer that is determined by the picture.
fn truth_of(layer: Layer, image: &Image) -> Option<Image> {
    match layer {
        Layer::Color | Layer::BinColor(_) => Some(image.clone()),
        Layer::Dx | Layer::BinDx(_) => Some(differences(image, (1, 0))),
        Layer::Dy | Layer::BinDy(_) => Some(differences(image, (0, 1))),
        _ => None,
    }
}

/// A frame with all layers, whose colours and differences are those of a picture, without noise.
pub fn exact(image: &Image) -> Frame {
    let (width, height) = (image.width, image.height);
    let mut frame = Frame::new(width, height);
    for layer in Layer::all() {
        let value = match layer {
            Layer::Samples | Layer::EdgeSamples => SPP,
            Layer::Albedo | Layer::Normal => 0.5,
            Layer::Depth | Layer::Occlusion => 1.0,
            _ => 0.0,
        };
        let channels = layer.info().channels.len();
        let plain = || Image { data: vec![value; width * height * channels], ..Image::new(width, height, channels) };
        frame.set(layer, truth_of(layer, image).unwrap_or_else(plain));
    }
    frame
}

/// The same with noise and its variances; the mean of all samples is that of the bins.
pub fn noisy(image: &Image, noise: Noise, seed: u64) -> Frame {
    let mut frame = exact(image);
    for (kind, (whole, variance, bin)) in SAMPLED.into_iter().enumerate() {
        let deviation = if whole == Layer::Color { noise.color } else { noise.edge };
        let of_bin = deviation * (BINS as f32).sqrt();
        change(&mut frame, whole, |_, _| 0.0);
        for k in 0..BINS as u8 {
            let seed = rng::combine(seed, (kind * BINS) as u64 + u64::from(k));
            change(&mut frame, bin(k), |i, value| value + of_bin * noise.distribution.variate(seed, i));
            let mean = frame.get(bin(k)).map(|image| image.data.clone()).unwrap_or_default();
            change(&mut frame, whole, |i, value| value + mean[i] / BINS as f32);
        }
        change(&mut frame, variance, |_, _| deviation * deviation);
    }
    frame
}

/// Replaces every value of a layer by a function of its index and itself.
pub fn change(frame: &mut Frame, layer: Layer, new: impl Fn(usize, f32) -> f32) {
    if let Some(mut image) = frame.get(layer).cloned() {
        image.data.iter_mut().enumerate().for_each(|(i, value)| *value = new(i, *value));
        frame.set(layer, image);
    }
}

/// Changes the exposure of a frame: radiance is multiplied by a factor, variances of radiance by its square.
pub fn expose(frame: &mut Frame, factor: f32) {
    for layer in Layer::all() {
        let factor = match layer.info().unit {
            "radiance" => factor,
            "radiance²" => factor * factor,
            _ => continue,
        };
        change(frame, layer, |_, value| value * factor);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn noise_has_the_deviation_that_the_frame_claims() {
        let image = picture((61, 47));
        for distribution in [Distribution::Uniform, Distribution::Normal] {
            let frame = noisy(&image, Noise { color: 0.3, edge: 0.06, distribution }, 1);
            for (layer, truth, deviation) in
                [(Layer::Color, image.clone(), 0.3), (Layer::Dx, differences(&image, (1, 0)), 0.06)]
            {
                let values = frame.get(layer).unwrap().data.iter().zip(&truth.data);
                let squares = values.map(|(a, b)| f64::from(a - b).powi(2)).sum::<f64>() / truth.data.len() as f64;
                assert!((squares.sqrt() / deviation - 1.0).abs() < 0.05, "{layer:?}: {}", squares.sqrt());
            }
        }
    }
}
