//! The error of the whole image. Methods estimate the pattern of the errors of pixels better than their scale; the scale is
//! estimated from new samples, which are independent of the last image.

use crate::film::{Frame, Layer};
use crate::image::planes::Planes;
use crate::reconstruct::Solution;
use serde::{Deserialize, Serialize};

/// Regularisation of relMSE, in squared luminance.
const EPSILON: f64 = 0.01;

/// Weight of the prior that estimates are right, in the units of [`Estimate::expected`]: about two pixels' worth of
/// evidence, so that estimates of few samples do not swing the scale.
const PRIOR: f64 = 2.0;

/// Weight of squared residuals, whose distribution has heavier tails than that of squared normal variates, which would
/// have weight one.
const HEAVY_TAIL_WEIGHT: f64 = 0.1;

/// Sums over the pixels of all passes so far; errors are relative to the image's brightness.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub struct Estimate {
    /// Weighted squares of expected errors.
    expected: f64,
    /// Weighted products of expected errors with the squared distances of the image from new samples, and with the sample
    /// variances of these.
    found: f64,
    claimed: f64,
    /// Squared distances of new samples from old ones over their sample variances, of scattered light and of directly seen
    /// emitters: stratified samples vary less than their sample variance says.
    spread: [Ratio; 2],
}

/// Found over expected.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
struct Ratio {
    found: f64,
    expected: f64,
}

impl Ratio {
    fn add(&mut self, found: f64, expected: f64) {
        self.found += found;
        self.expected += expected;
    }

    /// At most one: stratification does not add variance.
    fn value(self) -> f64 {
        if self.expected > 0.0 { (self.found / self.expected).clamp(0.01, 1.0) } else { 1.0 }
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

    /// Moments of the samples added since `before`; there were `n` samples then and are `all` now.
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
    /// Compares the image of a pass with the samples that were added since.
    pub fn learn(&mut self, before: &Frame, solution: &Solution, after: &Frame) {
        let (Some(error), Some(n), Some(all), Some(noise)) =
            (&solution.error, before.get(Layer::Samples), after.get(Layer::Samples), smooth_variance(before))
        else {
            return;
        };
        let expected = |at: usize, color: &Moments, direct: &Moments| {
            let relative = 1.0 / (color.mean.powi(2) + EPSILON);
            (relative, relative * scattered(f64::from(error.data[at]), direct.variance))
        };
        let of = |at, frame| Some([Moments::of(frame, COLOR, at)?, Moments::of(frame, DIRECT, at)?]);
        let values = solution.image.data.len();
        let known = |at| of(at, before).map_or(0.0, |[color, direct]| expected(at, &color, &direct).1);
        // Where noise is small beside the typical error, all pixels have the same weight.
        let typical = (0..values).map(known).sum::<f64>() / values as f64;
        for (at, &noise) in noise.iter().enumerate() {
            let (n, all) = (f64::from(n.data[at / 3]), f64::from(all.data[at / 3]));
            let (Some([color, direct]), Some([color_after, direct_after])) = (of(at, before), of(at, after)) else {
                return;
            };
            if all - n < 2.0 || n < 2.0 {
                continue;
            }
            let (relative, expected) = expected(at, &color, &direct);
            // Pixels are weighted by the inverse variance of their evidence.
            let spread = relative * f64::from(noise) * n / (all - n) + expected + typical;
            let weight = HEAVY_TAIL_WEIGHT / (2.0 * spread * spread).max(1e-30);
            let new = color_after.since(&color, n, all);
            let distance = f64::from(solution.image.data[at]) - direct.mean - new.mean;
            self.expected += weight * expected * expected;
            self.found += weight * expected * relative * distance.powi(2);
            self.claimed += weight * expected * relative * new.variance;
            let apart = |new: &Moments, old: &Moments| ((new.mean - old.mean).powi(2), new.variance + old.variance);
            let (found, claimed) = apart(&new, &color);
            self.spread[0].add(weight * expected * relative * found, weight * expected * relative * claimed);
            let (found, claimed) = apart(&direct_after.since(&direct, n, all), &direct);
            self.spread[1].add(relative * found, relative * claimed);
        }
    }

    /// Factor of the estimated errors of scattered light.
    fn ratio(&self) -> f64 {
        let found = self.found - self.spread[0].value() * self.claimed;
        ((PRIOR + found) / (PRIOR + self.expected)).clamp(0.1, 10.0)
    }

    /// The estimated relMSE of an image.
    pub fn rel_mse(&self, frame: &Frame, solution: &Solution) -> f64 {
        let Some(error) = &solution.error else { return f64::INFINITY };
        let (of_scattered, of_direct) = (self.ratio(), self.spread[1].value());
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

/// The part of an error that is not due to directly seen emitters.
fn scattered(error: f64, direct: f64) -> f64 {
    (error - direct).max(0.0)
}

/// Variances of the colour, raised to the mean of those around.
fn smooth_variance(frame: &Frame) -> Option<Vec<f32>> {
    let image = frame.get(Layer::ColorVariance)?;
    let (width, height) = (image.width, image.height);
    let planes = Planes::from_fn(width, height, 3, |c, x, y| image.pixel(x, y)[c]);
    Some(planes.zip(&planes.box_mean(2), f32::max).to_image(width, height, 1.0).data)
}
