//! GradNet (Guo et al. 2019): a network in place of the screened Poisson solver. It was trained without clean images, by how well its
//! image fits the sampled colours and differences of other scenes.
//!
//! ```text
//! colours, features ─ encoder ─┐
//!                              ├─ residual blocks ─ decoder ─ image ─ means of the colours ─ result
//! differences ─────── encoder ─┘
//! ```
//!
//! Radiance goes in and comes out compressed by `T(x) = sign(x) log(1 + 16 |x|) / log 17`. The compression biases the image; at
//! the end its means over windows of 91 pixels become those of the sampled colours.

mod means;
mod network;

use self::means::with_means;
use self::network::{MULTIPLE, Network};
use super::inputs::{Inputs, check_memory};
use super::residual::{estimated_error, mean, noise};
use super::{Context, EdgeTrust, Method, Note, Parameter, Parameters, Reconstruction, Solution, Traits};
use crate::error::{Error, Result};
use crate::film::{Frame, Layer, Needs};
use crate::image::planes::Planes;
use crate::nn::Tensor;

/// `gradnet`.
pub const METHOD: Method = Method {
    id: "gradnet",
    summary: "a network that solves for colours and differences with features, trained without clean images",
    traits: Traits { exact: false, edges: EdgeTrust::ByVariance, ..Traits::FILTER },
    parameters: &[Parameter {
        name: "means",
        default: "on",
        summary: "whether means over large windows become those of the sampled colours, `on` or `off`",
    }],
    make,
};

/// Bytes held for every pixel besides the frame, and while the network works on a band: an upper bound.
const BYTES: u64 = 600;

/// Compression of radiance.
const MU: f32 = 16.0;

/// Largest compressed value that is decompressed.
const MOST: f32 = 4.0;

/// Share of the depths that is below the one that counts as 1.
const FAR: f64 = 0.99;

/// Channels that the encoders of data and gradients take.
const CHANNELS: [usize; 2] = [12, 8];

struct GradNet {
    network: Network,
    means: bool,
}

fn make(parameters: &Parameters) -> Result<Box<dyn Reconstruction>> {
    let network = Network::new(include_bytes!("own.safetensors"), CHANNELS);
    let network = network.map_err(|why| Error::backend(METHOD.id, why))?;
    Ok(Box::new(GradNet { network, means: parameters.switch("means")? }))
}

impl Reconstruction for GradNet {
    fn needs(&self) -> Needs {
        Needs { features: true, ..Needs::EDGES }
    }

    fn estimates_error(&self) -> bool {
        true
    }

    fn reconstruct(&self, frame: &Frame, context: &Context) -> Result<Solution> {
        check_memory(frame, context, METHOD.id, BYTES)?;
        let inputs = Inputs::new(frame, MULTIPLE)?;
        let [color, variance] = inputs.color()?;
        (context.progress)("network", 0.1);
        let output = self.network.apply(&given(&inputs, &color, &variance)?);
        let image =
            Planes::from_fn(inputs.width, inputs.height, 3, |c, x, y| decompress(output.pixel(x, y)[c]).max(0.0));
        (context.progress)("means", 0.8);
        let mut notes = Vec::new();
        if context.notes {
            let image = image.to_image(frame.width, frame.height, 1.0 / inputs.scale);
            notes.push(Note { name: "uncorrected".into(), image });
        }
        let image = if self.means { with_means(&image, &color) } else { image };
        let error = Some(inputs.error(&estimated_error(&color, &noise(&variance), &image)));
        let image = image.to_image(frame.width, frame.height, 1.0 / inputs.scale);
        Ok(Solution { image, alpha: None, error, notes })
    }
}

/// Inputs of both encoders, one after the other; tools/train/gradnet.py computes the same for training.
fn given(inputs: &Inputs, color: &Planes, variance: &Planes) -> Result<Tensor> {
    let albedo = inputs.planes(Layer::Albedo, 1.0)?;
    let normal = inputs.planes(Layer::Normal, 1.0)?;
    let depth = inputs.planes(Layer::Depth, 1.0)?;
    let far = far(&inputs.frame.require(Layer::Depth)?.data);
    let [[dx, of_dx], [dy, of_dy]] = [inputs.gradient(0)?, inputs.gradient(1)?];
    let deviation = |variance: &Planes| mean(&variance.map(f32::sqrt));
    let deviations = [variance, &of_dx, &of_dy].map(deviation);
    let samples = libm::log2f(inputs.spp) / 4.0;
    Ok(Tensor::from_fn(inputs.width, inputs.height, CHANNELS.iter().sum(), |x, y, pixel| {
        let (x, y) = (x as isize, y as isize);
        let mut rest = pixel.iter_mut();
        let mut put = |value: f32| *rest.next().expect("as many as are counted") = value;
        (0..3).for_each(|c| put(compress(color.at(c, x, y))));
        (0..3).for_each(|c| put(albedo.at(c, x, y)));
        (0..3).for_each(|c| put(0.5 * (normal.at(c, x, y) + 1.0)));
        put((depth.at(0, x, y).max(0.0) / far).min(1.0));
        put(compress(deviations[0].at(0, x, y)));
        put(samples);
        (0..3).for_each(|c| put(compress(dx.at(c, x, y))));
        (0..3).for_each(|c| put(compress(dy.at(c, x, y))));
        put(compress(deviations[1].at(0, x, y)));
        put(compress(deviations[2].at(0, x, y)));
    }))
}

/// The depth that counts as 1: a quantile, between the values that are nearest to it.
fn far(depths: &[f32]) -> f32 {
    let mut sorted: Vec<f32> = depths.iter().map(|depth| depth.max(0.0)).collect();
    sorted.sort_by(f32::total_cmp);
    let at = FAR * (sorted.len() - 1) as f64;
    let (below, above) = (sorted[at.floor() as usize], sorted[at.ceil() as usize]);
    (below + (above - below) * at.fract() as f32).max(1e-9)
}

fn compress(value: f32) -> f32 {
    (libm::log1pf(MU * value.abs()) / libm::logf(1.0 + MU)).copysign(value)
}

fn decompress(value: f32) -> f32 {
    (libm::expm1f(value.abs().min(MOST) * libm::logf(1.0 + MU)) / MU).copysign(value)
}
