//! Control variates along edges (Rousselle et al. 2016): every pixel is replaced, again and again, by a mean of itself
//! and of its neighbours, each corrected by the sampled difference. Stopping early holds the image near the colour, as
//! the screening does in `l2`.

use rayon::prelude::*;

use super::common::edge_means::{self, Missing};
use super::common::inputs::{Inputs, check_memory};
use super::{Context, Method, Note, Parameter, Parameters, Reconstruction, Solution, Traits};
use crate::error::{Error, Result};
use crate::film::{EdgeParts, Edges, Frame, HalfEdge, Layer, Needs, Recorded, half};
use crate::image::Image;
use crate::image::planes::Planes;
use crate::math::{Rgb, vec3};
use crate::solve::graph::Quad;

/// `control_variate`.
pub const METHOD: Method = Method {
    id: "control_variate",
    summary: "repeated means of each pixel with its neighbours plus the sampled differences",
    traits: Traits { robust: true, ..Traits::POISSON },
    parameters: &[
        Parameter {
            name: "iterations",
            default: "50",
            summary: "how often, 1 to 10000: the more, the farther noise is spread",
        },
        Parameter {
            name: "weights",
            default: "variance",
            summary: "of the mean: `uniform`, unbiased; by inverse `variance`; `given` with the frame's edges, as by `--kernel learned`; or the `product` of both",
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
    /// By weights that come with the edges.
    Given,
    /// By these times the inverse variances of all samples.
    Product,
    /// By the variances of all samples.
    Variance,
    /// Each half by the variances of the other one.
    Cross,
}

/// Bytes held for every pixel besides the frame, upper bounds: without and with the bins of cross-weighting.
const BYTES: u64 = 450;
const BYTES_WITH_BINS: u64 = 800;

fn make(parameters: &Parameters) -> Result<Box<dyn Reconstruction>> {
    let weights = parameters.choice("weights", &["uniform", "variance", "given", "product"])?;
    let weighting = match (weights.as_str(), parameters.switch("cross")?) {
        ("uniform", _) => Weighting::Uniform,
        ("given", _) => Weighting::Given,
        ("product", _) => Weighting::Product,
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
        Needs::EDGES.with_if(Recorded::Bins, self.weighting == Weighting::Cross)
    }

    fn reconstruct(&self, frame: &Frame, context: &Context) -> Result<Solution> {
        let inputs = Inputs::new(frame, 1)?;
        let bytes = if self.weighting == Weighting::Cross { BYTES_WITH_BINS } else { BYTES };
        check_memory(frame, context, METHOD.id, bytes)?;
        let edges = frame.edges(EdgeParts {
            variance: matches!(self.weighting, Weighting::Variance | Weighting::Product),
            bins: self.weighting == Weighting::Cross,
            ..EdgeParts::default()
        })?;
        let parts = self.parts(&inputs, &edges)?;
        let images = parts.iter().map(|(stencil, estimate)| stencil.apply(&edges, estimate, self.iterations));
        let solution = images.reduce(|a, b| a.iter().zip(&b).map(|(a, b)| half_way(*a, *b)).collect());
        let notes = if context.notes { parts[0].0.notes((frame.width, frame.height)) } else { Vec::new() };
        Ok(Solution { image: inputs.image(&solution.unwrap_or_default()), alpha: None, error: None, notes })
    }
}

impl ControlVariate {
    /// Weights, and what they are applied to: all samples, or each half of them.
    fn parts(&self, inputs: &Inputs, edges: &Edges) -> Result<Vec<(Stencil, Estimate)>> {
        Ok(match self.weighting {
            Weighting::Uniform => vec![(Stencil::new(edges, |_, _| 1.0), Estimate::unweighted(inputs, edges)?)],
            Weighting::Given => vec![(Stencil::given(edges)?, Estimate::unweighted(inputs, edges)?)],
            Weighting::Variance => {
                let all = Estimate::of_all(inputs, edges)?;
                vec![(Stencil::by_variance(edges, &all), all)]
            }
            Weighting::Product => {
                let all = Estimate::of_all(inputs, edges)?;
                vec![(Stencil::by_product(edges, &all)?, all)]
            }
            Weighting::Cross => {
                let [a, b] = [Estimate::of_half(inputs, edges, 0)?, Estimate::of_half(inputs, edges, 1)?];
                let [of_a, of_b] = [&b, &a].map(|other| Stencil::by_variance(edges, other));
                vec![(of_a, a), (of_b, b)]
            }
        })
    }
}

fn half_way(a: Quad, b: Quad) -> Quad {
    std::array::from_fn(|c| 0.5 * (a[c] + b[c]))
}

/// Colours and differences, and the variances of both, means over the channels; times the scale of the inputs.
struct Estimate {
    color: Vec<Quad>,
    differences: Vec<Quad>,
    color_variance: Vec<f32>,
    edge_variance: Vec<f32>,
}

/// Radius of the squares that variances are averaged over: a pixel's own variance is correlated with its value, and
/// weights by it would favour values that are too dark.
const SMOOTHING: usize = 2;

impl Estimate {
    /// All samples, without variances.
    fn unweighted(inputs: &Inputs, edges: &Edges) -> Result<Self> {
        let (color, differences) = (inputs.quads(Layer::Color)?, inputs.differences(edges));
        Ok(Self { color, differences, color_variance: Vec::new(), edge_variance: Vec::new() })
    }

    /// All samples.
    fn of_all(inputs: &Inputs, edges: &Edges) -> Result<Self> {
        let [color, variance] = [Layer::Color, Layer::ColorVariance].map(|layer| inputs.frame.require(layer));
        Ok(Self::new(inputs, edges, [color?, variance?], [&edges.mean, &edges.variance]))
    }

    /// Every other bin of the samples.
    fn of_half(inputs: &Inputs, edges: &Edges, first: usize) -> Result<Self> {
        let [color, variance] = inputs.frame.color_half(first)?;
        let (mut means, mut variances) = (Vec::with_capacity(edges.len()), Vec::with_capacity(edges.len()));
        for (bins, &count) in edges.bins.iter().zip(&edges.counts) {
            let of_channel = |c: usize| half(bins.map(|bin| bin[c]), count, first);
            let [r, g, b] = [of_channel(0), of_channel(1), of_channel(2)];
            means.push(vec3(r.0, g.0, b.0));
            variances.push(vec3(r.1, g.1, b.1));
        }
        Ok(Self::new(inputs, edges, [&color, &variance], [&means, &variances]))
    }

    /// From means and variances of colours and of edges, in radiance.
    fn new(inputs: &Inputs, edges: &Edges, [color, variance]: [&Image; 2], of_edges: [&[Rgb]; 2]) -> Self {
        let scale = inputs.scale;
        let (width, height) = (variance.width, variance.height);
        let mean_of = |rgb: &[f32]| rgb.iter().map(|v| v * scale * scale / 3.0).sum::<f32>();
        let of_color = Planes::from_fn(width, height, 1, |_, x, y| mean_of(variance.pixel(x, y)));
        let of_edge: Vec<f32> = of_edges[1].par_iter().map(|variance| mean_of(&variance.to_array())).collect();
        Self {
            color: color.data.par_chunks_exact(3).map(|rgb| inputs.quad(vec3(rgb[0], rgb[1], rgb[2]))).collect(),
            differences: of_edges[0].par_iter().map(|mean| inputs.quad(*mean)).collect(),
            color_variance: of_color.box_mean(SMOOTHING).to_image(width, height, 1.0).data,
            edge_variance: edge_means::box_mean(edges, (width, height), &of_edge, SMOOTHING, Missing::Nearest),
        }
    }
}

impl Estimate {
    /// Inverse variances of a pixel's own value (`None`) and of its corrected neighbours as estimates of the pixel.
    fn precision(&self) -> impl Fn(usize, Option<HalfEdge>) -> f32 + Sync {
        let Self { color_variance, edge_variance, .. } = self;
        let least = 1e-12 + 1e-6 * color_variance.iter().sum::<f32>() / color_variance.len() as f32;
        move |pixel, half| {
            let variance = match half {
                None => color_variance[pixel],
                Some(half) => color_variance[half.to] + edge_variance[half.edge],
            };
            1.0 / (variance + least)
        }
    }
}

/// Fails if edges come without weights.
fn check_weights(edges: &Edges) -> Result<()> {
    if edges.weights.is_empty() && !edges.is_empty() {
        return Err(Error::BadData("the frame's edges come without weights; take `weights=variance`".into()));
    }
    Ok(())
}

/// The weight that comes with an edge at one of its ends, against one of the pixel itself (`None`).
fn given_weight(edges: &Edges, half: Option<HalfEdge>) -> f32 {
    half.map_or(1.0, |half| edges.weights[half.edge][usize::from(half.sign < 0.0)])
}

/// Pixels that a thread takes at a time.
const CHUNK: usize = 8192;

/// A neighbour of a pixel, the edge to it, and its weight.
#[derive(Clone, Copy)]
struct Neighbour {
    to: u32,
    edge: u32,
    weight: f32,
}

/// Every pixel's weights of itself and of its neighbours, which add up to one.
#[derive(Default)]
struct Stencil {
    own: Vec<f32>,
    /// Start of every pixel's entries in `neighbours`, and the end of the last.
    rows: Vec<u32>,
    neighbours: Vec<Neighbour>,
}

impl Stencil {
    /// Normalises the weights of every pixel (`None`) and of its neighbours.
    fn new(edges: &Edges, weight: impl Fn(usize, Option<HalfEdge>) -> f32 + Sync) -> Self {
        let parts: Vec<Self> = (0..edges.pixels().div_ceil(CHUNK))
            .into_par_iter()
            .map(|part| {
                let mut stencil = Self::default();
                for pixel in part * CHUNK..edges.pixels().min((part + 1) * CHUNK) {
                    stencil.push(pixel, edges, &weight);
                }
                stencil
            })
            .collect();
        let mut all = Self { rows: vec![0], ..Self::default() };
        for mut part in parts {
            let before = all.neighbours.len() as u32;
            all.own.append(&mut part.own);
            all.neighbours.append(&mut part.neighbours);
            all.rows.extend(part.rows.iter().map(|end| before + end));
        }
        all
    }

    /// Appends a pixel, and the end of its row.
    fn push(&mut self, pixel: usize, edges: &Edges, weight: &impl Fn(usize, Option<HalfEdge>) -> f32) {
        let start = self.neighbours.len();
        self.neighbours.extend(edges.around(pixel).map(|half| {
            let HalfEdge { to, edge, .. } = half;
            Neighbour { to: to as u32, edge: edge as u32, weight: weight(pixel, Some(half)) }
        }));
        let row = &mut self.neighbours[start..];
        row.sort_by_key(|neighbour| (neighbour.to.abs_diff(pixel as u32), neighbour.to < pixel as u32));
        let of_pixel = weight(pixel, None);
        let total = row.iter().fold(of_pixel, |sum, neighbour| sum + neighbour.weight);
        row.iter_mut().for_each(|neighbour| neighbour.weight /= total);
        self.own.push(of_pixel / total);
        self.rows.push(self.neighbours.len() as u32);
    }

    /// Weights that come with the edges, against one of the pixel itself.
    fn given(edges: &Edges) -> Result<Self> {
        check_weights(edges)?;
        Ok(Self::new(edges, |_, half| given_weight(edges, half)))
    }

    /// Inverse of the variance that the pixel's own value and each corrected neighbour have as estimates of the pixel.
    fn by_variance(edges: &Edges, estimate: &Estimate) -> Self {
        let precision = estimate.precision();
        Self::new(edges, precision)
    }

    /// The product of both.
    fn by_product(edges: &Edges, estimate: &Estimate) -> Result<Self> {
        check_weights(edges)?;
        let precision = estimate.precision();
        Ok(Self::new(edges, |pixel, half| given_weight(edges, half) * precision(pixel, half)))
    }

    /// Pictures of the kernel: every pixel's number of neighbours, and the share of its own value in the mean.
    fn notes(&self, (width, height): (usize, usize)) -> Vec<Note> {
        let degrees = (0..self.own.len()).map(|pixel| self.row(pixel).len() as f32).collect();
        let note = |name: &str, data| Note { name: name.to_owned(), image: Image { width, height, channels: 1, data } };
        vec![note("degree", degrees), note("own_weight", self.own.clone())]
    }

    fn row(&self, pixel: usize) -> &[Neighbour] {
        &self.neighbours[self.rows[pixel] as usize..self.rows[pixel + 1] as usize]
    }

    /// Replaces every pixel by the mean of itself and its corrected neighbours, so many times.
    fn apply(&self, edges: &Edges, estimate: &Estimate, iterations: u32) -> Vec<Quad> {
        debug_assert_eq!(edges.len(), estimate.differences.len());
        // The sum of the differences is the same every time.
        let correction = |pixel: usize| {
            let mut sum: Quad = [0.0; 4];
            for &Neighbour { to, edge, weight } in self.row(pixel) {
                // Differences lead from the lower pixel to the higher one.
                let weight = if to as usize > pixel { -weight } else { weight };
                (0..3).for_each(|c| sum[c] += weight * estimate.differences[edge as usize][c]);
            }
            sum
        };
        let corrections: Vec<Quad> = (0..self.own.len()).into_par_iter().map(correction).collect();
        let mean = |pixel: usize, from: &[Quad]| {
            let mut sum = corrections[pixel];
            (0..3).for_each(|c| sum[c] += self.own[pixel] * from[pixel][c]);
            for neighbour in self.row(pixel) {
                (0..3).for_each(|c| sum[c] += neighbour.weight * from[neighbour.to as usize][c]);
            }
            sum
        };
        let mut image = estimate.color.clone();
        let mut next = image.clone();
        for _ in 0..iterations {
            next.par_iter_mut().enumerate().for_each(|(pixel, slot)| *slot = mean(pixel, &image));
            std::mem::swap(&mut image, &mut next);
        }
        image
    }
}
