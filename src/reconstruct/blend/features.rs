//! Evidence about candidates: how they differ from each other and, beyond noise, from the sampled colours. tools/train/blend.py
//! computes the same for training.

use crate::error::Result;
use crate::film::Layer;
use crate::image::planes::Planes;
use crate::nn::Tensor;
use crate::reconstruct::common::inputs::Inputs;
use crate::reconstruct::common::residual::{estimated_error, mean, noise, squared_error, trust, windowed};

/// Radius of the window that residuals are averaged over, by themselves.
const RESIDUAL: usize = 3;

/// Luminance below which differences count as absolute, in units of the typical luminance.
const DARK: f32 = 0.1;

/// Planes with one channel for every candidate, and planes of one channel. Radiance is in units of its typical luminance.
pub struct Evidence {
    luminance: Planes,
    /// Sampled colour less candidate, mean over a window.
    residual: Planes,
    /// Squared distance from the sampled colours less their noise, mean over a window.
    bias: Planes,
    /// Variance of the sampled colours.
    variance: Planes,
    /// Its means over the windows of residuals and of biases.
    residual_noise: Planes,
    noise: Planes,
    /// Estimated squared error of one of them.
    claimed: Planes,
    albedo: Planes,
}

impl Evidence {
    /// Evidence from candidates, of which the last one is the sampled colour and number `best` the one whose error is looked at.
    pub fn new(inputs: &Inputs, images: &[Planes], best: usize) -> Result<Self> {
        let [color, variance] = inputs.color()?;
        let variance = noise(&variance);
        let of_each = |of: &dyn Fn(usize) -> Planes| (1..images.len()).fold(of(0), |all: Planes, k| all.and(&of(k)));
        let luminance = of_each(&|k| mean(&images[k]));
        let sampled = mean(&color);
        let residual =
            of_each(&|k| sampled.zip(&luminance.part(k, 1), |sampled, own| sampled - own).box_mean(RESIDUAL));
        let bias = of_each(&|k| squared_error(&color, &variance, &images[k]));
        let noise = windowed(&variance).map(|noise| noise.max(1e-9));
        let residual_noise = variance.box_mean(RESIDUAL);
        let claimed = estimated_error(&bias.part(best, 1), &noise);
        let albedo = mean(&inputs.planes(Layer::Albedo, 1.0)?);
        Ok(Self { luminance, residual, bias, variance, residual_noise, noise, claimed, albedo })
    }

    /// Features of the network: four for every candidate, then five of the pixel, of which `samples` is the last.
    pub fn features(&self, samples: f32) -> Tensor {
        let (count, side) = (self.luminance.channels(), (2 * RESIDUAL + 1) as f32);
        let (width, height) = (self.luminance.width, self.luminance.height);
        Tensor::from_fn(width, height, 4 * count + 5, |x, y, pixel| {
            let (x, y) = (x as isize, y as isize);
            let at = |planes: &Planes| planes.at(0, x, y);
            let luminance = |k: usize| self.luminance.at(k, x, y);
            let middle = ((0..count).map(luminance).sum::<f32>() / count as f32).max(0.0);
            let unit = middle + DARK;
            let deviation = (at(&self.residual_noise) / (side * side) + 1e-9).sqrt();
            let noise = at(&self.noise);
            for k in 0..count {
                let residual = self.residual.at(k, x, y);
                pixel[k] = libm::asinhf(3.0 * (luminance(k) - middle) / unit);
                pixel[count + k] = libm::asinhf(3.0 * residual / unit);
                pixel[2 * count + k] = libm::asinhf(residual / deviation);
                pixel[3 * count + k] = libm::asinhf(self.bias.at(k, x, y) / noise);
            }
            let relative = |square: f32| 0.5 * libm::logf(square.max(0.0) + 1e-7) - libm::logf(unit);
            let rest = [
                relative(at(&self.variance)),
                libm::logf(unit),
                relative(at(&self.claimed)),
                at(&self.albedo),
                samples,
            ];
            pixel[4 * count..].copy_from_slice(&rest);
        })
    }

    /// Weights after the safety rule: candidates that differ from the sampled colours by more than noise lose theirs to these.
    pub fn safe(&self, weights: Planes, spp: f32) -> Planes {
        let last = weights.channels() - 1;
        let trusts: Vec<_> = (0..last).map(|k| trust(&self.noise, &self.bias.part(k, 1), spp)).collect();
        let kept = |k: usize, x: isize, y: isize| weights.at(k, x, y) * trusts[k].at(0, x, y);
        Planes::from_fn(weights.width, weights.height, last + 1, |k, x, y| {
            let (x, y) = (x as isize, y as isize);
            if k < last { kept(k, x, y) } else { 1.0 - (0..last).map(|k| kept(k, x, y)).sum::<f32>() }
        })
    }
}
