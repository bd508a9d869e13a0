//! NFOR, nonlinearly weighted first-order regression (Bitterli et al. 2016): colours are fitted by features in windows
//! whose pixels count by how alike they are. Two halves of the samples, each weighted by the other, estimate the error of
//! two strengths of filtering; each pixel takes the better one, and a second pass removes the noise that is left.
//!
//! The method needs no gradients: plain path tracing.

mod regression;

use self::regression::regress;
use super::common::inputs::{FLOOR, Inputs, check_memory, floor_variance};
use super::{Context, Method, Parameter, Parameters, Reconstruction, Solution, Traits};
use crate::error::Result;
use crate::film::{Frame, Layer, Needs, Recorded};
use crate::image::nl_means::{self, Guide, Guides, NlmSettings};
use crate::image::planes::Planes;

/// `nfor`.
pub const METHOD: Method = Method {
    id: "nfor",
    summary: "colours fitted by features in windows (first-order regression); path tracing only, consistent",
    traits: Traits { robust: false, ..Traits::FILTER },
    parameters: &[Parameter {
        name: "k",
        default: "0.5",
        summary: "differences that the stronger candidate tolerates, in standard deviations; 1 in the authors' program",
    }],
    make,
};

/// Bytes held for every pixel besides the frame, an upper bound.
const BYTES: u64 = 700;

fn make(parameters: &Parameters) -> Result<Box<dyn Reconstruction>> {
    let k = parameters.get("k", "a number in [0.01, 100]", |k| (0.01..=100.0).contains(k))?;
    Ok(Box::new(Nfor { k }))
}

struct Nfor {
    k: f32,
}

impl Reconstruction for Nfor {
    fn needs(&self) -> Needs {
        Needs::NONE.with(Recorded::Features).with(Recorded::Bins)
    }

    fn estimates_error(&self) -> bool {
        true
    }

    fn reconstruct(&self, frame: &Frame, context: &Context) -> Result<Solution> {
        let inputs = Inputs::new(frame, 1)?;
        check_memory(frame, context, METHOD.id, BYTES)?;
        (context.progress)("features", 0.0);
        let [color, variance] = inputs.color()?;
        let own = variance.sum();
        let variance = floor_variance(&own, FLOOR);
        let features = features(&inputs)?;
        let halves = [inputs.half(0)?, inputs.half(1)?];
        // Half the samples have twice the variance.
        let of_half = variance.map(|variance| 2.0 * variance);
        let guides =
            [0, 1].map(|k: usize| Guide { mean: halves[k].clone(), variance: of_half.clone(), tolerance: None });
        let guide = Guides { color: Guide { mean: color, variance, tolerance: None }, features: Vec::new() };
        let tolerances = [0.5 * self.k, self.k];
        let candidates = [0, 1].map(|t: usize| {
            (context.progress)("regress", 0.05 + 0.35 * t as f32);
            [0, 1].map(|k: usize| regress(&halves[k], &features, &guides[1 - k], tolerances[t]))
        });
        (context.progress)("choose", 0.75);
        let smooth = |planes: &Planes| {
            nl_means::filter(
                planes,
                &guide,
                NlmSettings { window: regression::WINDOW, patch: 1, color: 1.0, feature: None },
            )
        };
        let errors = [0, 1].map(|t: usize| smooth(&error(&halves, &candidates[t], &own)));
        let share = smooth(&errors[0].zip(&errors[1], |a, b| f32::from(u8::from(a < b))));
        let blend = |a: &Planes, b: &Planes| {
            Planes::from_fn(a.width, a.height, a.channels(), |c, x, y| {
                let (x, y) = (x as isize, y as isize);
                let share = share.at(0, x, y);
                share * a.at(c, x, y) + (1.0 - share) * b.at(c, x, y)
            })
        };
        let [a, b] = [0, 1].map(|k: usize| blend(&candidates[0][k], &candidates[1][k]));
        let error = blend(&errors[0], &errors[1]);
        (context.progress)("again", 0.8);
        let mean = a.zip(&b, |a, b| 0.5 * (a + b));
        // The variance of the mean of both, and twice that, as for halves.
        let left = a.zip(&b, |a, b| 2.0 * 0.25 * (a - b) * (a - b)).sum();
        let guide = Guide { mean: mean.clone(), variance: left, tolerance: None };
        let image =
            regress(&mean, &features, &guide, tolerances[1]).to_image(frame.width, frame.height, 1.0 / inputs.scale);
        Ok(Solution {
            image,
            alpha: None,
            error: Some(inputs.error(&error.map(|error| error / 3.0))),
            notes: Vec::new(),
        })
    }
}

/// Estimated squared error of the mean of two filtered halves, sum over the channels: how far each is from the half it
/// has not seen, less that half's own variance, which is twice that of all samples, less what their mean gains.
fn error(halves: &[Planes; 2], filtered: &[Planes; 2], variance: &Planes) -> Planes {
    let square = |a: &Planes, b: &Planes| a.zip(b, |a, b| (a - b) * (a - b)).sum();
    let sum = square(&halves[1], &filtered[0]).zip(&square(&halves[0], &filtered[1]), |a, b| 0.5 * (a + b));
    let gain = square(&filtered[0], &filtered[1]);
    sum.zip(&gain, |sum, gain| sum - 0.25 * gain).zip(variance, |error, variance| error - 2.0 * variance)
}

/// Albedo, normal and depth, each filtered by itself, the depth in units of the largest. Frames of other programs may have
/// no depth, which is then the same everywhere.
fn features(inputs: &Inputs) -> Result<Planes> {
    let depth = inputs.frame.get(Layer::Depth);
    let furthest = depth.map_or(0.0, |depth| depth.data.iter().copied().fold(1e-30, f32::max));
    let layers = [
        (Layer::Albedo, Layer::AlbedoVariance, 1.0),
        (Layer::Normal, Layer::NormalVariance, 1.0),
        (Layer::Depth, Layer::DepthVariance, 1.0 / furthest),
    ];
    let mut all: Option<Planes> = None;
    for (mean, variance, scale) in layers.into_iter().take(if depth.is_some() { 3 } else { 2 }) {
        let (mean, variance) = (inputs.planes(mean, scale)?, inputs.planes(variance, scale * scale)?.sum());
        let clean = nl_means::clean(&Guide { mean, variance, tolerance: None }, 0.5);
        all = Some(all.map_or_else(|| clean.clone(), |all| all.and(&clean)));
    }
    let all = all.expect("there are two");
    Ok(if depth.is_some() { all } else { all.and(&Planes::from_fn(inputs.width, inputs.height, 1, |_, _, _| 0.0)) })
}
