//! Adaptive polynomial rendering (after Moon et al. 2016): colours are fitted in square windows by polynomials of the
//! position, whose order adapts to the image, and linearly by features, of which one may be generated from gradients
//! (Back et al. 2018). Every window predicts the blocks around its centre, weighted by its estimated error.
//! The pixel itself stays a candidate, so that the result is consistent.

mod blocks;
mod design;
mod fit;
mod outliers;
mod predict;
mod windows;

use self::blocks::Blocks;
use self::design::ORDER;
use self::predict::{Candidates, LEVERAGE};
use self::windows::Regression;
use super::common::generated::{self, Options};
use super::common::inputs::{FLOOR, Inputs, check_memory, floor_variance};
use super::{Context, EdgeTrust, Method, Parameter, Parameters, Reconstruction, Solution, Traits};
use crate::error::Result;
use crate::film::{Frame, Layer, Needs, Recorded};
use crate::image::nl_means::{self, Guide, Guides, NlmSettings};
use crate::image::planes::Planes;

/// `apr`.
pub const METHOD: Method = Method {
    id: "apr",
    summary: "polynomials of adaptive order and features, also one generated from gradients, fitted in windows; consistent",
    // Rounding may decide whether a monomial is independent of the others in a window.
    traits: Traits { edges: EdgeTrust::ByVariance, exposure_tolerance: 1e-2, ..Traits::FILTER },
    parameters: &[
        Parameter {
            name: "features",
            default: "normal+albedo+depth+generated",
            summary: "what colours are linear in, out of normal, albedo, depth, occlusion, position and generated",
        },
        Parameter { name: "order", default: "0-3", summary: "orders of the polynomials that compete, 0 to 3" },
        Parameter {
            name: "windows",
            default: "12+20+44",
            summary: "sides of the windows that compete, in pixels, 12 to 60; 44 for the published 43",
        },
        Parameter {
            name: "stages",
            default: "2",
            summary: "times that errors are estimated, 1 to 8: at first by the colour, then by the last result",
        },
        Parameter {
            name: "outliers",
            default: "20",
            summary: "median distances from the median beyond which a pixel's energy is spread over those around; or off",
        },
        generated::ROUNDS,
        generated::SCREEN,
        generated::VARIANCES,
        generated::PREFILTER,
        generated::AMBIENT,
    ],
    make,
};

/// Bytes held for every pixel besides the frame, an upper bound.
const BYTES: u64 = 1200;

/// Radius that variances are averaged over: those of single pixels follow the colours they are to weigh.
const SMOOTHING: usize = 3;

/// Constant that is added to variances, in squares of the typical luminance.
const LEAST: f32 = 1e-4;

/// A feature by its name, with the layers that hold it and its variance.
const LAYERS: [(&str, Layer, Layer); 5] = [
    ("normal", Layer::Normal, Layer::NormalVariance),
    ("albedo", Layer::Albedo, Layer::AlbedoVariance),
    ("depth", Layer::Depth, Layer::DepthVariance),
    ("occlusion", Layer::Occlusion, Layer::OcclusionVariance),
    ("position", Layer::Position, Layer::PositionVariance),
];

struct Apr {
    /// Rows of [`LAYERS`].
    layers: Vec<usize>,
    generated: Option<Options>,
    orders: (usize, usize),
    /// Blocks that windows reach to each side.
    radii: Vec<usize>,
    stages: u32,
    outliers: Option<f32>,
}

fn make(parameters: &Parameters) -> Result<Box<dyn Reconstruction>> {
    let known = |name: &str| name == "generated" || LAYERS.iter().any(|(layer, ..)| *layer == name);
    let all = |text: &String| text == "none" || text.split('+').all(known);
    let features: String =
        parameters.get("features", "none, or some of normal+albedo+depth+occlusion+position+generated", all)?;
    let named = |name: &str| features.split('+').any(|feature| feature == name);
    let layers: Vec<usize> = (0..LAYERS.len()).filter(|&k| named(LAYERS[k].0)).collect();
    let options = Options::new(parameters)?;
    // Without features of surfaces the generated one makes do without them, too.
    let options = if layers.is_empty() { options.without_features() } else { options };
    let orders = |text: &String| {
        let (low, high) = text.split_once('-').unwrap_or((text, text));
        let orders = (low.parse::<usize>().ok()?, high.parse::<usize>().ok()?);
        Some(orders).filter(|(low, high)| low <= high && *high <= ORDER)
    };
    let order: String =
        parameters.get("order", "an order or a range of orders from 0 to 3", |text| orders(text).is_some())?;
    let side = |text: &str| text.parse::<usize>().ok().filter(|side| (12..=60).contains(side));
    let sides = |text: &String| text.split('+').map(side).collect::<Option<Vec<_>>>();
    let windows: String =
        parameters.get("windows", "sides from 12 to 60 with + between", |text| sides(text).is_some())?;
    let limit = |text: &String| text.parse::<f32>().ok().filter(|limit| (1.0..=1e6).contains(limit));
    let outliers: String =
        parameters.get("outliers", "off or a number in [1, 1e6]", |text| text == "off" || limit(text).is_some())?;
    Ok(Box::new(Apr {
        layers,
        generated: named("generated").then_some(options),
        orders: orders(&order).unwrap_or((0, ORDER)),
        radii: sides(&windows).unwrap_or_default().iter().map(|side| (side / blocks::SIDE - 1) / 2).collect(),
        stages: parameters.get("stages", "a number from 1 to 8", |n| (1..=8).contains(n))?,
        outliers: limit(&outliers),
    }))
}

impl Reconstruction for Apr {
    fn needs(&self) -> Needs {
        let named = |name| self.layers.iter().any(|&k| LAYERS[k].0 == name);
        let own = Needs::NONE
            .with_if(Recorded::Features, named("normal") || named("albedo") || named("depth"))
            .with_if(Recorded::Occlusion, named("occlusion"))
            .with_if(Recorded::Position, named("position"));
        own.union(self.generated.as_ref().map(Options::needs).unwrap_or_default())
    }

    fn estimates_error(&self) -> bool {
        true
    }

    fn reconstruct(&self, frame: &Frame, context: &Context) -> Result<Solution> {
        let inputs = Inputs::new(frame, 1)?;
        check_memory(frame, context, METHOD.id, BYTES)?;
        let size = (frame.width, frame.height);
        let Features { planes, variance: of_feature } =
            self.features(&inputs, &|share| (context.progress)("features", share))?;
        let features = planes.map_or_else(|| Blocks::from_fn(size, 0, |_, _, _| 0.0), |planes| Blocks::new(&planes));
        let [sampled, variance] = inputs.color()?;
        let color = self.outliers.map_or_else(|| sampled.clone(), |limit| outliers::spread(&sampled, limit));
        let own = variance.sum();
        let smooth = own.box_mean(SMOOTHING);
        let weight = Blocks::from_fn(size, 1, |_, x, y| {
            let inside = x < size.0 && y < size.1;
            if inside { 1.0 / (smooth.at(0, x as isize, y as isize) + LEAST) } else { 0.0 }
        });
        let problem = Regression { features: &features, color: &Blocks::new(&color), weight: &weight };
        (context.progress)("fit", 0.0);
        let fits: Vec<_> = self.radii.iter().map(|&radius| problem.fit(radius)).collect();
        let candidates = Candidates { problem: &problem, fits: &fits, orders: self.orders };
        let mut result = candidates.predict(None);
        for stage in 1..self.stages {
            (context.progress)("predict", stage as f32 / self.stages as f32);
            result = candidates.predict(Some(&result));
        }
        let prediction = result.planes(size, 0, 3);
        let leverage = result.planes(size, LEVERAGE, 1).map(|leverage| leverage.min(1.0));
        Ok(Blend { color: sampled, own, prediction, leverage, of_feature }.solution(&inputs))
    }
}

/// Features that the colour is a linear function of.
#[derive(Default)]
struct Features {
    planes: Option<Planes>,
    /// Variance of the generated one, sum over its channels.
    variance: Option<Planes>,
}

impl Apr {
    /// All features, cleaned, if there are any.
    fn features(&self, inputs: &Inputs, progress: &dyn Fn(f32)) -> Result<Features> {
        let mut features = Features::default();
        if self.generated.is_some() {
            // The error names the differences first, which have a flag of their own.
            inputs.frame.own_edges().map_or_else(|| inputs.frame.require(Layer::Dx).map(|_| ()), |_| Ok(()))?;
        }
        let mut add = |planes: Planes| {
            features.planes = Some(features.planes.take().map_or_else(|| planes.clone(), |all| all.and(&planes)));
        };
        for &(_, mean, variance) in self.layers.iter().map(|&k| &LAYERS[k]) {
            let largest = inputs.frame.require(mean)?.data.iter().fold(1.0, |most: f32, value| most.max(value.abs()));
            let mean = inputs.planes(mean, 1.0 / largest)?;
            let variance = inputs.planes(variance, 1.0 / (largest * largest))?.sum();
            add(nl_means::clean(&Guide { mean, variance, tolerance: None }, 0.5));
        }
        if let Some(options) = &self.generated {
            let [mean, variance] = generated::feature(inputs, options, progress)?;
            add(mean);
            features.variance = Some(variance);
        }
        Ok(features)
    }
}

/// The mean of prediction and sampled colour, each by its error.
struct Blend {
    color: Planes,
    /// Variance of the colour, sum over the channels.
    own: Planes,
    prediction: Planes,
    leverage: Planes,
    of_feature: Option<Planes>,
}

impl Blend {
    fn solution(&self, inputs: &Inputs) -> Solution {
        let (width, height) = (self.color.width, self.color.height);
        let [unbiased, smooth] = self.errors();
        let spread = self.own.zip(&self.leverage, |own, leverage| own * leverage);
        let error = self.of_feature.as_ref().map_or_else(|| unbiased.clone(), |of| generated::error(of, &spread));
        // Share of the sampled colour, and the error of the mean of both.
        let shares = Planes::from_fn(width, height, 2, |c, x, y| {
            let (x, y) = (x as isize, y as isize);
            let (own, leverage) = (smooth.at(0, x, y), self.leverage.at(0, x, y));
            let unbiased = unbiased.at(0, x, y).max(leverage * own);
            // Squares, so that the better one has nearly all the weight.
            let share = if unbiased > 0.0 { unbiased / (unbiased + own * (own / unbiased)) } else { 0.0 };
            let (rest, error) = (1.0 - share, error.at(0, x, y).max(leverage * own));
            [share, rest * rest * error + share * (share + 2.0 * rest * leverage) * own][c]
        });
        let value = |c, x, y| {
            let share = shares.at(0, x, y);
            share * self.color.at(c, x, y) + (1.0 - share) * self.prediction.at(c, x, y)
        };
        let image = Planes::from_fn(width, height, 3, |c, x, y| value(c, x as isize, y as isize));
        Solution {
            image: image.to_image(width, height, 1.0 / inputs.scale),
            alpha: None,
            error: Some(inputs.error(&shares.part(1, 1).map(|error| error / 3.0))),
            notes: Vec::new(),
        }
    }

    /// The prediction's squared error, estimated without bias from its distance to the sampled colour (Stein 1981), and the
    /// colour's variance, both smoothed.
    fn errors(&self) -> [Planes; 2] {
        let square = self.color.zip(&self.prediction, |a, b| (a - b) * (a - b)).sum();
        let known = self.own.zip(&self.leverage, |own, leverage| own * (1.0 - 2.0 * leverage));
        let error = square.zip(&known, |square, known| square - known);
        let color = Guide { mean: self.color.clone(), variance: floor_variance(&self.own, FLOOR), tolerance: None };
        let settings = NlmSettings { window: 8, patch: 3, color: 1.0, feature: None };
        let smooth = nl_means::filter(&error.and(&self.own), &Guides { color, features: Vec::new() }, settings);
        [smooth.part(0, 1), smooth.part(1, 1)]
    }
}
