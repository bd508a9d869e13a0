//! A feature made of the differences (Back et al. 2018): the image whose differences are the sampled ones, as far as
//! they can be trusted. It has every edge that the image has, those of shadows and reflections too.
//!
//! Differences are weighted by their inverse variances, and the bins of samples are drawn again and again with
//! replacement; each draw is solved for (bagging). The variance of the solutions is the feature's variance, by which
//! filters remove the noise that is left.

use rayon::prelude::*;

use super::edge_means::{self, Missing};
use super::features::{Feature, Kind};
use super::inputs::Inputs;
use crate::error::Result;
use crate::film::{BINS, EdgeParts, Edges, Layer, Needs, Recorded, bin_count};
use crate::image::nl_means::{self, Guide, Guides, rdfc};
use crate::image::planes::Planes;
use crate::math::rng;
use crate::reconstruct::{Parameter, Parameters};
use crate::solve::graph::Quad;
use crate::solve::poisson::{Targets, Weights};

/// Parameters of the feature.
#[derive(Clone, Debug)]
pub struct Options {
    rounds: u32,
    screen: f32,
    variances: Variances,
    prefilter: Prefilter,
    /// Radiance of an ambient light that is added, over the typical luminance.
    ambient: f32,
}

/// The variances that differences are weighted by.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Variances {
    /// Variances of all samples, averaged over 3x3 pixels; the same in every round.
    Samples,
    /// Variances of the drawn bins, pixel by pixel.
    Draws,
}

/// The filter that cleans the feature.
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

    /// Statistics that the feature is made from.
    pub fn needs(&self) -> Needs {
        let features = self.prefilter == Prefilter::Rdfc;
        Needs::EDGES
            .with(Recorded::Bins)
            .with_if(Recorded::Features, features)
            .with_if(Recorded::Ambient, self.ambient > 0.0)
    }

    /// The same without albedo and normal.
    pub fn without_features(self) -> Self {
        let prefilter = if self.needs().has(Recorded::Features) { Prefilter::NonLocalMeans } else { self.prefilter };
        Self { prefilter, ..self }
    }
}

/// Constant that is added to variances, in squares of the typical luminance.
const FLOOR: f32 = 1e-4;

/// Least weight of the colour, which determines the mean.
const PIN: f32 = 1e-5;

/// Residuals of the first problem are brought down to this share.
const TOLERANCE: f64 = 1e-3;

/// Residuals of the rounds' problems are brought down to this share. They start at the first solution and serve the
/// variance only: a step or two find about 0.6 of it, which [`CORRELATION`] and [`RESIDUAL_VARIANCE`] account for.
const BAG_TOLERANCE: f64 = 0.5;

/// Factor of the feature's variance in its filter: errors of neighbouring pixels are correlated, and the filter averages
/// their distances as if they were independent.
const CORRELATION: f32 = 3.0;

/// Share of the feature's variance that is left after cleaning (measured).
const RESIDUAL_VARIANCE: f32 = 0.7;

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

/// Estimated squared error of an image that follows the cleaned feature, sum over the channels: the residual variance of
/// the feature plus `own`, the share of the colour's variance. Medians over 5x5 pixels ignore single outliers, which
/// cleaning removes.
pub fn error(variance: &Planes, own: &Planes) -> Planes {
    variance.zip(own, |variance, own| RESIDUAL_VARIANCE * variance + own).box_mean(1).median(2)
}

/// The feature and the variance of its mean, sum over the channels.
fn bagged(inputs: &Inputs, options: &Options, progress: &dyn Fn(f32)) -> Result<Guide> {
    let (width, height) = (inputs.frame.width, inputs.frame.height);
    // The ambient light's variances are only known from its bins.
    let by_samples = options.variances == Variances::Samples && options.ambient == 0.0;
    let parts = EdgeParts { variance: by_samples, bins: true, ambient: options.ambient > 0.0 };
    let edges = inputs.frame.edges(parts)?;
    let groups = Groups::new(inputs, &edges, options.ambient)?;
    let Drawn { color, differences, variances: of_draw } = groups.draw(None, true);
    let variances = if by_samples { of_samples(inputs, &edges)? } else { of_draw };
    let smooth = options.variances == Variances::Samples;
    let variances = if smooth { variances.averaged(&edges, (width, height)) } else { variances };
    let mut weights = variances.weights(options.screen);
    let mut solver = weights.solver(&edges);
    let rhs = weights.rhs(Targets { edges: &edges, data: &color, differences: &differences });
    let whole = solver.solve(&rhs, color, TOLERANCE).x;
    let mut sums: Vec<Quad> = vec![[0.0; 4]; whole.len()];
    for round in 0..options.rounds {
        let reweighs = options.variances == Variances::Draws;
        let Drawn { color, differences, variances } = groups.draw(Some(round), reweighs);
        if reweighs {
            weights = variances.weights(options.screen);
            solver.replace(weights.graph(&edges));
        }
        let rhs = weights.rhs(Targets { edges: &edges, data: &color, differences: &differences });
        let solution = solver.solve(&rhs, whole.clone(), BAG_TOLERANCE).x;
        // Sums of the deviations, and of their squares over all channels in the fourth place.
        sums.par_iter_mut().zip(&solution).zip(&whole).for_each(|((sum, solution), whole)| {
            let deviation = [0, 1, 2].map(|c| solution[c] - whole[c]);
            (0..3).for_each(|c| sum[c] += deviation[c]);
            sum[3] += deviation.iter().map(|deviation| deviation * deviation).sum::<f32>();
        });
        progress((round + 1) as f32 / options.rounds as f32);
    }
    let rounds = options.rounds as f32;
    // With the same weights in all rounds their mean is the solution of all samples, and some noise.
    let share = if options.variances == Variances::Draws { 1.0 / rounds } else { 0.0 };
    let mean = Planes::from_fn(width, height, 3, |c, x, y| whole[y * width + x][c] + share * sums[y * width + x][c]);
    // Draws of n out of n with replacement have (n - 1) / n of the variance of the samples.
    let scale = BINS as f32 / (BINS as f32 - 1.0) / (rounds - 1.0);
    let variance = Planes::from_fn(width, height, 1, |_, x, y| {
        let [r, g, b, squares] = sums[y * width + x];
        scale * (squares - (r * r + g * g + b * b) / rounds).max(0.0)
    });
    Ok(Guide { mean, variance, tolerance: None })
}

/// Variances of colours and of differences, sums over the channels.
struct EstimateVariances {
    color: Vec<f32>,
    edges: Vec<f32>,
}

impl EstimateVariances {
    /// Weights by inverse variances.
    fn weights(&self, screen: f32) -> Weights {
        let weigh = |variances: &[f32], weight: f32| variances.par_iter().map(|v| weight / (v + FLOOR)).collect();
        Weights { edges: weigh(&self.edges, 1.0), screen: weigh(&self.color, screen.max(PIN)) }
    }

    /// Means over 3x3 pixels: variances of single pixels are small where outliers happen to be missing, and are
    /// correlated with the values that they are to weigh.
    fn averaged(self, edges: &Edges, (width, height): (usize, usize)) -> Self {
        let color = Planes::from_fn(width, height, 1, |_, x, y| self.color[y * width + x]);
        Self {
            color: color.box_mean(1).to_image(width, height, 1.0).data,
            edges: edge_means::box_mean(edges, (width, height), &self.edges, 1, Missing::Zero),
        }
    }
}

/// Variances of all samples.
fn of_samples(inputs: &Inputs, edges: &Edges) -> Result<EstimateVariances> {
    let sum = |[r, g, b, _]: Quad| (r + g + b) * inputs.scale;
    Ok(EstimateVariances {
        color: inputs.quads(Layer::ColorVariance)?.into_par_iter().map(sum).collect(),
        edges: edges.variance.par_iter().map(|variance| sum(inputs.quad(*variance))).collect(),
    })
}

/// Number of times that each bin is drawn.
type Draw = [u32; BINS];

/// As many bins as there are, drawn with replacement; the same for all pixels, so that errors of neighbours stay
/// correlated as they are.
fn draw(round: u32, which: u64) -> Draw {
    let mut draw = [0; BINS];
    for k in 0..BINS as u64 {
        let u = rng::unit(rng::combine(rng::combine(u64::from(round), which), k));
        draw[((u * BINS as f32) as usize).min(BINS - 1)] += 1;
    }
    draw
}

/// Means of the bins of colours and of differences.
struct Groups<'a> {
    color: Vec<&'a [f32]>,
    /// Means of the ambient light's bins, if it is on.
    ambient_color: Vec<&'a [f32]>,
    samples: &'a [f32],
    edges: &'a Edges,
    scale: f32,
    ambient: f32,
}

/// Means of the drawn bins, and their variances if they are asked for.
struct Drawn {
    color: Vec<Quad>,
    differences: Vec<Quad>,
    variances: EstimateVariances,
}

impl<'a> Groups<'a> {
    fn new(inputs: &Inputs<'a>, edges: &'a Edges, ambient: f32) -> Result<Self> {
        let images = |layer: fn(u8) -> Layer| {
            let image = |k| Ok(inputs.frame.require(layer(k))?.data.as_slice());
            (0..BINS as u8).map(image).collect::<Result<Vec<_>>>()
        };
        Ok(Self {
            color: images(Layer::BinColor)?,
            ambient_color: if ambient > 0.0 { images(Layer::BinAmbient)? } else { Vec::new() },
            samples: &inputs.frame.require(Layer::Samples)?.data,
            edges,
            scale: inputs.scale,
            ambient,
        })
    }

    /// The draws of a round, of colours and of the edges of every step on their own; every bin once without a round.
    fn draw(&self, round: Option<u32>, with_variances: bool) -> Drawn {
        let draw_of = |which: usize| round.map_or([1; BINS], |round| draw(round, which as u64));
        let of_color = draw_of(0);
        let of_kind: Vec<Draw> = (0..self.edges.offsets().len()).map(|kind| draw_of(1 + kind)).collect();
        let pixel = |i: usize| {
            let value = |k: usize, c: usize| self.color[k][3 * i + c];
            let ambient = |k: usize, c: usize| self.ambient_color[k][3 * i + c];
            self.mean(value, ambient, self.samples[i] as u32, &of_color, with_variances)
        };
        let edge = |edge: usize| {
            let value = |k: usize, c: usize| self.edges.bins[edge][k][c];
            let ambient = |k: usize, c: usize| self.edges.ambient[edge][k][c];
            let draw = &of_kind[self.edges.kind(edge)];
            self.mean(value, ambient, self.edges.counts[edge], draw, with_variances)
        };
        let (color, color_variance) = (0..self.samples.len()).into_par_iter().map(pixel).unzip();
        let (differences, edge_variance) = (0..self.edges.len()).into_par_iter().map(edge).unzip();
        Drawn { color, differences, variances: EstimateVariances { color: color_variance, edges: edge_variance } }
    }

    /// Mean of drawn bins of `samples` samples, and its variance, sum over the channels.
    #[inline(always)]
    fn mean(
        &self,
        value: impl Fn(usize, usize) -> f32,
        ambient: impl Fn(usize, usize) -> f32,
        samples: u32,
        draw: &Draw,
        with_variance: bool,
    ) -> (Quad, f32) {
        let counts: Draw = std::array::from_fn(|k| bin_count(samples, k));
        let drawn: Draw = std::array::from_fn(|k| if counts[k] > 0 { draw[k] } else { 0 });
        // With fewer samples than bins a draw may be empty; then all bins are drawn.
        let drawn = if drawn == [0; BINS] { counts.map(|count| count.min(1)) } else { drawn };
        let weights: [f32; BINS] = std::array::from_fn(|k| (drawn[k] * counts[k]) as f32);
        let share = 1.0 / weights.iter().sum::<f32>().max(1.0);
        let (mut mean, mut squares) = ([0.0; 4], 0.0);
        for (c, mean) in mean.iter_mut().take(3).enumerate() {
            let mut values: [f32; BINS] = std::array::from_fn(|k| value(k, c) * self.scale);
            if self.ambient > 0.0 {
                (0..BINS).for_each(|k| values[k] += ambient(k, c) * self.ambient);
            }
            *mean = share * (0..BINS).map(|k| weights[k] * values[k]).sum::<f32>();
            if with_variance {
                squares += (0..BINS).map(|k| weights[k] * (values[k] - *mean).powi(2)).sum::<f32>();
            }
        }
        let groups: u32 = drawn.iter().sum();
        (mean, share * squares / (groups as f32 - 1.0).max(1.0))
    }
}
