//! Gradient enhancement: the image whose differences are nearest to the sampled ones, by weights on every edge,
//! without straying from the denoised image. Differences of an image are consistent: they add up to the same along
//! every way.

use rayon::prelude::*;

use super::form::Form;
use super::level::Level;
use crate::film::Edges;
use crate::image::planes::Planes;
use crate::math::rng;
use crate::reconstruct::common::inputs::quads;
use crate::solve::graph::Quad;
use crate::solve::poisson::{Targets, Weights};

/// Pull towards the denoised image in the authors' form. Their gradient descent starts there and stops after a
/// thousand small steps; a penalty of this weight acts alike on every frequency (docs/design/frgr.md).
const CODE_SCREEN: f32 = 100.0;

/// In the printed form only the differences matter; without any pull the equations would have no single solution.
const PAPER_SCREEN: f32 = 1e-3;

/// Least share of its variance that a denoised pixel is believed to have as error: the estimate is noisy, and misses
/// a bias that is small beside the noise. What gradients alone would reach falls below that as samples are added, and
/// so does the trust in the denoised image.
fn least_error(spp: f32) -> f32 {
    (spp.sqrt() / 80.0).min(1.0)
}

/// Variance that differences and denoised colours have at least, in squares of the typical luminance.
const LEAST_VARIANCE: f32 = 1e-6;

/// Residuals are brought down to this share. What is left is well below the noise of the data.
const TOLERANCE: f64 = 0.04;

/// An enhanced image and its estimated error.
pub struct Enhanced {
    /// Its differences are the enhanced gradients.
    pub image: Planes,
    /// Estimated squared error, mean over the channels, if weights are by noise.
    pub error: Option<Planes>,
}

/// Weights of an edge: of the sampled difference, and of a difference of zero.
struct Weight {
    sampled: f32,
    flat: f32,
}

impl Weight {
    fn sum(&self) -> f32 {
        self.sampled + self.flat
    }
}

/// Enhances the gradients of a level. `error` is the estimated squared error of the denoised image.
pub fn enhance(level: &Level, denoised: &Planes, error: &Planes, form: Form, spp: f32) -> Enhanced {
    let (width, height) = (denoised.width, denoised.height);
    let pixels = || (0..width * height).into_par_iter().map(|i| ((i % width) as isize, (i / width) as isize));
    let edges = Edges::cross((width, height));
    let of_edge = |edge: usize| {
        let lower = edges.ends(edge)[0];
        weight(level, form, spp, edges.kind(edge), ((lower % width) as isize, (lower / width) as isize))
    };
    let of_edges: Vec<Weight> = (0..edges.len()).into_par_iter().map(of_edge).collect();
    let screen: Vec<f32> = pixels().map(|at| screen(level, error, form, spp, at)).collect();
    let data = quads(denoised, 0);
    let gradients = [quads(&level.gradients[0], 0), quads(&level.gradients[1], 0)];
    // A sampled difference and one of zero together pull like their mean.
    let pull = |(edge, weight): (usize, &Weight)| {
        let share = weight.sampled / weight.sum();
        gradients[edges.kind(edge)][edges.ends(edge)[0]].map(|value| share * value)
    };
    let differences: Vec<Quad> = of_edges.par_iter().enumerate().map(pull).collect();
    let weights = Weights { edges: of_edges.par_iter().map(Weight::sum).collect(), screen };
    let mut rhs = weights.rhs(Targets { edges: &edges, data: &data, differences: &differences });
    // The fourth channel is random signs, for the error.
    rhs.iter_mut().enumerate().for_each(|(i, rhs)| rhs[3] = sign(i));
    let solved = weights.solver(&edges).solve(&rhs, data, TOLERANCE).x;
    let image = Planes::from_fn(width, height, 3, |c, x, y| solved[y * width + x][c]);
    let error = (form == Form::Best).then(|| {
        // The inverse of the matrix is the covariance of the errors when all weights are inverse variances. The
        // expectation of z times (inverse z) over random signs z is its diagonal; the mean over some pixels stands for
        // it. Gradients only add to what is known: the error is no larger than the denoised image's.
        let most = Planes::from_fn(width, height, 1, |_, x, y| 1.0 / weights.screen[y * width + x]);
        let sample = Planes::from_fn(width, height, 1, |_, x, y| sign(y * width + x) * solved[y * width + x][3]);
        let clipped = |sample: &Planes| sample.zip(&most, |value, most| value.clamp(0.0, most));
        clipped(&clipped(&sample).box_mean(2))
    });
    Enhanced { image, error }
}

/// Plus or minus one, at random by position.
fn sign(i: usize) -> f32 {
    if rng::mix(i as u64 + 1) & 1 == 0 { 1.0 } else { -1.0 }
}

fn weight(level: &Level, form: Form, spp: f32, axis: usize, (x, y): (isize, isize)) -> Weight {
    if form == Form::Best {
        return Weight { sampled: 1.0 / (level.noise[axis].at(0, x, y) + LEAST_VARIANCE), flat: 0.0 };
    }
    // Yan et al. 2024, eqs. 10 to 14; with the sum over RGB for the size of a difference, so that channels share
    // their weights.
    let (nx, ny) = if axis == 0 { (x + 1, y) } else { (x, y + 1) };
    let sum =
        |planes: &Planes, value: &dyn Fn(usize) -> f32| (0..planes.channels()).map(|c| value(c).abs()).sum::<f32>();
    let gradient = &level.gradients[axis];
    let size = sum(gradient, &|c| gradient.at(c, x, y));
    let features = level.features.iter().map(|feature| {
        let mean = &feature.mean;
        sum(mean, &|c| mean.at(c, nx, ny) - mean.at(c, x, y))
    });
    let flat = 1.0 / (features.sum::<f32>() + 0.01);
    let lambda = 8.0 / spp.sqrt();
    if form == Form::Paper {
        Weight { sampled: size / 0.09 + 1.0 / (size + 0.01), flat: lambda * flat }
    } else {
        let sampled = (size + 0.01) / 0.09 + 1.0 / (size + 0.01);
        Weight { sampled: sampled * sampled, flat: lambda * flat * flat }
    }
}

fn screen(level: &Level, error: &Planes, form: Form, spp: f32, (x, y): (isize, isize)) -> f32 {
    match form {
        Form::Paper => PAPER_SCREEN,
        Form::Code => CODE_SCREEN,
        Form::Best => {
            let variance = (0..3).map(|c| level.variance.at(c, x, y)).sum::<f32>() / 3.0;
            1.0 / (error.at(0, x, y).max(least_error(spp) * variance) + LEAST_VARIANCE)
        }
    }
}
