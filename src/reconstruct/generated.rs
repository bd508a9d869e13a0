//! A feature made of the differences (Back et al. 2018): the image whose differences are the sampled ones, as far as
//! they can be trusted. It has every edge that the image has, those of shadows and reflections too.
//!
//! Differences are weighted by one over their variance, and the groups of samples are drawn again and again with
//! replacement; each draw is solved for (bagging). How far the solutions are apart is the feature's variance, by which
//! non-local means clean what noise is left.

use rayon::prelude::*;

use super::features::{Feature, Kind};
use super::inputs::Inputs;
use super::{Parameter, Parameters};
use crate::error::Result;
use crate::film::{BINS, Layer, Needs, bin_count};
use crate::image::nl_means::{self, Guide, Guides, rdfc};
use crate::image::planes::Planes;
use crate::math::rng;
use crate::solve::graph::Quad;
use crate::solve::poisson::{Data, Weights};

/// How the feature is made.
#[derive(Clone, Debug)]
pub struct Options {
    rounds: u32,
    screen: f32,
    variances: Variances,
    prefilter: Prefilter,
    /// Radiance of an ambient light that is added, over the typical luminance.
    ambient: f32,
}

/// What differences are weighted by.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Variances {
    /// Of all samples, averaged over 3x3 pixels; the same in every round.
    Samples,
    /// Of the groups that were drawn, pixel by pixel.
    Draws,
}

/// What cleans the feature.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Prefilter {
    Off,
    /// Non-local means by the feature alone.
    NonLocalMeans,
    /// Filters by the feature, albedo and normal.
    Rdfc,
}

/// Parameters of methods that generate the feature.
pub const ROUNDS: Parameter = Parameter { name: "rounds", default: "10", summary: "draws of the groups, 2 to 100" };
/// See [`ROUNDS`].
pub const SCREEN: Parameter = Parameter {
    name: "screen",
    default: "1",
    summary: "weight of the colour against the differences, both by their variances, 0 to 1; 0 as published",
};
/// See [`ROUNDS`].
pub const VARIANCES: Parameter = Parameter {
    name: "variances",
    default: "samples",
    summary: "whose variances weigh: of all samples, averaged over 3x3 pixels; or of the draws, as published",
};
/// See [`ROUNDS`].
pub const PREFILTER: Parameter = Parameter {
    name: "prefilter",
    default: "rdfc",
    summary: "what cleans the feature: rdfc by albedo and normal too, nlm by itself as published, or off",
};

/// See [`ROUNDS`].
pub const AMBIENT: Parameter = Parameter {
    name: "ambient",
    default: "0",
    summary: "radiance of a light that reaches everything, in the feature only, over the typical luminance, 0 to 1",
};

impl Options {
    /// Reads the parameters.
    pub fn new(parameters: &Parameters) -> Result<Self> {
        let variances = parameters.choice(VARIANCES.name, &["samples", "draws"])?;
        let prefilter = parameters.choice(PREFILTER.name, &["rdfc", "nlm", "off"])?;
        Ok(Self {
            rounds: parameters.get(ROUNDS.name, "a number from 2 to 100", |n| (2..=100).contains(n))?,
            screen: parameters.get(SCREEN.name, "a number in [0, 1]", |n| (0.0..=1.0).contains(n))?,
            ambient: parameters.get(AMBIENT.name, "a number in [0, 1]", |n| (0.0..=1.0).contains(n))?,
            variances: if variances == "samples" { Variances::Samples } else { Variances::Draws },
            prefilter: match prefilter.as_str() {
                "rdfc" => Prefilter::Rdfc,
                "nlm" => Prefilter::NonLocalMeans,
                _ => Prefilter::Off,
            },
        })
    }

    /// What must be rendered.
    pub fn needs(&self) -> Needs {
        let features = self.prefilter == Prefilter::Rdfc;
        Needs { features, edges: true, bins: true, ambient: self.ambient > 0.0, ..Needs::default() }
    }

    /// The same without albedo and normal.
    pub fn without_features(self) -> Self {
        let prefilter = if self.needs().features { Prefilter::NonLocalMeans } else { self.prefilter };
        Self { prefilter, ..self }
    }
}

/// What variances are raised by, in units of the typical luminance squared.
const FLOOR: f32 = 1e-4;

/// Least screening, which keeps the mean where it is.
const PIN: f32 = 1e-5;

/// Residuals of the first problem are brought down to this share.
const TOLERANCE: f64 = 1e-3;

/// Those of the rounds, which start at its solution and tell variances only: a step or two, which find about 0.6 of the
/// variance. What it is multiplied by below accounts for that.
const ROUGHLY: f64 = 0.5;

/// Filters trust variances of solutions too much: errors of neighbouring pixels are alike, whose distances they average as
/// if they were not.
const CORRELATION: f32 = 3.0;

/// Share of the feature's variance that cleaning leaves, as measured.
const LEFT: f32 = 0.7;

/// The cleaned feature, in units of [`Inputs::scale`], and the variance it had before, sum over the channels.
pub fn feature(inputs: &Inputs, options: &Options, progress: &dyn Fn(f32)) -> Result<[Planes; 2]> {
    let raw = bagged(inputs, options, progress)?;
    let variance = raw.variance.clone();
    let mean = match options.prefilter {
        Prefilter::Off => raw.mean,
        Prefilter::NonLocalMeans => nl_means::clean(&raw, 1.0),
        Prefilter::Rdfc => {
            let rows = raw.mean.height;
            let color = Guide { variance: raw.variance.map(|variance| CORRELATION * variance), ..raw };
            let features = [Feature::of(Kind::Albedo, inputs)?.guide(), Feature::of(Kind::Normal, inputs)?.guide()];
            let of_filter = rdfc::Options { window: 5, symmetric: false, choice: 2, rows };
            rdfc::denoise(&Guides { color, features: features.into() }, of_filter, &|_| ()).image
        }
    };
    Ok([mean, variance])
}

/// Estimated squared error of an image that follows the cleaned feature, sum over the channels: what is left of the
/// feature's variance, and `own`, the share of the colour's. Medians over 5x5 pixels leave out single ones that cleaning
/// mends.
pub fn error(variance: &Planes, own: &Planes) -> Planes {
    variance.zip(own, |variance, own| LEFT * variance + own).box_mean(1).median(2)
}

/// The feature and the variance of its mean, sum over the channels.
fn bagged(inputs: &Inputs, options: &Options, progress: &dyn Fn(f32)) -> Result<Guide> {
    let (width, height) = (inputs.frame.width, inputs.frame.height);
    let groups = Groups::of(inputs, options.ambient)?;
    let (all, of_draw) = groups.draw(&[[1; BINS]; 3], true);
    // The ambient light's variances are only known from groups.
    let by_samples = options.variances == Variances::Samples && options.ambient == 0.0;
    let variances = if by_samples { of_samples(inputs)? } else { of_draw };
    let smooth = options.variances == Variances::Samples;
    let variances = if smooth { variances.map(|variances| averaged(variances, (width, height))) } else { variances };
    let mut weights = weights(&variances, options.screen);
    let mut solver = weights.solver(width);
    let [color, dx, dy] = all;
    let right = weights.right(Data { width, data: &color, edges: [&dx, &dy] });
    let whole = solver.solve(&right, color, TOLERANCE).x;
    let mut sums: Vec<Quad> = vec![[0.0; 4]; whole.len()];
    for round in 0..options.rounds {
        let reweighs = options.variances == Variances::Draws;
        let ([color, dx, dy], variances) = groups.draw(&[0, 1, 2].map(|which| draw(round, which)), reweighs);
        if reweighs {
            weights = self::weights(&variances, options.screen);
            solver.replace(weights.graph(width));
        }
        let right = weights.right(Data { width, data: &color, edges: [&dx, &dy] });
        let solution = solver.solve(&right, whole.clone(), ROUGHLY).x;
        // How far it is off, with the squares of that in the fourth place.
        sums.par_iter_mut().zip(&solution).zip(&whole).for_each(|((sum, solution), whole)| {
            let off = [0, 1, 2].map(|c| solution[c] - whole[c]);
            (0..3).for_each(|c| sum[c] += off[c]);
            sum[3] += off.iter().map(|off| off * off).sum::<f32>();
        });
        progress((round + 1) as f32 / options.rounds as f32);
    }
    let rounds = options.rounds as f32;
    // With the same weights in all rounds their mean is the solution of all samples, and some noise.
    let share = if options.variances == Variances::Draws { 1.0 / rounds } else { 0.0 };
    let mean = Planes::from_fn(width, height, 3, |c, x, y| whole[y * width + x][c] + share * sums[y * width + x][c]);
    // Draws of n out of n vary by n - 1 of n parts of what samples do.
    let scale = BINS as f32 / (BINS as f32 - 1.0) / (rounds - 1.0);
    let variance = Planes::from_fn(width, height, 1, |_, x, y| {
        let [r, g, b, squares] = sums[y * width + x];
        scale * (squares - (r * r + g * g + b * b) / rounds).max(0.0)
    });
    Ok(Guide { mean, variance, tolerance: None })
}

/// Weights of colour and differences with these variances.
fn weights([color, dx, dy]: &[Vec<f32>; 3], screen: f32) -> Weights {
    let weigh = |variances: &[f32], weight: f32| variances.par_iter().map(|v| weight / (v + FLOOR)).collect();
    Weights { across: weigh(dx, 1.0), down: weigh(dy, 1.0), screen: weigh(color, screen.max(PIN)) }
}

/// Variances of colour and differences, sums over the channels.
fn of_samples(inputs: &Inputs) -> Result<[Vec<f32>; 3]> {
    let sum = |layer| {
        let quads = inputs.quads(layer)?;
        Ok(quads.par_iter().map(|[r, g, b, _]| (r + g + b) * inputs.scale).collect())
    };
    Ok([sum(Layer::ColorVariance)?, sum(Layer::DxVariance)?, sum(Layer::DyVariance)?])
}

/// Means over 3x3 pixels: variances of single ones are small where outliers happen to be missing, and follow what they
/// are to weigh.
fn averaged(values: Vec<f32>, (width, height): (usize, usize)) -> Vec<f32> {
    let planes = Planes::from_fn(width, height, 1, |_, x, y| values[y * width + x]);
    planes.box_mean(1).to_image(width, height, 1.0).data
}

/// How often each group is drawn.
type Draw = [u32; BINS];

/// As many groups as there are, drawn with replacement; the same for all pixels, so that errors of neighbours stay as
/// they are.
fn draw(round: u32, which: u64) -> Draw {
    let mut draw = [0; BINS];
    for k in 0..BINS as u64 {
        let u = rng::unit(rng::combine(rng::combine(u64::from(round), which), k));
        draw[((u * BINS as f32) as usize).min(BINS - 1)] += 1;
    }
    draw
}

/// Images of all groups.
struct Layers<'a> {
    images: Vec<&'a [f32]>,
    /// Those of the ambient light, if it is on.
    lit: Vec<&'a [f32]>,
    /// To the pixel that samples are taken of, too.
    step: usize,
}

/// The samples of colour and differences in groups.
struct Groups<'a> {
    layers: [Layers<'a>; 3],
    counts: &'a [f32],
    scale: f32,
    ambient: f32,
}

impl<'a> Groups<'a> {
    fn of(inputs: &Inputs<'a>, ambient: f32) -> Result<Self> {
        inputs.frame.require(Layer::Dx)?;
        let images = |layer: fn(u8) -> Layer| {
            let image = |k| Ok(inputs.frame.require(layer(k))?.data.as_slice());
            (0..BINS as u8).map(image).collect::<Result<Vec<_>>>()
        };
        let lit = |layer| if ambient > 0.0 { images(layer) } else { Ok(Vec::new()) };
        Ok(Self {
            layers: [
                Layers { images: images(Layer::BinColor)?, lit: lit(Layer::BinAmbient)?, step: 0 },
                Layers { images: images(Layer::BinDx)?, lit: lit(Layer::BinAmbientDx)?, step: 1 },
                Layers { images: images(Layer::BinDy)?, lit: lit(Layer::BinAmbientDy)?, step: inputs.frame.width },
            ],
            counts: &inputs.frame.require(Layer::Samples)?.data,
            scale: inputs.scale,
            ambient,
        })
    }

    /// Means of the drawn groups, and their variances, sums over the channels, if they are `wanted`.
    fn draw(&self, draws: &[Draw; 3], wanted: bool) -> ([Vec<Quad>; 3], [Vec<f32>; 3]) {
        let of = |which: usize| -> (Vec<Quad>, Vec<f32>) {
            (0..self.counts.len()).into_par_iter().map(|i| self.pixel(which, &draws[which], i, wanted)).unzip()
        };
        let [(color, of_color), (dx, of_dx), (dy, of_dy)] = [of(0), of(1), of(2)];
        ([color, dx, dy], [of_color, of_dx, of_dy])
    }

    fn pixel(&self, which: usize, draw: &Draw, i: usize, wanted: bool) -> (Quad, f32) {
        let Layers { images, lit, step } = &self.layers[which];
        let Some(&far) = self.counts.get(i + step) else { return ([0.0; 4], 0.0) };
        let samples = self.counts[i].min(far) as u32;
        let counts: Draw = std::array::from_fn(|k| bin_count(samples, k));
        let drawn: Draw = std::array::from_fn(|k| if counts[k] > 0 { draw[k] } else { 0 });
        // With fewer samples than groups a draw may be empty; then it is as if all were drawn.
        let drawn = if drawn == [0; BINS] { counts.map(|count| count.min(1)) } else { drawn };
        let weights: [f32; BINS] = std::array::from_fn(|k| (drawn[k] * counts[k]) as f32);
        let share = 1.0 / weights.iter().sum::<f32>().max(1.0);
        let (mut mean, mut squares) = ([0.0; 4], 0.0);
        for c in 0..3 {
            let mut values: [f32; BINS] = std::array::from_fn(|k| images[k][3 * i + c] * self.scale);
            for (value, image) in values.iter_mut().zip(lit) {
                *value += image[3 * i + c] * self.ambient;
            }
            mean[c] = share * (0..BINS).map(|k| weights[k] * values[k]).sum::<f32>();
            if !wanted {
                continue;
            }
            squares += (0..BINS).map(|k| weights[k] * (values[k] - mean[c]).powi(2)).sum::<f32>();
        }
        let groups: u32 = drawn.iter().sum();
        (mean, share * squares / (groups as f32 - 1.0).max(1.0))
    }
}
