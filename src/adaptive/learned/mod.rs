//! Samples go where a trained network expects them to change the image most.

use super::Allocator;
use crate::error::Result;
use crate::film::{Frame, Layer, Needs};
use crate::image::planes::Planes;
use crate::nn::{Stack, Tensor, Weights};
use crate::reconstruct::Solution;

/// The trained network: `tools/train/sampling.py`.
const WEIGHTS: &[u8] = include_bytes!("learned.safetensors");

/// Channels that it sees, and the distances of the taps of its layers.
const CHANNELS: usize = 16;
const DILATIONS: [usize; 4] = [1, 2, 1, 1];

/// Bound of the logarithm of a need.
const LONGEST: f32 = 3.0;

/// Radius of the squares that deviations are averaged over.
const RADIUS: usize = 3;

/// `learned`.
pub struct Learned;

impl Allocator for Learned {
    fn id(&self) -> &'static str {
        "learned"
    }

    fn summary(&self) -> &'static str {
        "by a network that sees colours, features and how both and differences vary (after Josse et al. 2025); for every method"
    }

    fn needs_error(&self) -> bool {
        false
    }

    fn needs(&self) -> Needs {
        Needs { features: true, ..Needs::default() }
    }

    fn need(&self, frame: &Frame, _: Option<&Solution>) -> Result<Vec<f32>> {
        Ok(needs_of(&inputs(frame)?))
    }
}

/// Needs of pixels by what the network sees of them.
fn needs_of(inputs: &Tensor) -> Vec<f32> {
    let network = Weights::parse(WEIGHTS).and_then(|weights| Stack::new(&weights, &DILATIONS, (CHANNELS, 1)));
    let made = network.expect("the embedded weights are a network's").apply(inputs);
    made.data.iter().map(|&value| libm::expf(LONGEST * libm::tanhf(value / LONGEST))).collect()
}

/// Channels of every pixel: logarithms of colours, of their deviation and its mean over a square; albedo, normals, deviations of
/// both and of the depth, and the depth; logarithm of the deviation of differences. Deviations are those of single samples, radiance is
/// in units of the typical luminance; what the frame lacks is zero.
fn inputs(frame: &Frame) -> Result<Tensor> {
    let (color, samples) = (frame.require(Layer::Color)?, frame.require(Layer::Samples)?);
    let mut whole = color.clone();
    if let Some(direct) = frame.get(Layer::Direct) {
        whole.add(direct);
    }
    let scale = 1.0 / whole.typical_luminance();
    let (width, height) = (frame.width, frame.height);
    // Mean over the channels of the deviation of a single sample.
    let deviation = |layer: Layer, x: usize, y: usize| {
        let Some(variance) = frame.get(layer) else { return 0.0 };
        let values = variance.pixel(x, y);
        let roots = values.iter().map(|value| (value * samples.pixel(x, y)[0]).max(0.0).sqrt());
        let mean = roots.sum::<f32>() / values.len() as f32;
        if mean.is_finite() { mean } else { 0.0 }
    };
    let of_color = Planes::from_fn(width, height, 1, |_, x, y| scale * deviation(Layer::ColorVariance, x, y));
    let around = of_color.box_mean(RADIUS);
    let depth = frame.get(Layer::Depth);
    let middle = depth.map_or(1.0, |depth| median(&depth.data).max(1e-9));
    Ok(Tensor::from_fn(width, height, CHANNELS, |x, y, to| {
        let at = |planes: &Planes| libm::log1pf(planes.at(0, x as isize, y as isize));
        for (value, color) in to[..3].iter_mut().zip(color.pixel(x, y)) {
            *value = libm::log1pf((color * scale).max(0.0));
        }
        (to[3], to[4]) = (at(&of_color), at(&around));
        for (k, layer) in [(5, Layer::Albedo), (8, Layer::Normal)] {
            if let Some(image) = frame.get(layer) {
                to[k..k + 3].copy_from_slice(image.pixel(x, y));
            }
        }
        (to[11], to[12]) = (deviation(Layer::AlbedoVariance, x, y), deviation(Layer::NormalVariance, x, y));
        if let Some(depth) = depth.map(|depth| depth.pixel(x, y)[0]) {
            (to[13], to[14]) = (deviation(Layer::DepthVariance, x, y) / (depth + middle), depth / (depth + middle));
        }
        let of_edges = deviation(Layer::DxVariance, x, y) + deviation(Layer::DyVariance, x, y);
        to[15] = libm::log1pf(scale * of_edges / 2.0);
    }))
}

fn median(values: &[f32]) -> f32 {
    let mut sorted = values.to_vec();
    let middle = (sorted.len() - 1) / 2;
    *sorted.select_nth_unstable_by(middle, f32::total_cmp).1
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn needs_are_those_of_pytorch() {
        let vectors = Weights::parse(include_bytes!("../../../tests/data/sampling.safetensors")).unwrap();
        let [input, output] = ["input", "output"].map(|name| vectors.tensor(name).unwrap());
        for (need, expected) in needs_of(&input).iter().zip(&output.data) {
            assert!((need.ln() - expected).abs() < 1e-4, "{} instead of {expected}", need.ln());
        }
    }
}
