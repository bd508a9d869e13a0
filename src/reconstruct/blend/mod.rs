//! Convex combinations of finished images, their weights from a small network (in the spirit of Zheng et al. 2021).
//!
//! ```text
//! frame ─ methods ─ candidates ─┬─ features ─ network ─ weights ─┬─ safety rule ─ sum
//!                  colours ─────┴───────────── residuals ────────┘
//! ```
//!
//! Weights are at least zero and sum to one, so that no pixel is worse than the worst candidate. The sampled colours are the
//! last candidate: they take the weight of images that differ from them by more than noise, which makes the error fall to
//! zero whatever the network says.

mod features;
mod network;

use self::features::Evidence;
use self::network::Network;
use super::inputs::{Inputs, check_memory};
use super::{Context, EdgeTrust, Method, Note, Parameter, Parameters, Reconstruction, Solution, Traits, parse};
use crate::error::{Error, Result};
use crate::film::{Frame, Layer, Needs};
use crate::image::Image;
use crate::image::planes::Planes;

/// `blend`.
pub const METHOD: Method = Method {
    id: "blend",
    summary: "several images mixed pixel by pixel, the weights from a small network; consistent",
    traits: Traits { edges: EdgeTrust::ByVariance, ..Traits::FILTER },
    parameters: &[
        Parameter {
            name: "oidn",
            default: "off",
            summary: "whether Open Image Denoise, if it is installed, gives some of the images, `on` or `off`",
        },
        Parameter {
            name: "safety",
            default: "on",
            summary: "whether images that differ by more than noise lose weight",
        },
    ],
    make,
};

/// Bytes held for every pixel besides the frame while images are mixed, an upper bound.
const BYTES: u64 = 900;

/// The same while a method works: of its intermediate images, and of every finished candidate.
const NOTES: u64 = 80;
const CANDIDATE: u64 = 12;

/// Methods, and those of their intermediate images that are candidates beside their own.
type Candidates = &'static [(&'static str, &'static [&'static str])];

const OWN: Candidates = &[("frgr", &["denoised", "level0_enhanced"])];
const WITH_OIDN: Candidates = &[("frgr:denoiser=oidn", &["denoised", "level0_enhanced"]), ("frgr", &[])];

struct Blend {
    methods: Vec<(Box<dyn Reconstruction>, &'static [&'static str])>,
    network: Network,
    safety: bool,
}

fn make(parameters: &Parameters) -> Result<Box<dyn Reconstruction>> {
    let (candidates, weights) = match parameters.switch("oidn")? {
        true => (WITH_OIDN, include_bytes!("oidn.safetensors").as_slice()),
        false => (OWN, include_bytes!("own.safetensors").as_slice()),
    };
    let methods = candidates.iter().map(|(method, notes)| Ok((parse(method)?, *notes))).collect::<Result<Vec<_>>>()?;
    let count = 1 + candidates.iter().map(|(_, notes)| 1 + notes.len()).sum::<usize>();
    let network = Network::new(weights, count).map_err(|why| Error::backend("blend", why))?;
    Ok(Box::new(Blend { methods, network, safety: parameters.switch("safety")? }))
}

impl Reconstruction for Blend {
    fn needs(&self) -> Needs {
        self.methods.iter().fold(Needs::default(), |needs, (method, _)| needs.union(method.needs()))
    }

    fn estimates_error(&self) -> bool {
        true
    }

    fn reconstruct(&self, frame: &Frame, context: &Context) -> Result<Solution> {
        check_memory(frame, context, METHOD.id, BYTES)?;
        let inputs = Inputs::new(frame, 1)?;
        // What is missing is said before the work.
        if !frame.has_own_edges() {
            frame.cross()?;
        }
        frame.require(Layer::Albedo)?;
        let pixels = (frame.width * frame.height) as u64;
        let (mut candidates, mut error) = (Vec::new(), None);
        for (k, (method, notes)) in self.methods.iter().enumerate() {
            let share = 0.9 / self.methods.len() as f32;
            let report = |what: &str, done: f32| (context.progress)(what, (k as f32 + done) * share);
            let held = pixels * (NOTES + CANDIDATE * candidates.len() as u64);
            let memory = context.memory.map(|memory| memory.saturating_sub(held));
            let solution = method.reconstruct(frame, &Context { progress: &report, memory, notes: true })?;
            candidates.push(solution.image);
            for name in *notes {
                let note = solution.notes.iter().find(|note| note.name == *name);
                candidates.extend(note.map(|note| note.image.clone()));
            }
            error = solution.error;
        }
        candidates.push(frame.require(Layer::Color)?.clone());
        (context.progress)("blend", 0.9);
        let images: Vec<_> = candidates.iter().map(|image| inputs.mirrored(image, inputs.scale)).collect();
        drop(candidates);
        let of_frgr = error.map(|error| inputs.mirrored(&error, inputs.scale * inputs.scale));
        let evidence = Evidence::new(&inputs, &images, of_frgr)?;
        let weights = self.network.weights(&evidence.features(inputs.spp));
        let kept = if self.safety { evidence.safe(weights, inputs.spp) } else { weights };
        let error = Some(inputs.error(&evidence.error(&kept)));
        let notes = if context.notes { notes(&kept, &inputs) } else { Vec::new() };
        Ok(Solution { image: mixed(&images, &kept, &inputs), alpha: None, error, notes })
    }
}

/// The sum of images by their weights, in radiance.
fn mixed(images: &[Planes], weights: &Planes, inputs: &Inputs) -> Image {
    let value = |c: usize, x: usize, y: usize| {
        let (x, y) = (x as isize, y as isize);
        images.iter().enumerate().map(|(k, image)| weights.at(k, x, y) * image.at(c, x, y)).sum()
    };
    let planes = Planes::from_fn(inputs.width, inputs.height, 3, value);
    planes.to_image(inputs.width, inputs.height, 1.0 / inputs.scale)
}

/// The weight of every candidate as a grey image; the last one is that of the sampled colours.
fn notes(weights: &Planes, inputs: &Inputs) -> Vec<Note> {
    let (width, height) = (inputs.width, inputs.height);
    let note = |k: usize| {
        let weight = Planes::from_fn(width, height, 3, |_, x, y| weights.at(k, x as isize, y as isize));
        Note { name: format!("weight{k}"), image: weight.to_image(width, height, 1.0) }
    };
    (0..weights.channels()).map(note).collect()
}
