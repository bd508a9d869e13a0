//! Features of the network; tools/train/net.py computes the same for training.

use crate::error::Result;
use crate::film::Layer;
use crate::image::planes::Planes;
use crate::nn::Tensor;
use crate::reconstruct::common::inputs::Inputs;
use crate::reconstruct::common::residual::{mean, noise};

/// Luminance below which differences count as absolute, in units of the typical luminance.
pub const DARK: f32 = 0.1;

/// Number of channels besides one for every image after the first.
const OTHERS: usize = 16;

/// Features for images of which the first one is corrected, and the squared error that it claims. Radiance is in units of its
/// typical luminance.
pub fn features(inputs: &Inputs, images: &[Planes], claimed: &Planes) -> Result<Tensor> {
    let variance = noise(&inputs.planes(Layer::ColorVariance, inputs.scale * inputs.scale)?);
    let claimed = mean(claimed);
    let albedo = inputs.planes(Layer::Albedo, 1.0)?;
    let normal = inputs.planes(Layer::Normal, 1.0)?;
    let depth = inputs.planes(Layer::Depth, 1.0)?;
    // Deviations, means over the channels.
    let deviation = |layer, channels: usize| -> Result<Planes> {
        Ok(inputs.planes(layer, 1.0)?.map(f32::sqrt).sum().map(|sum| sum / channels as f32))
    };
    let of_albedo = deviation(Layer::AlbedoVariance, 3)?;
    let of_normal = deviation(Layer::NormalVariance, 3)?;
    let of_depth = deviation(Layer::DepthVariance, 1)?;
    let depths = &inputs.frame.require(Layer::Depth)?.data;
    let distance =
        (depths.iter().map(|&depth| f64::from(depth.max(0.0))).sum::<f64>() / depths.len() as f64) as f32 + 1e-9;
    let luminances: Vec<Planes> = images.iter().map(mean).collect();
    let samples = inputs.samples_input();
    let channels = OTHERS + images.len() - 1;
    Ok(Tensor::from_fn(inputs.width, inputs.height, channels, |x, y, pixel| {
        let (x, y) = (x as isize, y as isize);
        let luminance = luminances[0].at(0, x, y).max(0.0);
        let unit = luminance + DARK;
        let relative = |square: f32| 0.5 * libm::logf(square.max(0.0) + 1e-7) - libm::logf(unit);
        let far = depth.at(0, x, y).max(0.0);
        let mut rest = pixel.iter_mut();
        let mut put = |value: f32| *rest.next().expect("as many as are counted") = value;
        (0..3).for_each(|c| put(libm::logf(images[0].at(c, x, y).max(0.0) + DARK)));
        luminances[1..].iter().for_each(|other| put(libm::asinhf(3.0 * (other.at(0, x, y) - luminance) / unit)));
        put(relative(variance.at(0, x, y)));
        put(relative(claimed.at(0, x, y)));
        (0..3).for_each(|c| put(albedo.at(c, x, y)));
        (0..3).for_each(|c| put(normal.at(c, x, y)));
        put(far / (far + distance));
        put(of_albedo.at(0, x, y));
        put(of_normal.at(0, x, y));
        put(of_depth.at(0, x, y) / (far + distance));
        put(samples);
    }))
}
