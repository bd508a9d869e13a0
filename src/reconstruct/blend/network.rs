//! The network: features of a pixel and those around it to weights of the candidates.

use crate::image::planes::Planes;
use crate::nn::tensor::in_bands;
use crate::nn::{Activation, Convolution, Tensor, Weights};

/// Slope of leaky ReLU.
const SLOPE: f32 = 0.01;

/// Distances of the taps of the layers.
const DILATIONS: [usize; 4] = [1, 2, 1, 1];

/// Rows that are worked on at a time: what bounds the memory. Outputs depend on rows up to the sum of the dilations away.
const ROWS: usize = 64;

/// Convolutions, of 3x3 pixels but for the last.
pub struct Network(Vec<Convolution>);

impl Network {
    /// The network for so many candidates. The error says what is wrong with the weights.
    pub fn new(bytes: &[u8], candidates: usize) -> Result<Self, String> {
        let weights = Weights::parse(bytes)?;
        let layer = |(k, &dilation): (usize, &usize)| {
            let activation = if k + 1 < DILATIONS.len() { Activation::Leaky(SLOPE) } else { Activation::Linear };
            weights.convolution(&format!("layer{k}"), dilation, activation)
        };
        let layers = DILATIONS.iter().enumerate().map(layer).collect::<Result<Vec<_>, _>>()?;
        let mut channels = 4 * candidates + 5;
        for layer in &layers {
            channels = layer.after(channels)?;
        }
        if channels != candidates {
            return Err(format!("the weights are for {channels} images instead of {candidates}"));
        }
        Ok(Self(layers))
    }

    /// Weights of the candidates, which sum to one.
    pub fn weights(&self, features: &Tensor) -> Planes {
        let through = |input: &Tensor| {
            let first = self.0[0].apply(input);
            self.0[1..].iter().fold(first, |tensor, layer| layer.apply(&tensor))
        };
        let scores = in_bands(features, (ROWS, 1, DILATIONS.iter().sum()), through);
        let shares = Tensor::from_fn(scores.width, scores.height, scores.channels, |x, y, pixel| {
            let scores = scores.pixel(x, y);
            let largest = scores.iter().fold(f32::NEG_INFINITY, |largest, score| largest.max(*score));
            pixel.iter_mut().zip(scores).for_each(|(share, score)| *share = libm::expf(score - largest));
            let sum: f32 = pixel.iter().sum();
            pixel.iter_mut().for_each(|share| *share /= sum);
        });
        Planes::from_fn(shares.width, shares.height, shares.channels, |k, x, y| shares.pixel(x, y)[k])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_are_those_of_pytorch_and_sum_to_one() {
        let weights = include_bytes!("oidn.safetensors");
        let vectors = Weights::parse(include_bytes!("../../../tests/data/blend-oidn.safetensors")).unwrap();
        let [input, output] = ["input", "output"].map(|name| vectors.tensor(name).unwrap());
        let made = Network::new(weights, output.channels).unwrap().weights(&input);
        for (x, y) in (0..output.height).flat_map(|y| (0..output.width).map(move |x| (x, y))) {
            let shares = (0..output.channels).map(|k| made.at(k, x as isize, y as isize));
            assert!((shares.clone().sum::<f32>() - 1.0).abs() < 1e-6);
            for (share, expected) in shares.zip(output.pixel(x, y)) {
                assert!((share - expected).abs() < 1e-5, "{share} instead of {expected} at {x},{y}");
            }
        }
        assert!(Network::new(weights, 2).err().unwrap().contains("channels instead of 13"));
    }
}
