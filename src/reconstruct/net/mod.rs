//! A trained U-Net that corrects the image of `frgr`. What it adds is learned from other scenes; frames and gradients speak through
//! `frgr` and its intermediate images.
//!
//! ```text
//! frame ─ frgr ─ images ─┬─ features ─ U-Net ─ weights, correction ─┐
//!                        └──────────────────── sum by weights ──────┴─ safety rule ─ safe image (─ frgr) ─ result
//! ```
//!
//! The safe image is pulled back to `frgr` where it differs from the sampled colours by more than noise, so that the error goes on
//! falling with the number of samples. With few samples `frgr` filters the colours once more, held near the safe image in place of
//! its own denoised one.

mod features;

use self::features::{DARK, features};
use super::inputs::{Inputs, check_memory};
use super::residual::{mean, noise, squared_error, trust, windowed};
use super::{Context, EdgeTrust, Method, Note, Parameter, Parameters, Reconstruction, Solution, Traits, parse};
use crate::error::{Error, Result};
use crate::film::{Frame, Needs};
use crate::image::planes::Planes;
use crate::nn::{Tensor, UNet, Weights};

/// `net`.
pub const METHOD: Method = Method {
    id: "net",
    summary: "frgr, corrected by a trained network; consistent",
    traits: Traits { edges: EdgeTrust::ByVariance, ..Traits::FILTER },
    parameters: &[Parameter {
        name: "image",
        default: "auto",
        summary: "`network`, its own; `safe`, where samples allow it; `filtered`, colours by frgr near that; `auto`, by samples",
    }],
    make,
};

/// The trained network.
const WEIGHTS: &[u8] = include_bytes!("net.safetensors");

/// Method of the filtered image.
const FILTERED: &str = "frgr:denoiser=net";

/// Number of samples up to which the filtered image is better, and least share of it that is worth its time. With many samples
/// frgr's filter blurs what the network has kept.
const FILTERED_SAMPLES: f32 = 32.0;
const LEAST_SHARE: f32 = 0.1;

/// Intermediate images of `frgr` that the network mixes with its result.
const IMAGES: [&str; 2] = ["denoised", "level0_enhanced"];

/// Radius of the window of `frgr`'s image whose values bound the result, room beyond them, over its luminance, and number of samples
/// up to which these bounds stay; with more they close in on `frgr`.
const REACH: usize = 2;
const ROOM: f32 = 0.5;
const FEW: f32 = 16.0;

/// How often the network halves the image.
const HALVINGS: usize = 4;

/// Rows that the network works on at a time.
const ROWS: usize = 128;

/// Bytes held for every pixel besides the frame, an upper bound.
const BYTES: u64 = 700;

struct Net {
    frgr: Box<dyn Reconstruction>,
    network: UNet,
    safety: bool,
}

fn make(parameters: &Parameters) -> Result<Box<dyn Reconstruction>> {
    let network = Weights::parse(WEIGHTS).and_then(|weights| UNet::new(&weights, HALVINGS));
    let network = network.map_err(|why| Error::backend(METHOD.id, why))?;
    let image = parameters.choice("image", &["auto", "network", "safe", "filtered"])?;
    let net = Net { frgr: parse("frgr")?, network, safety: image != "network" };
    Ok(match image.as_ref() {
        "filtered" => parse(FILTERED)?,
        "auto" => Box::new(Auto { safe: net, filtered: parse(FILTERED)? }),
        _ => Box::new(net),
    })
}

/// The filtered image with few samples, the safe one with many, and mixtures between.
struct Auto {
    safe: Net,
    filtered: Box<dyn Reconstruction>,
}

impl Reconstruction for Auto {
    fn needs(&self) -> Needs {
        self.safe.needs()
    }

    fn estimates_error(&self) -> bool {
        true
    }

    fn guide(&self) -> Option<&dyn Reconstruction> {
        self.safe.guide()
    }

    fn reconstruct(&self, frame: &Frame, context: &Context) -> Result<Solution> {
        let share = (FILTERED_SAMPLES / Inputs::new(frame, 1)?.spp).powi(2).min(1.0);
        if share < LEAST_SHARE {
            return self.safe.reconstruct(frame, context);
        }
        let mut solution = self.filtered.reconstruct(frame, &Context { notes: true, ..*context })?;
        if let Some(safe) = solution.notes.iter().find(|note| note.name == "denoised") {
            let values = solution.image.data.iter_mut().zip(&safe.image.data);
            values.for_each(|(value, safe)| *value = safe + share * (*value - safe));
        }
        if !context.notes {
            solution.notes.clear();
        }
        Ok(solution)
    }
}

impl Reconstruction for Net {
    fn needs(&self) -> Needs {
        Needs { features: true, ..self.frgr.needs() }
    }

    fn estimates_error(&self) -> bool {
        true
    }

    fn guide(&self) -> Option<&dyn Reconstruction> {
        Some(self.frgr.as_ref())
    }

    fn reconstruct(&self, frame: &Frame, context: &Context) -> Result<Solution> {
        check_memory(frame, context, METHOD.id, BYTES)?;
        let inputs = Inputs::new(frame, self.network.multiple())?;
        let report = |what: &str, done: f32| (context.progress)(what, 0.7 * done);
        let solution =
            self.frgr.reconstruct(frame, &Context { progress: &report, memory: context.memory, notes: true })?;
        (context.progress)("network", 0.7);
        let [color, variance] = inputs.color()?;
        let mut images = vec![inputs.mirrored(&solution.image, inputs.scale)];
        for name in IMAGES {
            let missing = || Error::backend(METHOD.id, format!("frgr made no image {name}"));
            images.push(inputs.mirrored(solution.note(name).ok_or_else(missing)?, inputs.scale));
        }
        images.push(color.clone());
        let claimed = solution.error.as_ref().map(|error| inputs.mirrored(error, inputs.scale * inputs.scale));
        let claimed = claimed.unwrap_or_else(|| variance.clone());
        let output = self.network.apply(&features(&inputs, &images, &claimed)?, ROWS);
        let corrected = corrected(&images, &output, inputs.spp);
        (context.progress)("safety", 0.95);
        let noise = noise(&variance);
        let image = if self.safety {
            let trust = trust(&windowed(&noise), &squared_error(&color, &noise, &corrected), inputs.spp);
            Planes::from_fn(inputs.width, inputs.height, 3, |c, x, y| {
                let (x, y) = (x as isize, y as isize);
                let safe = images[0].at(c, x, y);
                safe + trust.at(0, x, y) * (corrected.at(c, x, y) - safe)
            })
        } else {
            corrected
        };
        let image = image.to_image(frame.width, frame.height, 1.0 / inputs.scale);
        let mut notes = solution.notes;
        notes.push(Note { name: "frgr".into(), image: solution.image });
        Ok(Solution {
            image,
            alpha: None,
            error: solution.error,
            notes: if context.notes { notes } else { Vec::new() },
        })
    }
}

/// Images by the network's weights, and its correction relative to the first one's luminance; within what that has around.
fn corrected(images: &[Planes], output: &Tensor, spp: f32) -> Planes {
    let share = (FEW / spp).min(1.0).powi(2);
    let luminance = mean(&images[0]).map(|luminance| luminance.max(0.0) + DARK);
    Planes::from_fn(output.width, output.height, 3, |c, x, y| {
        let (scores, correction) = output.pixel(x, y).split_at(IMAGES.len() + 1);
        let largest = scores.iter().fold(f32::NEG_INFINITY, |largest, score| largest.max(*score));
        let around = |at: usize, length: usize| at.saturating_sub(REACH)..(at + REACH + 1).min(length);
        let window = around(y, output.height).flat_map(|y| around(x, output.width).map(move |x| (x, y)));
        let values = window.map(|(x, y)| images[0].at(c, x as isize, y as isize));
        let (least, most) =
            values.fold((f32::INFINITY, f32::NEG_INFINITY), |(a, b), value| (value.min(a), value.max(b)));
        let (x, y) = (x as isize, y as isize);
        let (mut sum, mut total) = (0.0, 0.0);
        for (image, score) in images.iter().zip(scores) {
            let weight = libm::expf(score - largest);
            sum += weight * image.at(c, x, y);
            total += weight;
        }
        let (unit, own) = (luminance.at(0, x, y), images[0].at(c, x, y));
        let bound = |extreme: f32, room: f32| own + share * share * (extreme - own) + share * room;
        (sum / total + unit * correction[c]).clamp(bound(least, -ROOM * unit), bound(most, ROOM * unit))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn images_are_those_of_pytorch() {
        let vectors = Weights::parse(include_bytes!("../../../tests/data/net.safetensors")).unwrap();
        let [features, images, logits, output] =
            ["features", "images", "logits", "output"].map(|name| vectors.tensor(name).unwrap());
        let network = UNet::new(&Weights::parse(WEIGHTS).unwrap(), HALVINGS).unwrap();
        assert_eq!((network.inputs(), network.multiple()), (features.channels, 16));
        let made = network.apply(&features, ROWS);
        let largest = logits.data.iter().fold(0.0f32, |most, value| most.max(value.abs()));
        for (made, expected) in made.data.iter().zip(&logits.data) {
            assert!((made - expected).abs() < 1e-5 * largest, "{made} instead of {expected}");
        }
        let planes = |tensor: &Tensor, first: usize| {
            Planes::from_fn(tensor.width, tensor.height, 3, |c, x, y| tensor.pixel(x, y)[first + c])
        };
        let images: Vec<_> = (0..images.channels / 3).map(|k| planes(&images, 3 * k)).collect();
        let (made, expected) = (corrected(&images, &made, 2.0 * FEW), planes(&output, 0));
        let difference = made.zip(&expected, |made, expected| (made - expected).abs() / (1.0 + expected.abs()));
        let worst = difference.to_image(output.width, output.height, 1.0).data.into_iter().fold(0.0, f32::max);
        assert!(worst < 1e-5, "{worst:.1e}");
    }
}
