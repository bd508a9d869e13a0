//! Least trimmed squares (Ha et al. 2019): differences that do not fit those of a denoised image are left out, as many
//! of them as makes the solution of the others nearest to it. A spanning tree of the best differences always stays, so
//! that no pixel is cut off.

use rayon::prelude::*;

use super::inputs::{Inputs, check_memory, quads};
use super::{Context, Method, Parameter, Parameters, Reconstruction, Solution};
use crate::error::Result;
use crate::film::{Frame, Layer, Needs};
use crate::image::nl_means::{self, Guide, Guides, Settings};
use crate::solve::graph::Quad;
use crate::solve::irls;
use crate::solve::poisson::{Data, Weights};

/// `least_trimmed`.
pub const METHOD: Method = Method {
    id: "least_trimmed",
    summary: "screened Poisson reconstruction without the differences that least fit a denoised image",
    parameters: &[
        Parameter { name: "alpha", default: "0.2", summary: "weight of the colour against the differences, > 0" },
        Parameter {
            name: "norm",
            default: "l1",
            summary: "of the last solution, with the differences that are left: `l1` or `l2`",
        },
        Parameter { name: "window", default: "9", summary: "radius of the denoising filter's window, 1 to 12 pixels" },
    ],
    make,
};

/// Shares of the differences that are tried, in percent: as far as from the spanning tree, which has half of them.
const SHARES: std::ops::RangeInclusive<usize> = 50..=100;
const SHARE_STEP: usize = 5;

/// Tolerance of the denoising filter in standard deviations, and radius of its patches.
const TOLERANCE: f32 = 0.45;
const PATCH: usize = 3;

/// Residuals of every trial are brought down to this share: it is only compared with the denoised image.
const TRIAL: f64 = 0.05;
const FINAL: f64 = 1e-3;

/// Bytes held for every pixel besides the frame, an upper bound.
const BYTES: u64 = 450;

fn make(parameters: &Parameters) -> Result<Box<dyn Reconstruction>> {
    let l1 = parameters.choice("norm", &["l1", "l2"])? == "l1";
    Ok(Box::new(LeastTrimmed {
        alpha: parameters.get("alpha", "a number in [1e-3, 1e3]", |alpha| (1e-3..=1e3).contains(alpha))?,
        l1,
        window: parameters.get("window", "a number from 1 to 12", |window| (1..=12).contains(window))?,
    }))
}

struct LeastTrimmed {
    alpha: f32,
    l1: bool,
    window: usize,
}

impl Reconstruction for LeastTrimmed {
    fn needs(&self) -> Needs {
        Needs { edges: true, ..Needs::default() }
    }

    fn reconstruct(&self, frame: &Frame, context: &Context) -> Result<Solution> {
        let inputs = Inputs::new(frame, 1)?;
        check_memory(frame, context, METHOD.id, BYTES)?;
        let (data, dx, dy) = (inputs.quads(Layer::Color)?, inputs.quads(Layer::Dx)?, inputs.quads(Layer::Dy)?);
        let data = Data { width: frame.width, data: &data, edges: [&dx, &dy] };
        (context.progress)("denoise", 0.0);
        let [denoised, dx, dy] = self.denoise(&inputs)?;
        let order = order(data, [&dx, &dy]);
        let mut best: Option<(f64, [Vec<f32>; 2])> = None;
        let mut solution = data.data.to_vec();
        for percent in SHARES.step_by(SHARE_STEP) {
            (context.progress)("trim", 0.3 + 0.6 * (percent - SHARES.start()) as f32 / 50.0);
            let kept = order.kept(percent);
            solution = self.least_squares(data, &kept, solution, TRIAL);
            let error = distance(&solution, &denoised);
            if best.as_ref().is_none_or(|(least, _)| error < *least) {
                best = Some((error, kept));
            }
        }
        let (_, kept) = best.expect("one share is tried");
        (context.progress)("solve", 0.9);
        let solution = if self.l1 {
            irls::solve(data, [&kept[0], &kept[1]], self.alpha, irls::Options::default())
        } else {
            self.least_squares(data, &kept, solution, FINAL)
        };
        Ok(Solution { image: inputs.image(&solution), error: None, notes: Vec::new() })
    }
}

impl LeastTrimmed {
    /// Colour and differences, all averaged by the weights of a filter of the colour.
    fn denoise(&self, inputs: &Inputs) -> Result<[Vec<Quad>; 3]> {
        let [color, variance] = inputs.color()?;
        let ([dx, _], [dy, _]) = (inputs.gradient(0)?, inputs.gradient(1)?);
        let values = color.and(&dx).and(&dy);
        let color = Guide { mean: color, variance: variance.sum(), tolerance: None };
        let guides = Guides { color, features: Vec::new() };
        let settings = Settings { window: self.window, patch: PATCH, color: TOLERANCE, feature: None };
        let filtered = nl_means::filter(&values, &guides, settings);
        Ok([0, 3, 6].map(|first| quads(&filtered, first)))
    }

    fn least_squares(&self, data: Data, [across, down]: &[Vec<f32>; 2], start: Vec<Quad>, tolerance: f64) -> Vec<Quad> {
        let screen = vec![self.alpha * self.alpha; start.len()];
        let weights = Weights { across: across.clone(), down: down.clone(), screen };
        weights.solver(data.width).solve(&weights.right(data), start, tolerance).x
    }
}

/// Squared distance as relMSE has it, with the denoised image as reference.
fn distance(image: &[Quad], denoised: &[Quad]) -> f64 {
    let pixel = |(a, b): (&Quad, &Quad)| {
        let square: f32 = (0..3).map(|c| (a[c] - b[c]).powi(2)).sum();
        let luminance = (b[0] + b[1] + b[2]) / 3.0;
        f64::from(square / (luminance * luminance + 0.01))
    };
    image.iter().zip(denoised).map(pixel).sum()
}

/// Edges, those of the spanning tree first, the others by how well they fit.
struct Order {
    pixels: usize,
    /// Twice the pixel, and one more for the edge downwards.
    edges: Vec<u32>,
    tree: usize,
}

impl Order {
    /// 1 for the first `percent` of the edges, and for the tree in any case; 0 for the others.
    fn kept(&self, percent: usize) -> [Vec<f32>; 2] {
        let mut kept = [vec![0.0; self.pixels], vec![0.0; self.pixels]];
        let count = (self.edges.len() * percent).div_ceil(100).max(self.tree);
        for edge in &self.edges[..count] {
            kept[(edge % 2) as usize][(edge / 2) as usize] = 1.0;
        }
        kept
    }
}

/// Orders the edges by how far they are from the differences of the denoised image.
fn order(data: Data, smooth: [&[Quad]; 2]) -> Order {
    let (width, pixels) = (data.width, data.data.len());
    let there = |edge: u32| {
        let i = edge as usize / 2;
        if edge.is_multiple_of(2) { !(i + 1).is_multiple_of(width) } else { i + width < pixels }
    };
    let misfit = |edge: u32| {
        let (axis, i) = (edge as usize % 2, edge as usize / 2);
        (0..3).map(|c| (data.edges[axis][i][c] - smooth[axis][i][c]).powi(2)).sum::<f32>()
    };
    let mut edges: Vec<_> =
        (0..2 * pixels as u32).into_par_iter().filter(|&edge| there(edge)).map(|edge| (misfit(edge), edge)).collect();
    edges.par_sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    // Kruskal 1956: an edge that joins two parts of the forest belongs to the tree.
    let mut parent: Vec<u32> = (0..pixels as u32).collect();
    let (mut tree, mut rest) = (Vec::with_capacity(pixels), Vec::with_capacity(edges.len()));
    for (_, edge) in edges {
        let near = edge / 2;
        let far = if edge.is_multiple_of(2) { near + 1 } else { near + width as u32 };
        let (a, b) = (root(&mut parent, near), root(&mut parent, far));
        parent[a as usize] = b;
        if a == b { rest.push(edge) } else { tree.push(edge) }
    }
    let count = tree.len();
    tree.append(&mut rest);
    Order { pixels, edges: tree, tree: count }
}

/// The node that stands for a node's part of the forest; ways there are halved as they are gone.
fn root(parent: &mut [u32], mut node: u32) -> u32 {
    while parent[node as usize] != node {
        parent[node as usize] = parent[parent[node as usize] as usize];
        node = parent[node as usize];
    }
    node
}
