//! GradNet (Guo et al. 2019): a network in place of the screened Poisson solver. It was trained without clean images, against other
//! samples of the same scenes.
//!
//! ```text
//! colours, features, l1 ─ encoder ─┐
//!                                  ├─ residual blocks ─ decoder ─ image, share of l1 ─ means of the colours ─ result
//! differences ─────────── encoder ─┘
//! ```
//!
//! Radiance goes in and comes out compressed. The compression biases the image; at the end its means over windows of 91 pixels
//! become those of the sampled colours. Where that differs from them by more than noise, and with more samples than the network was
//! trained for, the result goes back to `l1`. The published network has neither the image of `l1` nor a share of it.

mod means;

use std::path::Path;
use std::sync::{Arc, OnceLock};

use self::means::with_means;
use super::common::compressed::{DIFFERENCES, FEATURES, NOISELESS_DIFFERENCES, decompress, given};
use super::common::inputs::{Inputs, TRAINED_SAMPLES, check_memory};
use super::common::residual::{estimated_error, noise, pulled_to, squared_error, windowed};
use super::l1::L1;
use super::{Context, EdgeTrust, Method, Note, Parameter, Parameters, Reconstruction, Solution, Traits};
use crate::error::{Error, Result, SourceLoc};
use crate::film::{Frame, Needs, Recorded};
use crate::image::planes::Planes;
use crate::nn::{GradNet, Weights};

/// `gradnet`.
pub const METHOD: Method = Method {
    id: "gradnet",
    summary: "a network that solves for colours and differences with features, trained without clean images",
    traits: Traits { exact: false, edges: EdgeTrust::ByVariance, ..Traits::FILTER },
    parameters: &[
        Parameter {
            name: "means",
            default: "on",
            summary: "whether means over large windows become those of the sampled colours, `on` or `off`",
        },
        Parameter {
            name: "weights",
            default: "own",
            summary: "`own`, or a safetensors file of tools/train/gradnet.py, for either of its presets",
        },
    ],
    make,
};

/// Weights of the preset `own`.
const WEIGHTS: &[u8] = include_bytes!("own.safetensors");

/// Bytes held for every pixel besides the frame, and while the network works on a band: an upper bound.
const BYTES: u64 = 700;

/// Channels that the encoders of data and gradients take and what comes out: as printed, and with noise, number of samples and `l1`.
const PRINTED: ([usize; 2], usize) = ([3 + FEATURES, NOISELESS_DIFFERENCES], 3);
const OWN: ([usize; 2], usize) = ([3 + FEATURES + 2 + 3, DIFFERENCES], 4);

struct Solver {
    network: Arc<GradNet>,
    /// The solver whose image the network is given, and mixes with its own.
    l1: Option<L1>,
    means: bool,
}

fn make(parameters: &Parameters) -> Result<Box<dyn Reconstruction>> {
    let file = parameters.get("weights", "`own` or a file", |text: &String| !text.is_empty())?;
    let path = Path::new(&file);
    let read = |bytes: &[u8]| Weights::parse(bytes).and_then(|weights| GradNet::new(&weights)).map(Arc::new);
    let network = match file.as_str() {
        "own" => {
            static NETWORK: OnceLock<Result<Arc<GradNet>, String>> = OnceLock::new();
            NETWORK.get_or_init(|| read(WEIGHTS)).clone()
        }
        _ => read(&std::fs::read(path).map_err(|error| Error::io(path, error))?),
    };
    let network = network.map_err(|why| SourceLoc::file(path).invalid(why))?;
    let l1 = match (network.inputs(), network.outputs()) {
        PRINTED => None,
        OWN => Some(L1::default()),
        shape => {
            let what = format!("has a network of {shape:?} channels instead of {PRINTED:?} or {OWN:?}");
            return Err(SourceLoc::file(path).invalid(what));
        }
    };
    Ok(Box::new(Solver { network, l1, means: parameters.switch("means")? }))
}

impl Reconstruction for Solver {
    fn needs(&self) -> Needs {
        Needs::EDGES.with(Recorded::Features)
    }

    fn estimates_error(&self) -> bool {
        true
    }

    fn needs_cross(&self) -> bool {
        true
    }

    fn reconstruct(&self, frame: &Frame, context: &Context) -> Result<Solution> {
        check_memory(frame, context, METHOD.id, BYTES)?;
        let inputs = Inputs::new(frame, GradNet::MULTIPLE)?;
        let [color, variance] = inputs.color()?;
        let report = |what: &str, done: f32| (context.progress)(what, 0.2 * done);
        let solve = |l1: &L1| l1.reconstruct(frame, &Context { progress: &report, ..*context });
        let solved = self.l1.as_ref().map(solve).transpose()?;
        let l1 = solved.map(|solved| inputs.mirrored(&solved.image, inputs.scale));
        (context.progress)("network", 0.2);
        let more: Vec<_> = l1.iter().collect();
        let output = self.network.apply(&given(&inputs, &[&color], &more, l1.as_ref().map(|_| &variance))?);
        let image = Planes::from_fn(inputs.width, inputs.height, 3, |c, x, y| {
            let pixel = output.pixel(x, y);
            let own = decompress(pixel[c]);
            let solved = l1.as_ref().map_or(own, |l1| l1.at(c, x as isize, y as isize));
            let share = pixel.get(3).map_or(0.0, |score| 1.0 / (1.0 + libm::expf(-score)));
            (own + share * (solved - own)).max(0.0)
        });
        (context.progress)("means", 0.8);
        let mut notes = Vec::new();
        if context.notes {
            let image = image.to_image(frame.width, frame.height, 1.0 / inputs.scale);
            notes.push(Note { name: "uncorrected".into(), image });
        }
        let image = if self.means { with_means(&image, &color) } else { image };
        let noise = noise(&variance);
        let around = windowed(&noise);
        let image = match &l1 {
            Some(l1) => {
                let share = (TRAINED_SAMPLES / inputs.spp).min(1.0);
                pulled_to(&image, l1, (&color, &noise), inputs.spp, share)
            }
            None => image,
        };
        let error = Some(inputs.error(&estimated_error(&squared_error(&color, &noise, &image), &around)));
        let image = image.to_image(frame.width, frame.height, 1.0 / inputs.scale);
        Ok(Solution { image, alpha: None, error, notes })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::nn::Tensor;

    #[test]
    fn outputs_of_the_shipped_weights_are_those_of_pytorch() {
        let vectors = Weights::parse(include_bytes!("../../../tests/data/gradnet-own.safetensors")).unwrap();
        let [data, gradient, output] = ["data", "gradient", "output"].map(|name| vectors.tensor(name).unwrap());
        let network = Weights::parse(WEIGHTS).and_then(|weights| GradNet::new(&weights)).unwrap();
        assert_eq!((network.inputs(), network.outputs()), OWN);
        let made = network.apply(&Tensor::concat(&[&data, &gradient]));
        let largest = output.data.iter().fold(0.0f32, |most, value| most.max(value.abs()));
        for (made, expected) in made.data.iter().zip(&output.data) {
            assert!((made - expected).abs() < 1e-5 * largest, "{made} instead of {expected}");
        }
    }
}
