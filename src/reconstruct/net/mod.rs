//! Two trained networks that correct the image of `frgr`; what they add is learned from other scenes. A U-Net sees that image, its
//! intermediate ones and features, the other network sampled differences, too. What both get wrong differs, so that the mean of
//! both has less error than either.
//!
//! ```text
//! frame ─ frgr ─ images ─┬─ U-Net ───┬─ mean ─ bounds ─ safety rule ─ safe image (─ frgr) ─ result
//!   └──── differences ───┴─ GradNet ─┘
//! ```
//!
//! The safe image is pulled back to `frgr` where it differs from the sampled colours by more than noise, so that the error goes on
//! falling with the number of samples. With few samples `frgr` filters the colours once more, held near the safe image in place of
//! its own denoised one.

mod features;

use std::sync::OnceLock;

use self::features::{DARK, features};
use super::common::compressed::{compress, decompress, given};
use super::common::inputs::{Inputs, NET_BYTES, check_memory};
use super::common::residual::{mean, noise, pulled_to};
use super::frgr::{Base, Frgr, HELD_BYTES, Outcome};
use super::{Context, EdgeTrust, Method, Note, Parameter, Parameters, Reconstruction, Solution, Traits};
use crate::error::{Error, Result};
use crate::film::{Frame, Needs, Recorded};
use crate::image::Image;
use crate::image::planes::Planes;
use crate::nn::{GradNet, Tensor, UNet, Weights};

/// `net`.
pub const METHOD: Method = Method {
    id: "net",
    summary: "frgr, corrected by trained networks; consistent",
    traits: Traits { edges: EdgeTrust::ByVariance, ..Traits::FILTER },
    parameters: &[Parameter {
        name: "image",
        default: "auto",
        summary: "`network`, the networks' own; `safe`, where samples allow it; `filtered`, colours by frgr near that; `auto`, by samples",
    }],
    make,
};

/// The trained networks: one that is shown no differences but what `frgr` made of them, and one that is.
const WEIGHTS: &[u8] = include_bytes!("net.safetensors");
const WITH_DIFFERENCES: &[u8] = include_bytes!("differences.safetensors");

/// Number of samples up to which the filtered image is better, and least share of it that is worth its time. With many samples
/// frgr's filter blurs what the network has kept.
const FILTERED_SAMPLES: f32 = 32.0;
const LEAST_SHARE: f32 = 0.1;

/// Number of images that the network mixes: `frgr`'s result, its denoised and its enhanced one. It sees the sampled colours, too.
const MIXED: usize = 3;

/// Radius of the window of `frgr`'s image whose values bound the result, room beyond them, over its luminance, and number of samples
/// up to which these bounds stay; with more they close in on `frgr`.
const REACH: usize = 2;
const ROOM: f32 = 0.5;
const FEW: f32 = 32.0;

/// How often the network halves the image.
const HALVINGS: usize = 4;

/// The trained networks, read once per process.
struct Networks {
    network: UNet,
    with_differences: GradNet,
}

impl Networks {
    fn get() -> Result<&'static Self> {
        static NETWORKS: OnceLock<Result<Networks, String>> = OnceLock::new();
        let read = || {
            let network = Weights::parse(WEIGHTS).and_then(|weights| UNet::new(&weights, "", HALVINGS))?;
            let with_differences = Weights::parse(WITH_DIFFERENCES).and_then(|weights| GradNet::new(&weights))?;
            Ok(Self { network, with_differences })
        };
        NETWORKS.get_or_init(read).as_ref().map_err(|why| Error::backend(METHOD.id, why))
    }
}

/// The corrected image of `frgr`, with or without the safety rule.
pub struct Net {
    frgr: Frgr,
    networks: &'static Networks,
    safety: bool,
}

/// A corrected image.
pub struct Corrected {
    /// The image, in radiance.
    pub image: Image,
    /// The image of `frgr` that was corrected.
    pub frgr: Image,
    /// Expected squared error of each value.
    pub error: Option<Image>,
    /// Intermediate images, if they are wanted.
    pub notes: Vec<Note>,
}

fn make(parameters: &Parameters) -> Result<Box<dyn Reconstruction>> {
    Ok(match parameters.choice("image", &["auto", "network", "safe", "filtered"])?.as_ref() {
        "filtered" => Box::new(Auto { net: Net::new(true)?, filtered: true }),
        "auto" => Box::new(Auto { net: Net::new(true)?, filtered: false }),
        image => Box::new(Net::new(image == "safe")?),
    })
}

/// `net` as it is by default.
pub fn by_default() -> Result<impl Reconstruction> {
    Ok(Auto { net: Net::new(true)?, filtered: false })
}

/// The filtered image with few samples, the safe one with many, and mixtures between.
struct Auto {
    net: Net,
    /// Whether the filtered image is taken with any number of samples.
    filtered: bool,
}

impl Reconstruction for Auto {
    fn needs(&self) -> Needs {
        self.net.needs()
    }

    fn estimates_error(&self) -> bool {
        true
    }

    fn needs_cross(&self) -> bool {
        true
    }

    fn guide(&self) -> Option<&dyn Reconstruction> {
        self.net.guide().filter(|_| !self.filtered)
    }

    fn guide_share(&self) -> f64 {
        self.net.guide_share()
    }

    fn reconstruct(&self, frame: &Frame, context: &Context) -> Result<Solution> {
        let share = (FILTERED_SAMPLES / Inputs::new(frame, 1)?.spp).powi(2).min(1.0);
        if share < LEAST_SHARE && !self.filtered {
            return self.net.reconstruct(frame, context);
        }
        let (frgr, pixels) = (&self.net.frgr, (frame.width * frame.height) as u64);
        let base = frgr.begin(frame, context, NET_BYTES * pixels)?;
        let report = |_: &str, done: f32| (context.progress)("denoise", 0.1 + 0.35 * done);
        let safe = context.beside(HELD_BYTES * pixels, |memory| {
            self.net.correct(&base, frame, &Context { progress: &report, memory, notes: false })
        })?;
        let Outcome { mut solution, denoised, .. } = frgr.near_image(&base, &safe.image, context)?;
        if !self.filtered {
            let values = solution.image.data.iter_mut().zip(&denoised.data);
            values.for_each(|(value, safe)| *value = safe + share * (*value - safe));
        }
        Ok(solution)
    }
}

impl Reconstruction for Net {
    fn needs(&self) -> Needs {
        self.frgr.needs().with(Recorded::Features)
    }

    fn estimates_error(&self) -> bool {
        true
    }

    fn needs_cross(&self) -> bool {
        true
    }

    fn guide(&self) -> Option<&dyn Reconstruction> {
        Some(&self.frgr)
    }

    fn guide_share(&self) -> f64 {
        0.45
    }

    fn reconstruct(&self, frame: &Frame, context: &Context) -> Result<Solution> {
        let Corrected { image, error, notes, .. } = self.image(frame, context)?;
        Ok(Solution { image, alpha: None, error, notes })
    }
}

impl Net {
    /// The networks, with the safety rule or without.
    pub fn new(safety: bool) -> Result<Self> {
        Ok(Self { frgr: Frgr::default(), networks: Networks::get()?, safety })
    }

    /// The corrected image of a frame.
    pub fn image(&self, frame: &Frame, context: &Context) -> Result<Corrected> {
        check_memory(frame, context, METHOD.id, NET_BYTES)?;
        self.correct(&self.frgr.begin(frame, context, 0)?, frame, context)
    }

    /// The corrected image of a frame that is prepared.
    fn correct(&self, base: &Base, frame: &Frame, context: &Context) -> Result<Corrected> {
        check_memory(frame, context, METHOD.id, NET_BYTES)?;
        let Networks { network, with_differences } = self.networks;
        let inputs = Inputs::new(frame, network.multiple())?;
        let report = |what: &str, done: f32| (context.progress)(what, 0.7 * done);
        let Outcome { solution, denoised, enhanced } =
            self.frgr.run(base, &Context { progress: &report, ..*context })?;
        (context.progress)("network", 0.7);
        let [color, variance] = inputs.color()?;
        let made = [&solution.image, &denoised, &enhanced].map(|image| inputs.mirrored(image, inputs.scale));
        let images: Vec<Planes> = made.into_iter().chain([color.clone()]).collect();
        let claimed = solution.error.as_ref().map(|error| inputs.mirrored(error, inputs.scale * inputs.scale));
        let claimed = claimed.unwrap_or_else(|| variance.clone());
        let by_images = corrected(&images, &network.apply(&features(&inputs, &images, &claimed)?));
        (context.progress)("differences", 0.8);
        let claimed = mean(&claimed).map(|error| error.max(0.0).sqrt());
        let shown: Vec<_> = images.iter().collect();
        let output = with_differences.apply(&given(&inputs, &shown, &[&claimed], Some(&variance))?);
        let both = by_images.zip(&moved(&images[0], &output), |one, other| 0.5 * (one + other));
        let corrected = bounded(&images[0], &both, (FEW / inputs.spp).min(1.0).powi(2));
        (context.progress)("safety", 0.95);
        let image = if self.safety {
            pulled_to(&corrected, &images[0], (&color, &noise(&variance)), inputs.spp, 1.0)
        } else {
            corrected
        };
        let image = image.to_image(frame.width, frame.height, 1.0 / inputs.scale);
        let mut notes = solution.notes;
        if context.notes {
            notes.push(Note { name: "frgr".into(), image: solution.image.clone() });
        }
        Ok(Corrected { image, frgr: solution.image, error: solution.error, notes })
    }
}

/// Images by the network's weights, and its correction relative to the first one's luminance.
fn corrected(images: &[Planes], output: &Tensor) -> Planes {
    let luminance = mean(&images[0]).map(|luminance| luminance.max(0.0) + DARK);
    Planes::from_fn(output.width, output.height, 3, |c, x, y| {
        let (scores, correction) = output.pixel(x, y).split_at(MIXED);
        let largest = scores.iter().fold(f32::NEG_INFINITY, |largest, score| largest.max(*score));
        let (x, y) = (x as isize, y as isize);
        let (mut sum, mut total) = (0.0, 0.0);
        for (image, score) in images.iter().zip(scores) {
            let weight = libm::expf(score - largest);
            sum += weight * image.at(c, x, y);
            total += weight;
        }
        sum / total + luminance.at(0, x, y) * correction[c]
    })
}

/// The image, moved by what the network that is shown differences says of its compressed values.
fn moved(image: &Planes, output: &Tensor) -> Planes {
    Planes::from_fn(output.width, output.height, 3, |c, x, y| {
        decompress(compress(image.at(c, x as isize, y as isize)) + output.pixel(x, y)[c]).max(0.0)
    })
}

/// The corrected image, within what frgr has around, and no further from frgr than a `share` of that with many samples.
fn bounded(frgr: &Planes, corrected: &Planes, share: f32) -> Planes {
    let luminance = mean(frgr).map(|luminance| luminance.max(0.0) + DARK);
    Planes::from_fn(frgr.width, frgr.height, 3, |c, x, y| {
        let around = |at: usize, length: usize| at.saturating_sub(REACH)..(at + REACH + 1).min(length);
        let window = around(y, frgr.height).flat_map(|y| around(x, frgr.width).map(move |x| (x, y)));
        let values = window.map(|(x, y)| frgr.at(c, x as isize, y as isize));
        let (least, most) =
            values.fold((f32::INFINITY, f32::NEG_INFINITY), |(a, b), value| (value.min(a), value.max(b)));
        let (x, y) = (x as isize, y as isize);
        let (room, own) = (share * ROOM * luminance.at(0, x, y), frgr.at(c, x, y));
        let bound = |extreme: f32, room: f32| own + share * share * (extreme - own) + room;
        corrected.at(c, x, y).clamp(bound(least, -room), bound(most, room))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn vectors(bytes: &[u8], names: [&str; 4]) -> [Tensor; 4] {
        let vectors = Weights::parse(bytes).unwrap();
        names.map(|name| vectors.tensor(name).unwrap())
    }

    fn planes(tensor: &Tensor, first: usize) -> Planes {
        Planes::from_fn(tensor.width, tensor.height, 3, |c, x, y| tensor.pixel(x, y)[first + c])
    }

    /// Largest difference, over one more than what is expected.
    fn worst(made: &Planes, expected: &Planes) -> f32 {
        let difference = made.zip(expected, |made, expected| (made - expected).abs() / (1.0 + expected.abs()));
        difference.to_image(made.width, made.height, 1.0).data.into_iter().fold(0.0, f32::max)
    }

    #[test]
    fn images_are_those_of_pytorch() {
        let bytes = include_bytes!("../../../tests/data/net.safetensors");
        let [features, images, logits, output] = vectors(bytes, ["features", "images", "logits", "output"]);
        let network = UNet::new(&Weights::parse(WEIGHTS).unwrap(), "", HALVINGS).unwrap();
        assert_eq!((network.inputs(), network.multiple()), (features.channels, 16));
        let made = network.apply(&features);
        let largest = logits.data.iter().fold(0.0f32, |most, value| most.max(value.abs()));
        for (made, expected) in made.data.iter().zip(&logits.data) {
            assert!((made - expected).abs() < 1e-5 * largest, "{made} instead of {expected}");
        }
        let images: Vec<_> = (0..images.channels / 3).map(|k| planes(&images, 3 * k)).collect();
        let worst = worst(&bounded(&images[0], &corrected(&images, &made), 0.25), &planes(&output, 0));
        assert!(worst < 1e-5, "{worst:.1e}");
    }

    #[test]
    fn images_with_differences_are_those_of_pytorch() {
        let bytes = include_bytes!("../../../tests/data/net-differences.safetensors");
        let [data, gradient, image, output] = vectors(bytes, ["data", "gradient", "image", "output"]);
        let network = GradNet::new(&Weights::parse(WITH_DIFFERENCES).unwrap()).unwrap();
        assert_eq!((network.inputs(), network.outputs()), ([data.channels, gradient.channels], 3));
        let made = network.apply(&Tensor::concat(&[&data, &gradient]));
        let worst = worst(&moved(&planes(&image, 0), &made), &planes(&output, 0));
        assert!(worst < 1e-5, "{worst:.1e}");
    }
}
