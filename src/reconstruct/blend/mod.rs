//! Convex combinations of finished images, their weights from a small network (in the spirit of Zheng et al. 2021).
//!
//! ```text
//! frame ─ methods ─ candidates ─┬─ features ─ network ─ weights ─┬─ safety rule ─ sum
//!                  colours ─────┴───────────── residuals ────────┘
//! ```
//!
//! Weights are at least zero and sum to one, so that no pixel is worse than the worst candidate. The sampled colours are the
//! last candidate: they take the weight of images that differ from them by more than noise, which makes the error fall to
//! zero whatever the network says. The residual error of the last method's image is a feature, too; the error layer is
//! that method's own.
//!
//! Mixtures of Fluxion's own images are no better than the best of them, `net`; so `blend` without Open Image Denoise is `net`.

mod features;
mod network;

use std::sync::OnceLock;

use self::features::Evidence;
use self::network::Network;
use super::common::inputs::{Inputs, NET_BYTES, check_memory};
use super::frgr::{Denoiser, Frgr, Near, Outcome};
use super::net::{self, Corrected, Net};
use super::{Context, EdgeTrust, Method, Note, Parameter, Parameters, Reconstruction, Solution, Traits};
use crate::error::{Error, Result};
use crate::film::{Frame, Layer, Needs};
use crate::image::Image;
use crate::image::planes::Planes;

/// `blend`.
pub const METHOD: Method = Method {
    id: "blend",
    summary: "net; with oidn=on several images mixed pixel by pixel, the weights from a small network; consistent",
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

/// Bytes held for every pixel besides the frame while a method works: of its intermediate images, and of every finished candidate.
const NOTES: u64 = 80;
const CANDIDATE: u64 = 12;

/// An upper bound of all, which `net` takes most of; less is held while images are mixed.
const BYTES: u64 = NET_BYTES + NOTES + 5 * CANDIDATE;

/// The trained network for these.
const WEIGHTS: &[u8] = include_bytes!("oidn.safetensors");

/// Position of `net`'s image among the candidates.
const BEST: usize = 2;

/// Number of candidates: the first method's image and the image that it is near, those of `net` and `frgr`, and the sampled colours.
const COUNT: usize = 5;

struct Blend {
    /// Enhances an image of another method.
    near: Near,
    net: Net,
    network: &'static Network,
    safety: bool,
}

fn make(parameters: &Parameters) -> Result<Box<dyn Reconstruction>> {
    let safety = parameters.switch("safety")?;
    if parameters.switch("oidn")? {
        return Ok(Box::new(Blend::new(Near::new(Frgr::default().unfiltered(), Denoiser::Oidn)?, safety)?));
    }
    Ok(if safety { Box::new(net::by_default()?) } else { Box::new(Net::new(false)?) })
}

impl Blend {
    fn new(near: Near, safety: bool) -> Result<Self> {
        static NETWORK: OnceLock<Result<Network, String>> = OnceLock::new();
        let network = NETWORK.get_or_init(|| Network::new(WEIGHTS, COUNT));
        let network = network.as_ref().map_err(|why| Error::backend(METHOD.id, why))?;
        Ok(Self { near, net: Net::new(true)?, network, safety })
    }

    /// The images to be mixed, and the expected squared error of the last method's. `held` bytes besides the images are counted.
    fn candidates(&self, frame: &Frame, context: &Context) -> Result<(Vec<Image>, Option<Image>)> {
        let pixels = (frame.width * frame.height) as u64;
        let part = |k: f32| move |what: &str, done: f32| (context.progress)(what, 0.45 * (k + done));
        let (first, second) = (part(0.0), part(1.0));
        let Outcome { solution: enhanced, denoised, .. } = context.beside(NOTES * pixels, |memory| {
            self.near.run(frame, &Context { progress: &first, memory, notes: false })
        })?;
        let Corrected { image, frgr, error, .. } = context.beside((NOTES + 2 * CANDIDATE) * pixels, |memory| {
            self.net.image(frame, &Context { progress: &second, memory, notes: false })
        })?;
        Ok((vec![enhanced.image, denoised, image, frgr, frame.require(Layer::Color)?.clone()], error))
    }
}

impl Reconstruction for Blend {
    fn needs(&self) -> Needs {
        self.near.needs().union(self.net.needs())
    }

    fn estimates_error(&self) -> bool {
        true
    }

    fn needs_cross(&self) -> bool {
        true
    }

    fn guide(&self) -> Option<&dyn Reconstruction> {
        self.net.guide()
    }

    fn guide_share(&self) -> f64 {
        0.3
    }

    fn reconstruct(&self, frame: &Frame, context: &Context) -> Result<Solution> {
        check_memory(frame, context, METHOD.id, BYTES)?;
        let inputs = Inputs::new(frame, 1)?;
        // What is missing is said before the work.
        if frame.own_edges().is_none() {
            frame.cross()?;
        }
        frame.require(Layer::Albedo)?;
        let (candidates, error) = self.candidates(frame, context)?;
        (context.progress)("blend", 0.9);
        let images: Vec<_> = candidates.iter().map(|image| inputs.mirrored(image, inputs.scale)).collect();
        drop(candidates);
        let evidence = Evidence::new(&inputs, &images, BEST)?;
        let weights = self.network.weights(&evidence.features(inputs.samples_input()));
        let kept = if self.safety { evidence.safe(weights, inputs.spp) } else { weights };
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::vec3;
    use crate::reconstruct::{parse, solve};
    use crate::synthetic::{Distribution, Noise, change, noisy, picture};

    const SIZE: (usize, usize) = (48, 40);

    /// As with Open Image Denoise, whose place non-local means take.
    fn stand_in(safety: bool) -> Blend {
        let near = Near::new(Frgr::default().unfiltered(), Denoiser::Means).unwrap();
        Blend::new(near, safety).unwrap()
    }

    fn frame(truth: &Image, noise: f32, edge: f32, seed: u64) -> Frame {
        noisy(truth, Noise { color: noise, edge, distribution: Distribution::Normal }, seed)
    }

    fn solved(method: &dyn Reconstruction, frame: &Frame) -> Solution {
        solve(method, frame, &Context { notes: true, ..Context::QUIET }).unwrap()
    }

    fn mse(image: &Image, truth: &Image) -> f64 {
        crate::metrics::find("mse").unwrap().measure(image, truth).unwrap().mean
    }

    #[test]
    fn every_value_lies_among_those_of_the_candidates() {
        let frame = frame(&picture(SIZE), 0.3, 0.1, 1);
        let methods = ["frgr:filter=off", "net:image=safe", "frgr"];
        let [enhanced, net, frgr] = methods.map(|method| solved(parse(method).unwrap().as_ref(), &frame));
        let (denoised, colors) = (enhanced.note("denoised").unwrap(), frame.get(Layer::Color).unwrap());
        let candidates = [&enhanced.image, denoised, &net.image, &frgr.image, colors];
        for safety in [true, false] {
            let blend = solved(&stand_in(safety), &frame);
            for (i, value) in blend.image.data.iter().enumerate() {
                let of =
                    |choose: fn(f32, f32) -> f32| candidates.iter().map(|image| image.data[i]).reduce(choose).unwrap();
                assert!((of(f32::min) - 1e-4..=of(f32::max) + 1e-4).contains(value), "{value}");
            }
            let weights = |i: usize| blend.notes.iter().map(|note| note.image.data[i]).sum::<f32>();
            assert_eq!(blend.notes.len(), candidates.len());
            assert!((0..blend.image.data.len()).all(|i| (weights(i) - 1.0).abs() < 1e-5));
        }
    }

    #[test]
    fn errors_fall_with_the_noise_and_their_estimates_with_them() {
        let (truth, blend) = (picture(SIZE), stand_in(true));
        let [coarse, fine] = [0.4, 0.05].map(|noise| {
            let solutions = [1, 2, 3].map(|seed| solved(&blend, &frame(&truth, noise, 0.3 * noise, seed)));
            let error = solutions.iter().map(|solution| mse(&solution.image, &truth)).sum::<f64>() / 3.0;
            let claims = solutions.iter().flat_map(|solution| solution.error.as_ref().unwrap().data.iter());
            let claimed = claims.map(|&claim| f64::from(claim)).sum::<f64>() / (3.0 * truth.data.len() as f64);
            assert!(error < 0.2 * f64::from(noise * noise), "{error:.2e} of noise {noise}");
            assert!((0.2..5.0).contains(&(claimed / error)), "{claimed:.2e} for {error:.2e}");
            error
        });
        assert!(fine < 0.05 * coarse, "{fine:.2e} after {coarse:.2e}");
    }

    #[test]
    fn where_no_candidate_can_be_right_the_colours_stay() {
        // A pattern that no feature shows, with differences that deny it and claim to be certain, in colours without noise.
        let pattern = |x: usize, y: usize| vec3(1.0, 1.0, 1.0) * (1.0 + 0.5 * ((x * 7 + y * 11) % 5) as f32);
        let truth = Image::from_rgb(SIZE.0, SIZE.1, pattern);
        let mut frame = frame(&truth, 1e-3, 1e-4, 4);
        [Layer::Dx, Layer::Dy].into_iter().for_each(|layer| change(&mut frame, layer, |_, _| 0.0));
        let [safe, free] = [true, false].map(|safety| mse(&solved(&stand_in(safety), &frame).image, &truth));
        assert!(safe < 1e-4 && free > 10.0 * safe, "{safe:.1e}, without the rule {free:.1e}");
    }

    #[test]
    fn own_images_are_those_of_net() {
        let frame = frame(&picture(SIZE), 0.2, 0.1, 2);
        let [blend, net] = ["blend", "net"].map(|method| solved(parse(method).unwrap().as_ref(), &frame).image);
        assert_eq!(blend, net);
    }
}
