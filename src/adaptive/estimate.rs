//! The error of the whole image. What methods estimate for pixels is right in its pattern rather than in its size; new
//! samples, which the last image has not seen, tell what it is to be multiplied by.

use crate::film::{Frame, Layer};
use crate::image::planes::Planes;
use crate::reconstruct::Solution;

/// Luminance below which relMSE counts errors as they are.
const EPSILON: f64 = 0.01;

/// How certain it is beforehand that estimates are right: as if so much had been seen.
const PRIOR: f64 = 10.0;

/// Squares of noise are not normally distributed: they tell less than they would.
const TAILS: f64 = 0.1;

/// Ratios of true to estimated errors, from all passes so far.
#[derive(Clone, Copy, Debug)]
pub struct Estimate {
    /// Of the method's estimate: weighted sums of what was found times what was expected, and of the latter's squares.
    scattered: (f64, f64),
    /// Of directly seen emitters, whose samples are spread better than independent ones: sums of found and expected.
    direct: (f64, f64),
}

impl Default for Estimate {
    fn default() -> Self {
        Self { scattered: (PRIOR, PRIOR), direct: (1e-9, 1e-9) }
    }
}

/// Mean and its variance of some samples.
struct Moments {
    mean: f64,
    variance: f64,
}

impl Moments {
    fn of(frame: &Frame, [mean, variance]: [Layer; 2], at: usize) -> Option<Self> {
        let value = |layer| frame.get(layer).map(|image| f64::from(image.data[at]));
        Some(Self { mean: value(mean)?, variance: value(variance)? })
    }

    /// Those of the samples that came between `before`, which `n` samples made, and these, of `all` samples.
    fn since(&self, before: &Self, n: f64, all: f64) -> Self {
        let new = all - n;
        let mean = (all * self.mean - n * before.mean) / new;
        let squares = |moments: &Self, n: f64| moments.variance * n * (n - 1.0);
        let apart = (before.mean - mean).powi(2) * n * new / all;
        let rest = squares(self, all) - squares(before, n) - apart;
        Self { mean, variance: rest.max(0.0) / (new * (new - 1.0)) }
    }
}

const COLOR: [Layer; 2] = [Layer::Color, Layer::ColorVariance];
const DIRECT: [Layer; 2] = [Layer::Direct, Layer::DirectVariance];

impl Estimate {
    /// Compares an image with the samples that were added since.
    pub fn learn(&mut self, before: &Frame, solution: &Solution, after: &Frame) {
        let (Some(error), Some(n), Some(all)) =
            (&solution.error, before.get(Layer::Samples), after.get(Layer::Samples))
        else {
            return;
        };
        let Some(noise) = smooth_variance(before) else { return };
        for at in 0..solution.image.data.len() {
            let pixel = at / 3;
            let (n, all) = (f64::from(n.data[pixel]), f64::from(all.data[pixel]));
            let of = |frame, layers| Moments::of(frame, layers, at);
            let both = (of(before, COLOR), of(after, COLOR), of(before, DIRECT), of(after, DIRECT));
            let (Some(color), Some(color_after), Some(direct), Some(direct_after)) = both else { return };
            if all - n < 2.0 || n < 2.0 {
                continue;
            }
            let weight = 1.0 / (color.mean.powi(2) + EPSILON);
            let new = direct_after.since(&direct, n, all);
            self.direct.0 += weight * (new.mean - direct.mean).powi(2);
            self.direct.1 += weight * (new.variance + direct.variance);

            let new = color_after.since(&color, n, all);
            let expected = scattered(f64::from(error.data[at]), direct.variance);
            let found = (f64::from(solution.image.data[at]) - direct.mean - new.mean).powi(2) - new.variance;
            // Pixels count by how well they tell: one over the variance of `found`.
            let spread = f64::from(noise[at]) * n / (all - n) + expected;
            if spread > 0.0 {
                let weight = TAILS / (2.0 * spread * spread);
                self.scattered.0 += weight * expected * found;
                self.scattered.1 += weight * expected * expected;
            }
        }
    }

    /// The estimated relMSE of an image.
    pub fn rel_mse(&self, frame: &Frame, solution: &Solution) -> f64 {
        let Some(error) = &solution.error else { return f64::INFINITY };
        let ratio = |(found, expected): (f64, f64)| (found / expected).clamp(0.05, 20.0);
        let (of_scattered, of_direct) = (ratio(self.scattered), ratio(self.direct));
        let variance = frame.get(Layer::DirectVariance);
        let relative = |at: usize| {
            let direct = variance.map_or(0.0, |variance| f64::from(variance.data[at]));
            let value = f64::from(solution.image.data[at]);
            let own = scattered(f64::from(error.data[at]), direct);
            (of_scattered * own + of_direct * direct) / (value * value + EPSILON)
        };
        (0..error.data.len()).map(relative).sum::<f64>() / error.data.len() as f64
    }
}

/// The part of an error that is not of directly seen emitters.
fn scattered(error: f64, direct: f64) -> f64 {
    (error - direct).max(0.0)
}

/// Variances of the colour, no less than those around.
fn smooth_variance(frame: &Frame) -> Option<Vec<f32>> {
    let image = frame.get(Layer::ColorVariance)?;
    let (width, height) = (image.width, image.height);
    let planes = Planes::from_fn(width, height, 3, |c, x, y| image.pixel(x, y)[c]);
    Some(planes.zip(&planes.box_mean(2), f32::max).to_image(width, height, 1.0).data)
}
