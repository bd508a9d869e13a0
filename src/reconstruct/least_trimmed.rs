//! Least trimmed squares (Ha et al. 2019): the differences that fit a denoised image worst are left out, in the share
//! that brings the solution of the others nearest to it. A spanning tree of the best differences always stays, so that no
//! pixel is cut off.

use rayon::prelude::*;

use super::common::inputs::{Inputs, quads};
use super::common::problem::Problem;
use super::{Context, Method, Parameter, Parameters, Reconstruction, Solution, Traits};
use crate::error::Result;
use crate::film::{Edges, Frame, Needs};
use crate::image::nl_means::{self, Guide, Guides, NlmSettings};
use crate::image::planes::{Planes, mirror};
use crate::solve::graph::Quad;
use crate::solve::irls;
use crate::solve::poisson::{Targets, Weights};

/// `least_trimmed`.
pub const METHOD: Method = Method {
    id: "least_trimmed",
    summary: "screened Poisson reconstruction without the differences that least fit a denoised image",
    traits: Traits::POISSON,
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

/// Shares of the differences that are tried, in percent. The spanning tree alone has half of those of a cross.
const SHARES: std::ops::RangeInclusive<usize> = 50..=100;
const SHARE_STEP: usize = 5;

/// Tolerance of the denoising filter in standard deviations, and radius of its patches.
const TOLERANCE: f32 = 0.45;
const PATCH: usize = 3;

/// Residuals of every trial are brought down to this share: it is only compared with the denoised image.
const TRIAL: f64 = 0.05;
const FINAL: f64 = 1e-3;

/// Bytes held for every pixel besides the frame, an upper bound.
const BYTES: u64 = 700;

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
        Needs::EDGES
    }

    fn reconstruct(&self, frame: &Frame, context: &Context) -> Result<Solution> {
        let problem = Problem::new(frame, context, (METHOD.id, BYTES))?;
        let (Problem { inputs, edges, data, .. }, targets) = (&problem, problem.targets());
        (context.progress)("denoise", 0.0);
        let denoised = self.denoise(inputs, edges)?;
        let order = order(targets, &denoised.differences);
        let mut best: Option<(f64, Vec<f32>)> = None;
        let mut solution = data.clone();
        for percent in SHARES.step_by(SHARE_STEP) {
            (context.progress)("trim", 0.3 + 0.6 * (percent - SHARES.start()) as f32 / 50.0);
            let kept = order.kept(percent);
            solution = self.least_squares(targets, &kept, solution, TRIAL);
            let error = distance(&solution, &denoised.color);
            if best.as_ref().is_none_or(|(least, _)| error < *least) {
                best = Some((error, kept));
            }
        }
        let (_, kept) = best.expect("one share is tried");
        (context.progress)("solve", 0.9);
        let solution = if self.l1 {
            irls::solve(targets, &kept, self.alpha, irls::Options::default())
        } else {
            self.least_squares(targets, &kept, solution, FINAL)
        };
        Ok(Solution { image: inputs.image(&solution), alpha: None, error: None, notes: Vec::new() })
    }
}

/// Colour and differences, averaged by the weights of a filter of the colour.
struct Denoised {
    color: Vec<Quad>,
    differences: Vec<Quad>,
}

impl LeastTrimmed {
    fn denoise(&self, inputs: &Inputs, edges: &Edges) -> Result<Denoised> {
        let [color, variance] = inputs.color()?;
        let values = edges
            .offsets()
            .iter()
            .fold(color.clone(), |values, &offset| values.and(&difference_planes(inputs, edges, offset)));
        let color = Guide { mean: color, variance: variance.sum(), tolerance: None };
        let guides = Guides { color, features: Vec::new() };
        let settings = NlmSettings { window: self.window, patch: PATCH, color: TOLERANCE, feature: None };
        let filtered = nl_means::filter(&values, &guides, settings);
        let of_kind: Vec<_> = (0..edges.offsets().len()).map(|kind| quads(&filtered, 3 + 3 * kind)).collect();
        let differences = (0..edges.len()).map(|edge| of_kind[edges.kind(edge)][edges.ends(edge)[0]]);
        Ok(Denoised { color: quads(&filtered, 0), differences: differences.collect() })
    }

    fn least_squares(&self, targets: Targets, kept: &[f32], start: Vec<Quad>, tolerance: f64) -> Vec<Quad> {
        let screen = vec![self.alpha * self.alpha; start.len()];
        let weights = Weights { edges: kept.to_vec(), screen };
        weights.solver(targets.edges).solve(&weights.rhs(targets), start, tolerance).x
    }
}

/// Differences of one step at their lower ends. Where a step leads out of the image it is mirrored, which may lead back
/// over an edge in its other direction; without an edge the difference is zero.
fn difference_planes(inputs: &Inputs, edges: &Edges, (dx, dy): (i32, i32)) -> Planes {
    let (width, height) = (inputs.width, inputs.height);
    let inside = |at: usize, step: i32, length: usize| mirror(at as isize + step as isize, length);
    Planes::from_fn(width, height, 3, |c, x, y| {
        let to = inside(y, dy, height) * width + inside(x, dx, width);
        let half = edges.between(y * width + x, to);
        half.map_or(0.0, |half| half.sign * inputs.quad(edges.mean[half.edge])[c])
    })
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
    edges: Vec<u32>,
    /// Number of edges of the spanning tree.
    tree: usize,
}

impl Order {
    /// 1 for the first `percent` of the edges, and for the tree in any case; 0 for the others.
    fn kept(&self, percent: usize) -> Vec<f32> {
        let mut kept = vec![0.0; self.edges.len()];
        let count = (self.edges.len() * percent).div_ceil(100).max(self.tree);
        self.edges[..count].iter().for_each(|&edge| kept[edge as usize] = 1.0);
        kept
    }
}

/// Orders the edges by their distance from the differences of the denoised image.
fn order(targets: Targets, denoised: &[Quad]) -> Order {
    let misfit = |edge: u32| {
        let (sampled, denoised) = (targets.differences[edge as usize], denoised[edge as usize]);
        (0..3).map(|c| (sampled[c] - denoised[c]).powi(2)).sum::<f32>()
    };
    let mut edges: Vec<_> = (0..targets.edges.len() as u32).into_par_iter().map(|edge| (misfit(edge), edge)).collect();
    edges.par_sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    // Kruskal 1956: an edge that joins two parts of the forest belongs to the tree.
    let pixels = targets.data.len();
    let mut parent: Vec<u32> = (0..pixels as u32).collect();
    let (mut tree, mut rest) = (Vec::with_capacity(pixels), Vec::with_capacity(edges.len()));
    for (_, edge) in edges {
        let [a, b] = targets.edges.ends(edge as usize).map(|end| root(&mut parent, end as u32));
        parent[a as usize] = b;
        if a == b { rest.push(edge) } else { tree.push(edge) }
    }
    let count = tree.len();
    tree.append(&mut rest);
    Order { edges: tree, tree: count }
}

/// The root of a node's tree in the forest; paths are halved on the way.
fn root(parent: &mut [u32], mut node: u32) -> u32 {
    while parent[node as usize] != node {
        parent[node as usize] = parent[parent[node as usize] as usize];
        node = parent[node as usize];
    }
    node
}
