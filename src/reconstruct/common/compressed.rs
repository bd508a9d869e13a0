//! Inputs of networks that have encoders for colours and differences; tools/train/encoders.py makes the same of frames. Radiance, in
//! units of its typical luminance, is compressed by `T(x) = sign(x) log(1 + 16 |x|) / log 17`.

use super::inputs::Inputs;
use super::residual::mean;
use crate::error::Result;
use crate::film::Layer;
use crate::image::planes::Planes;
use crate::nn::Tensor;

/// Strength of the compression.
const MU: f32 = 16.0;

/// Largest compressed value that is decompressed.
const MOST: f32 = 4.0;

/// Upper bound of deviations that are given, in units of the typical luminance: that of a difference that was never sampled is infinite.
const MOST_NOISE: f32 = 1e3;

/// Share of the depths that is below the one that counts as 1.
const FAR: f64 = 0.99;

/// Channels that are given for features, and for differences with their noise and without.
pub const FEATURES: usize = 7;
pub const DIFFERENCES: usize = 8;
pub const NOISELESS_DIFFERENCES: usize = 6;

/// Compressed images, features, noise and number of samples, and more compressed images for the encoder of data; differences and
/// their noise for the other one. Without the `variance` of the colours neither noise nor number of samples.
pub fn given(inputs: &Inputs, images: &[&Planes], more: &[&Planes], variance: Option<&Planes>) -> Result<Tensor> {
    let [albedo, normal, depth] = [Layer::Albedo, Layer::Normal, Layer::Depth].map(|layer| inputs.planes(layer, 1.0));
    let (albedo, normal, depth) = (albedo?, normal?, depth?);
    let far = far(&inputs.frame.require(Layer::Depth)?.data);
    let [[dx, of_dx], [dy, of_dy]] = [inputs.gradient(0)?, inputs.gradient(1)?];
    let deviation = |variance: &Planes| mean(&variance.map(|variance| variance.sqrt().min(MOST_NOISE)));
    let noise = variance.map(|variance| [variance, &of_dx, &of_dy].map(deviation));
    let samples = inputs.samples_input();
    let of_images = |images: &[&Planes]| images.iter().map(|image| image.channels()).sum::<usize>();
    let of_noise = if noise.is_some() { 4 } else { 0 };
    let channels = of_images(images) + of_images(more) + FEATURES + NOISELESS_DIFFERENCES + of_noise;
    Ok(Tensor::from_fn(inputs.width, inputs.height, channels, |x, y, pixel| {
        let (x, y) = (x as isize, y as isize);
        let mut rest = pixel.iter_mut();
        let mut put = |value: f32| *rest.next().expect("as many as are counted") = value;
        let put_all = |image: &Planes, put: &mut dyn FnMut(f32)| {
            (0..image.channels()).for_each(|c| put(compress(image.at(c, x, y))));
        };
        images.iter().for_each(|image| put_all(image, &mut put));
        (0..3).for_each(|c| put(albedo.at(c, x, y)));
        (0..3).for_each(|c| put(0.5 * (normal.at(c, x, y) + 1.0)));
        put((depth.at(0, x, y).max(0.0) / far).min(1.0));
        if let Some([of_color, ..]) = &noise {
            put_all(of_color, &mut put);
            put(samples);
        }
        more.iter().for_each(|image| put_all(image, &mut put));
        [&dx, &dy].into_iter().for_each(|image| put_all(image, &mut put));
        if let Some([_, of_differences @ ..]) = &noise {
            of_differences.iter().for_each(|image| put_all(image, &mut put));
        }
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

/// The compressed value.
pub fn compress(value: f32) -> f32 {
    (libm::log1pf(MU * value.abs()) / libm::logf(1.0 + MU)).copysign(value)
}

/// The value that was compressed.
pub fn decompress(value: f32) -> f32 {
    (libm::expm1f(value.abs().min(MOST) * libm::logf(1.0 + MU)) / MU).copysign(value)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn compression_is_undone() {
        for value in [-900.0, -1.0, -1e-3, 0.0, 1e-4, 0.5, 20.0, 1000.0] {
            let again = decompress(compress(value));
            assert!((again - value).abs() <= 1e-5 * value.abs(), "{again} instead of {value}");
        }
    }
}
