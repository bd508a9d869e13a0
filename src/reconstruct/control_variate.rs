//! Control variates along edges (Rousselle et al. 2016): every pixel is replaced, again and again, by a mean of itself
//! and of its neighbours, each corrected by the sampled difference. Stopping early holds the image near the colour, as
//! the screening does in `l2`.

use rayon::prelude::*;

use super::inputs::{Inputs, check_memory};
use super::{Context, Method, Parameter, Parameters, Reconstruction, Solution};
use crate::error::{Error, Result};
use crate::film::{Frame, Layer, Needs};
use crate::image::Image;
use crate::image::planes::Planes;
use crate::solve::graph::Quad;

/// `control_variate`.
pub const METHOD: Method = Method {
    id: "control_variate",
    summary: "repeated means of each pixel with its neighbours plus the sampled differences",
    parameters: &[
        Parameter {
            name: "iterations",
            default: "50",
            summary: "how often, 1 to 10000: the more, the farther noise is spread",
        },
        Parameter {
            name: "weights",
            default: "variance",
            summary: "of the mean: `uniform`, unbiased, or by inverse `variance`",
        },
        Parameter {
            name: "cross",
            default: "off",
            summary: "whether each half of the samples is weighted by the other's variances, `on` (unbiased) or `off`",
        },
    ],
    make,
};

#[derive(Clone, Copy, PartialEq)]
enum Weighting {
    Uniform,
    /// By the variances of all samples.
    Variance,
    /// Each half by the variances of the other one.
    Cross,
}

/// Bytes held for every pixel besides the frame, an upper bound.
const BYTES: u64 = 250;

fn make(parameters: &Parameters) -> Result<Box<dyn Reconstruction>> {
    let uniform = parameters.choice("weights", &["uniform", "variance"])? == "uniform";
    let weighting = match (uniform, parameters.switch("cross")?) {
        (true, _) => Weighting::Uniform,
        (_, true) => Weighting::Cross,
        _ => Weighting::Variance,
    };
    let iterations = parameters.get("iterations", "a number from 1 to 10000", |n| (1..=10_000).contains(n))?;
    Ok(Box::new(ControlVariate { iterations, weighting }))
}

struct ControlVariate {
    iterations: u32,
    weighting: Weighting,
}

impl Reconstruction for ControlVariate {
    fn needs(&self) -> Needs {
        Needs { edges: true, bins: self.weighting == Weighting::Cross, ..Needs::default() }
    }

    fn reconstruct(&self, frame: &Frame, context: &Context) -> Result<Solution> {
        let inputs = Inputs::new(frame, 1)?;
        check_memory(frame, context, METHOD.id, BYTES)?;
        let all = || Estimate::of_all(&inputs);
        let solution = match self.weighting {
            Weighting::Uniform => Shares::uniform(frame).apply(&all()?, self.iterations),
            Weighting::Variance => {
                let all = all()?;
                Shares::by_variance(frame, &all).apply(&all, self.iterations)
            }
            Weighting::Cross => {
                let halves = [Estimate::of_half(&inputs, 0)?, Estimate::of_half(&inputs, 1)?];
                let [a, b] =
                    [0, 1].map(|k| Shares::by_variance(frame, &halves[1 - k]).apply(&halves[k], self.iterations));
                a.iter().zip(&b).map(|(a, b)| std::array::from_fn(|c| 0.5 * (a[c] + b[c]))).collect()
            }
        };
        Ok(Solution { image: inputs.image(&solution), error: None, notes: Vec::new() })
    }
}

/// Colour, or differences along an axis, with the variance of the mean, mean over the channels.
struct Estimate {
    value: Vec<Quad>,
    variance: Vec<f32>,
}

/// Radius of the squares that variances are averaged over: a pixel's own one goes with its value, and weights by it
/// would favour what is too dark.
const SMOOTHING: usize = 2;

impl Estimate {
    /// `edge` is the step from a pixel to the next of the differences, and zero for colours.
    fn new(inputs: &Inputs, mean: &Image, variance: &Image, edge: (usize, usize)) -> Self {
        let scale = inputs.scale;
        let value = |rgb: &[f32]| [rgb[0] * scale, rgb[1] * scale, rgb[2] * scale, 0.0];
        let rgb = |x: usize, y: usize| variance.pixel(x, y).iter().map(|v| v * scale * scale / 3.0).sum();
        // Beyond the last edge there is none: its variance stands there, for the means.
        let last = (variance.width.saturating_sub(edge.0 + 1), variance.height.saturating_sub(edge.1 + 1));
        let variance = Planes::from_fn(variance.width, variance.height, 1, |_, x, y| rgb(x.min(last.0), y.min(last.1)));
        let variance = variance.box_mean(SMOOTHING).to_image(variance.width, variance.height, 1.0).data;
        Self { value: mean.data.par_chunks_exact(3).map(value).collect(), variance }
    }

    /// Colour and differences to the right and downwards, of all samples.
    fn of_all(inputs: &Inputs) -> Result<[Self; 3]> {
        let of = |mean, variance, edge| {
            let (mean, variance) = (inputs.frame.require(mean)?, inputs.frame.require(variance)?);
            Ok::<_, Error>(Self::new(inputs, mean, variance, edge))
        };
        Ok([
            of(Layer::Color, Layer::ColorVariance, (0, 0))?,
            of(Layer::Dx, Layer::DxVariance, (1, 0))?,
            of(Layer::Dy, Layer::DyVariance, (0, 1))?,
        ])
    }

    /// The same of a half of the samples.
    fn of_half(inputs: &Inputs, half: usize) -> Result<[Self; 3]> {
        let of = |bin, edge| {
            let [mean, variance] = inputs.frame.half(bin, half)?;
            Ok::<_, Error>(Self::new(inputs, &mean, &variance, edge))
        };
        Ok([of(Layer::BinColor, (0, 0))?, of(Layer::BinDx, (1, 0))?, of(Layer::BinDy, (0, 1))?])
    }
}

/// A pixel's neighbours: along which axis, and whether it is the next or the one before.
const NEIGHBOURS: [(usize, bool); 4] = [(0, true), (0, false), (1, true), (1, false)];

/// Weights of pixels and their neighbours, which add up to one.
struct Shares {
    width: usize,
    shares: Vec<[f32; 5]>,
}

impl Shares {
    /// The neighbour of a pixel and the pixel whose difference leads there.
    fn neighbour(width: usize, pixels: usize, i: usize, (axis, next): (usize, bool)) -> Option<(usize, usize)> {
        let (step, inside) = match (axis, next) {
            (0, true) => (1, !(i + 1).is_multiple_of(width)),
            (0, false) => (1, !i.is_multiple_of(width)),
            (_, true) => (width, i + width < pixels),
            (_, false) => (width, i >= width),
        };
        inside.then(|| if next { (i + step, i) } else { (i - step, i - step) })
    }

    fn new(width: usize, pixels: usize, weight: impl Fn(usize, Option<(usize, usize, usize)>) -> f32 + Sync) -> Self {
        let shares = (0..pixels).into_par_iter().map(|i| {
            let mut shares = [weight(i, None), 0.0, 0.0, 0.0, 0.0];
            for (share, at) in shares[1..].iter_mut().zip(NEIGHBOURS) {
                if let Some((to, edge)) = Self::neighbour(width, pixels, i, at) {
                    *share = weight(i, Some((to, at.0, edge)));
                }
            }
            let total: f32 = shares.iter().sum();
            shares.map(|share| share / total)
        });
        Self { width, shares: shares.collect() }
    }

    fn uniform(frame: &Frame) -> Self {
        Self::new(frame.width, frame.width * frame.height, |_, _| 1.0)
    }

    /// By the inverse of the variance that each of the five has as an estimate of the pixel.
    fn by_variance(frame: &Frame, [color, dx, dy]: &[Estimate; 3]) -> Self {
        let least = 1e-12 + 1e-6 * color.variance.iter().sum::<f32>() / color.variance.len() as f32;
        Self::new(frame.width, color.variance.len(), |i, neighbour| {
            let variance = match neighbour {
                None => color.variance[i],
                Some((to, axis, edge)) => color.variance[to] + [dx, dy][axis].variance[edge],
            };
            1.0 / (variance + least)
        })
    }

    /// Replaces every pixel by the mean of the five, so many times.
    fn apply(&self, [color, dx, dy]: &[Estimate; 3], iterations: u32) -> Vec<Quad> {
        let pixels = self.shares.len();
        // What the differences add is the same every time.
        let correction = |i: usize| {
            let mut sum: Quad = [0.0; 4];
            for (share, at) in self.shares[i][1..].iter().zip(NEIGHBOURS) {
                if let Some((_, edge)) = Self::neighbour(self.width, pixels, i, at) {
                    let share = if at.1 { -share } else { *share };
                    (0..3).for_each(|c| sum[c] += share * [dx, dy][at.0].value[edge][c]);
                }
            }
            sum
        };
        let corrections: Vec<Quad> = (0..pixels).into_par_iter().map(correction).collect();
        let mean = |i: usize, from: &[Quad]| {
            let mut sum = corrections[i];
            (0..3).for_each(|c| sum[c] += self.shares[i][0] * from[i][c]);
            for (share, at) in self.shares[i][1..].iter().zip(NEIGHBOURS) {
                if let Some((to, _)) = Self::neighbour(self.width, pixels, i, at) {
                    (0..3).for_each(|c| sum[c] += share * from[to][c]);
                }
            }
            sum
        };
        let mut image = color.value.clone();
        let mut next = image.clone();
        for _ in 0..iterations {
            next.par_iter_mut().enumerate().for_each(|(i, slot)| *slot = mean(i, &image));
            std::mem::swap(&mut image, &mut next);
        }
        image
    }
}
