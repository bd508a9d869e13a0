//! Adaptive neural kernels (Josse et al. 2025): a network looks at the pilot's samples, chooses the neighbours of every pixel, and gives
//! weights of them for `control_variate:weights=given`.
//!
//! ```text
//! samples ─ Encoder ─ means, largest values ─ U-Net ─ dense layers ─┬─ scores ── the k best ─┬─ Choice
//!                     position in the pixels' grid ─┘               └─ weights ──────────────┘
//! ```

mod encoder;

use half::f16;
use rayon::prelude::*;

pub use self::encoder::Encoder;
use super::{Choice, FEATURES, KernelKind, Parameter, Pilot, PilotNeeds, Selector};
use crate::film::{CROSS, Frame, STEPS, StepWeights, beside};
use crate::nn::{Activation, Convolution, Tensor, UNet, Weights};
use crate::scene::sensor::Sensor;

/// `learned`.
pub const KERNEL: KernelKind = KernelKind {
    id: "learned",
    summary: "the k pixels of a window of 5x5 that a trained network chooses, with weights (Josse et al. 2025)",
    k: 4,
    parameters: &[Parameter::K, Parameter::Neighbours],
    pilot: Some(PilotNeeds { samples: 8, least: 2, encoded: true, ..FEATURES }),
    select,
};

/// The trained network.
const WEIGHTS: &[u8] = include_bytes!("learned.safetensors");

/// How often the U-Net halves the picture.
const HALVINGS: usize = 3;

/// Slope of leaky ReLU.
const SLOPE: f32 = 0.01;

/// Periods, in pixels, of the sines and cosines of a pixel's column and row. They distinguish pixels where all look the same.
const PERIODS: [usize; 2] = [4, 16];
const POSITIONS: usize = 4 * PERIODS.len();

/// Bound of the logarithm of a weight.
const LONGEST: f32 = 8.0;

/// The layers behind the encoder.
struct Network {
    unet: UNet,
    head: [Convolution; 2],
}

impl Network {
    fn new(weights: &Weights) -> Result<Self, String> {
        let unet = UNet::new(weights, "unet.", HALVINGS)?;
        let head = [
            weights.convolution("head.0", 1, Activation::Leaky(SLOPE))?,
            weights.convolution("head.1", 1, Activation::Linear)?,
        ];
        let outputs = head.iter().try_fold(unet.outputs(), |channels, layer| layer.after(channels))?;
        let expected = (2 * encoder::CHANNELS + POSITIONS, 2 * STEPS.len() + 1);
        if (unet.inputs(), outputs) != expected {
            return Err(format!("takes and makes {:?} channels instead of {expected:?}", (unet.inputs(), outputs)));
        }
        Ok(Self { unet, head })
    }

    /// Scores of the 24 steps, then logarithms of the weights of the pixel and across the steps, before they are bounded.
    fn apply(&self, encoded: &Tensor) -> Tensor {
        let mut hidden = self.unet.apply(encoded);
        hidden.data.par_iter_mut().for_each(|value| *value = value.max(SLOPE * *value));
        self.head[1].apply(&self.head[0].apply(&hidden))
    }
}

/// The embedded network, which tests check.
fn embedded() -> Weights {
    Weights::parse(WEIGHTS).expect("the embedded weights are complete")
}

/// An encoder of the samples after the first, whose frame gives it the scale.
pub fn encoder(first: &Frame, sensor: &Sensor) -> Encoder {
    Encoder::new(&embedded(), first, sensor).expect("the embedded weights are an encoder's")
}

fn select(pilot: &Pilot, selector: &Selector) -> Choice {
    let encoder = pilot.encoder.expect("samples were encoded");
    let network = Network::new(&embedded()).expect("the embedded weights are a network's");
    let size = (pilot.frame.width, pilot.frame.height);
    let made = network.apply(&encoder.encoded(network.unet.multiple(), positions));
    let outputs = |pixel: usize| made.pixel(pixel % size.0, pixel / size.0);
    let mask = |pixel: usize| if selector.keeps_cross { CROSS } else { best(outputs(pixel), selector.k, size, pixel) };
    let pixels = 0..pilot.pixels();
    Choice {
        masks: pixels.clone().into_par_iter().map(mask).collect(),
        weights: pixels.into_par_iter().map(|pixel| relative(&outputs(pixel)[STEPS.len()..])).collect(),
    }
}

/// Sines and cosines of a pixel's place.
fn positions(x: usize, y: usize, to: &mut [f32]) {
    for (waves, period) in to.chunks_exact_mut(4).zip(PERIODS) {
        for (pair, place) in waves.chunks_exact_mut(2).zip([x, y]) {
            let phase = std::f32::consts::TAU * (place % period) as f32 / period as f32;
            (pair[0], pair[1]) = (libm::sinf(phase), libm::cosf(phase));
        }
    }
}

/// Mask of the k steps within the film that have the highest scores.
fn best(scores: &[f32], k: u32, size: (usize, usize), pixel: usize) -> u32 {
    let mut steps: Vec<_> = (0..STEPS.len()).filter(|&step| beside(size, pixel, step).is_some()).collect();
    // Stable, so that of equal scores the nearer one comes first.
    steps.sort_by(|&a, &b| scores[b].total_cmp(&scores[a]));
    steps.iter().take(k as usize).fold(0, |mask, step| mask | 1 << step)
}

/// Weights across the steps over that of the pixel, from logarithms of all.
fn relative(logarithms: &[f32]) -> StepWeights {
    let bounded = |value: f32| LONGEST * libm::tanhf(value / LONGEST);
    let own = bounded(logarithms[0]);
    std::array::from_fn(|step| {
        let weight = libm::expf(bounded(logarithms[1 + step]) - own);
        f16::from_f32(weight.clamp(f16::MIN_POSITIVE.to_f32(), f16::MAX.to_f32()))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Samples of one crop as PyTorch was given them, and what it made of them.
    #[test]
    fn inference_is_that_of_pytorch() {
        let vectors = Weights::parse(include_bytes!("../../../tests/data/kernels-learned.safetensors")).unwrap();
        let (scores, weights) = (vectors.tensor("scores").unwrap(), vectors.tensor("weights").unwrap());
        let encoder = Encoder::of_features(&embedded(), (scores.width, scores.height)).unwrap();
        let samples: Vec<_> = (0..).map_while(|k| vectors.tensor(&format!("sample.{k}"))).collect();
        assert!(samples.len() > 2);
        for sample in &samples {
            let pixels: Vec<_> = (0..scores.width * scores.height).collect();
            encoder.add(&pixels, sample.data.clone());
        }
        let network = Network::new(&embedded()).unwrap();
        let made = network.apply(&encoder.encoded(network.unet.multiple(), positions));
        for y in 0..scores.height {
            for x in 0..scores.width {
                let found = made.pixel(x, y);
                let exponentials = found[..STEPS.len()].iter().map(|score| libm::expf(*score));
                let total: f32 = exponentials.clone().sum();
                let close = |a: f32, b: f32| assert!((a - b).abs() < 1e-3 * b.abs().max(0.01), "{a} {b} at {x} {y}");
                exponentials.zip(scores.pixel(x, y)).for_each(|(score, expected)| close(score / total, *expected));
                let expected = weights.pixel(x, y);
                let relative = relative(&found[STEPS.len()..]);
                relative.iter().zip(&expected[1..]).for_each(|(weight, of)| close(weight.to_f32(), of / expected[0]));
            }
        }
    }
}
