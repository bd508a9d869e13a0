//! Checks a scene folder against its reference: does an independent render agree within the noise of both?

use std::path::Path;
use std::sync::atomic::AtomicBool;

use crate::error::{Error, Result};
use crate::film::{Frame, Layer, Needs};
use crate::image::Image;
use crate::image::io::{Kind, Pixels, read, write};
use crate::render::gradient::shift::Shift;
use crate::render::{Budget, Control, Settings, render};
use crate::scene::{Scene, load};

/// Seed of references, far from those that people choose.
const REFERENCE_SEED: u64 = 0x5eed_0000_0001;

/// Largest departure of a channel's mean that passes, apart from its noise.
const MEAN_TOLERANCE: f64 = 0.01;
/// Largest share of values beyond four standard errors that passes.
const OUTLIER_TOLERANCE: f64 = 0.01;
/// Rounding of half floats, as a share of the value (a uniform error of half a unit in the last place).
const HALF_ROUNDING: f64 = 4.9e-4 / 3.464;

/// The outcome of a check.
#[derive(Clone, Copy, Debug)]
pub struct Verdict {
    /// Mean of the render over mean of the reference, per channel.
    pub mean_ratio: [f64; 3],
    /// Root mean square of the differences in standard errors: 1 when the noise is all there is.
    pub z_rms: f64,
    /// Share of values that differ by more than four standard errors.
    pub outliers: f64,
    /// Whether the means and the outliers are within their tolerances.
    pub passed: bool,
}

fn path_traced(scene: &Scene, spp: u32, seed: u64) -> Frame {
    let settings = Settings { budget: Budget::Spp(spp), seed, needs: Needs::default(), shift: Shift::default() };
    let control = Control { stop: &AtomicBool::new(false), progress: &|_| {} };
    render(scene, settings, &control).film.develop()
}

/// Colour with directly seen emitters, and its standard error.
fn image_and_sigma(frame: &Frame) -> Result<(Image, Image)> {
    let mut image = frame.require(Layer::Color)?.clone();
    image.add(frame.require(Layer::Direct)?);
    let mut sigma = frame.require(Layer::ColorVariance)?.clone();
    sigma.add(frame.require(Layer::DirectVariance)?);
    sigma.data.iter_mut().for_each(|value| *value = value.sqrt());
    Ok((image, sigma))
}

const CHANNELS: [&str; 6] = ["R", "G", "B", "sigma.R", "sigma.G", "sigma.B"];

/// Renders `folder/scene.xml` by plain path tracing into `folder/reference.exr`: half floats, with the standard
/// error of each value beside it. Returns the expected relMSE of the reference itself.
pub fn remake(folder: &Path, spp: u32, size: Option<(usize, usize)>) -> Result<f64> {
    let options = load::Options { size, ..load::Options::default() };
    let scene = load::load(&folder.join("scene.xml"), &options)?;
    let (image, sigma) = image_and_sigma(&path_traced(&scene, spp, REFERENCE_SEED))?;
    let pairs = image.data.iter().zip(&sigma.data);
    let relative = |(&value, &sigma): (&f32, &f32)| f64::from(sigma * sigma) / f64::from(value * value + 0.01);
    let floor = pairs.map(relative).sum::<f64>() / image.data.len() as f64;
    let interleaved = image.data.chunks_exact(3).zip(sigma.data.chunks_exact(3));
    let data = interleaved.flat_map(|(a, b)| a.iter().chain(b).copied()).collect();
    let attribute = |name: &str, value: String| (format!("fluxion:{name}"), value);
    let attributes = vec![
        attribute("spp", spp.to_string()),
        attribute("seed", REFERENCE_SEED.to_string()),
        attribute("floor", format!("{floor:.2e}")),
        attribute("fingerprint", format!("{:016x}", scene.fingerprint())),
        attribute("method", "primal".into()),
    ];
    let channels = CHANNELS.map(String::from).to_vec();
    let pixels = Pixels { width: image.width, height: image.height, channels, data, eight_bit: false, attributes };
    write(&folder.join("reference.exr"), &pixels, Kind::Half, Some("zip"))?;
    Ok(floor)
}

/// Renders `folder/scene.xml` at the size of `folder/reference.exr` and compares.
pub fn check(folder: &Path, spp: u32, seed: u64) -> Result<Verdict> {
    let path = folder.join("reference.exr");
    let reference = read(&path, &["fluxion:spp"])?;
    let reference_spp = reference.attributes.first().and_then(|(_, spp)| spp.parse::<f64>().ok());
    let reference_spp = reference_spp.ok_or_else(|| Error::io(&path, "the header does not say `fluxion:spp`"))?;
    let size = (reference.width, reference.height);
    let positions = CHANNELS.map(|name| reference.channels.iter().position(|other| other == name));
    let Some(positions) = positions.into_iter().collect::<Option<Vec<_>>>() else {
        return Err(Error::io(&path, format!("no channels {}", CHANNELS.join(", "))));
    };
    let scene = load::load(&folder.join("scene.xml"), &load::Options { size: Some(size), ..load::Options::default() })?;
    let (image, own_sigma) = image_and_sigma(&path_traced(&scene, spp, seed))?;
    let mut sums = [[0.0; 3]; 3];
    let (mut squares, mut outliers) = (0.0, 0);
    for (pixel, expected) in reference.data.chunks_exact(reference.channels.len()).enumerate() {
        for c in 0..3 {
            let (value, expected_value) = (f64::from(image.data[3 * pixel + c]), f64::from(expected[positions[c]]));
            let rounding = HALF_ROUNDING * expected_value;
            // Few samples may all have missed what makes the noise, and the reference may have missed what a few
            // have hit: the larger of both figures is believed.
            let [sigma, own] = [expected[positions[c + 3]], own_sigma.data[3 * pixel + c]].map(f64::from);
            let variance = sigma * sigma + (own * own).max(sigma * sigma * reference_spp / f64::from(spp));
            let variance = variance + rounding * rounding;
            let difference = value - expected_value;
            let z = if difference == 0.0 { 0.0 } else { difference / variance.max(1e-12).sqrt() };
            squares += z * z;
            outliers += usize::from(z.abs() > 4.0);
            sums[c][0] += value;
            sums[c][1] += expected_value;
            sums[c][2] += variance;
        }
    }
    let count = (3 * size.0 * size.1) as f64;
    let ratio = |[value, expected, _]: [f64; 3]| if value == expected { 1.0 } else { value / expected };
    let within = |s: &[f64; 3]| (s[0] - s[1]).abs() <= MEAN_TOLERANCE * s[1] + 4.0 * s[2].sqrt();
    let outliers = outliers as f64 / count;
    let passed = sums.iter().all(within) && outliers <= OUTLIER_TOLERANCE;
    Ok(Verdict { mean_ratio: sums.map(ratio), z_rms: (squares / count).sqrt(), outliers, passed })
}
