//! A frame as reconstructions work on it: planes and edges in units of the image's typical luminance.

use rayon::prelude::*;

use crate::error::{Error, Result};
use crate::film::{Edges, Frame, Layer};
use crate::image::Image;
use crate::image::nl_means::Guide;
use crate::image::planes::{Planes, mirror};
use crate::math::Rgb;
use crate::reconstruct::Context;
use crate::solve::graph::Quad;

/// Least variance of a colour, as a share of the mean variance of the pixels around it.
pub const FLOOR: f32 = 0.5;

/// Largest number of samples of a pixel that networks were trained with.
pub const TRAINED_SAMPLES: f32 = 64.0;

/// Bytes that `net` holds for every pixel besides the frame, an upper bound; methods that call it count them.
pub const NET_BYTES: u64 = 1150;

/// Least typical luminance: the square of one over it is still a float.
const LEAST_LUMINANCE: f32 = 1e-18;

/// Scattered radiance, as layers of a frame.
pub struct Inputs<'a> {
    /// The frame.
    pub frame: &'a Frame,
    /// Pixels in a row, after mirroring.
    pub width: usize,
    /// Rows, after mirroring.
    pub height: usize,
    /// Factor of radiance: one over the typical luminance, so that results do not depend on the exposure.
    pub scale: f32,
    /// Mean number of samples of a pixel.
    pub spp: f32,
}

impl<'a> Inputs<'a> {
    /// The inputs of a frame, mirrored until both sides are multiples of `multiple`.
    pub fn new(frame: &'a Frame, multiple: usize) -> Result<Self> {
        // In an image that is all but black the scale is still finite.
        let scale = 1.0 / typical_luminance(frame.require(Layer::Color)?).max(LEAST_LUMINANCE);
        let samples = &frame.require(Layer::Samples)?.data;
        let spp = (samples.iter().map(|&n| f64::from(n)).sum::<f64>() / samples.len() as f64).max(1.0) as f32;
        let (width, height) = (frame.width.next_multiple_of(multiple), frame.height.next_multiple_of(multiple));
        Ok(Self { frame, width, height, scale, spp })
    }

    /// Number of samples as an input of networks: its logarithm, bounded by that of [`TRAINED_SAMPLES`].
    pub fn samples_input(&self) -> f32 {
        libm::log2f(self.spp.min(TRAINED_SAMPLES)) / 4.0
    }

    /// A layer times `scale`.
    pub fn planes(&self, layer: Layer, scale: f32) -> Result<Planes> {
        Ok(self.mirrored(self.frame.require(layer)?, scale))
    }

    /// An image of the frame's size, times `scale`.
    pub fn mirrored(&self, image: &Image, scale: f32) -> Planes {
        Planes::from_fn(self.width, self.height, image.channels, |c, x, y| {
            let (x, y) = (self.inside(x, image.width), self.inside(y, image.height));
            image.data[(y * image.width + x) * image.channels + c] * scale
        })
    }

    /// Share of every pixel that is covered, if the frame has it with its noise: otherwise it is taken as it is.
    pub fn alpha(&self) -> Result<Option<Planes>> {
        let has = self.frame.get(Layer::Alpha).and(self.frame.get(Layer::AlphaVariance)).is_some();
        has.then(|| self.planes(Layer::Alpha, 1.0)).transpose()
    }

    /// A filtered alpha, no further from the sampled one than its noise: what is opaque in every sample stays so.
    pub fn clamp_alpha(&self, filtered: Image) -> Result<Image> {
        let (sampled, variance) = (self.frame.require(Layer::Alpha)?, self.frame.require(Layer::AlphaVariance)?);
        let near = |((value, sampled), variance): ((f32, &f32), &f32)| {
            let most = 2.0 * variance.sqrt();
            value.clamp(sampled - most, sampled + most).clamp(0.0, 1.0)
        };
        let (width, height, channels) = filtered.shape();
        let data = filtered.data.into_iter().zip(&sampled.data).zip(&variance.data).map(near).collect();
        Ok(Image { width, height, channels, data })
    }

    /// Radiance and its variance.
    pub fn color(&self) -> Result<[Planes; 2]> {
        Ok([self.planes(Layer::Color, self.scale)?, self.planes(Layer::ColorVariance, self.scale * self.scale)?])
    }

    /// The colour as a guide for filters, its variance raised to a share of those around.
    pub fn guide(&self) -> Result<Guide> {
        let [mean, variance] = self.color()?;
        Ok(Guide { mean, variance: floor_variance(&variance.sum(), FLOOR), tolerance: None })
    }

    /// Differences along `axis` (0: to the right, 1: downwards) and their variances. Where the image is mirrored
    /// differences change their sign.
    pub fn gradient(&self, axis: usize) -> Result<[Planes; 2]> {
        let cross = self.frame.cross()?;
        let variance = match cross.variance[axis] {
            Some(variance) => variance,
            None => self.frame.require([Layer::DxVariance, Layer::DyVariance][axis])?,
        };
        let step = [(1, 0), (0, 1)][axis];
        let edges = |image: &Image, scale: f32, back: f32| {
            let (w, h) = (image.width, image.height);
            Planes::from_fn(self.width, self.height, 3, |c, x, y| {
                let near = (self.inside(x, w), self.inside(y, h));
                let far = (self.inside(x + step.0, w), self.inside(y + step.1, h));
                let value = |(x, y): (usize, usize)| image.data[(y * w + x) * 3 + c] * scale;
                match () {
                    () if far.0 + far.1 > near.0 + near.1 => value(near),
                    () if far.0 + far.1 < near.0 + near.1 => back * value(far),
                    () => 0.0,
                }
            })
        };
        Ok([edges(cross.mean[axis], self.scale, -1.0), edges(variance, self.scale * self.scale, 1.0)])
    }

    /// Differences of edges times [`Inputs::scale`], edge by edge, as solvers take them.
    pub fn differences(&self, edges: &Edges) -> Vec<Quad> {
        edges.mean.par_iter().map(|mean| self.quad(*mean)).collect()
    }

    /// A colour times [`Inputs::scale`], as solvers take it.
    pub fn quad(&self, color: Rgb) -> Quad {
        let [r, g, b] = color.to_array();
        [r * self.scale, g * self.scale, b * self.scale, 0.0]
    }

    /// Three channels of a layer times [`Inputs::scale`], pixel by pixel, as solvers take them. Not mirrored.
    pub fn quads(&self, layer: Layer) -> Result<Vec<Quad>> {
        let pixels = self.frame.require(layer)?.data.par_chunks_exact(3);
        Ok(pixels.map(|rgb| [rgb[0] * self.scale, rgb[1] * self.scale, rgb[2] * self.scale, 0.0]).collect())
    }

    /// The image of a solution of the solvers.
    pub fn image(&self, solution: &[Quad]) -> Image {
        let data = solution.iter().flat_map(|quad| [quad[0], quad[1], quad[2]].map(|value| value / self.scale));
        Image { data: data.collect(), ..Image::new(self.frame.width, self.frame.height, 3) }
    }

    /// Squared errors of pixels, means over the channels, as those of their values: all channels have the same.
    pub fn error(&self, of_pixels: &Planes) -> Image {
        let (width, height) = (self.frame.width, self.frame.height);
        let of_value = |_, x: usize, y: usize| of_pixels.at(0, x as isize, y as isize).max(0.0);
        Planes::from_fn(width, height, 3, of_value).to_image(width, height, 1.0 / (self.scale * self.scale))
    }

    /// A half of the samples' colour, times [`Inputs::scale`]; not mirrored.
    pub fn half(&self, half: usize) -> Result<Planes> {
        let [mean, _] = self.frame.color_half(half)?;
        let at = |c, x, y| mean.data[(y * mean.width + x) * 3 + c] * self.scale;
        Ok(Planes::from_fn(mean.width, mean.height, 3, at))
    }

    fn inside(&self, at: usize, length: usize) -> usize {
        if at < length { at } else { mirror(at as isize, length) }
    }
}

/// Fails if a method that takes so many bytes for every pixel may not.
pub fn check_memory(frame: &Frame, context: &Context, method: &'static str, bytes: u64) -> Result<()> {
    let (size, bytes) = ((frame.width, frame.height), bytes * (frame.width * frame.height) as u64);
    match context.memory {
        Some(memory) if memory < bytes => Err(Error::TooLittleMemory { method, size, bytes }),
        _ => Ok(()),
    }
}

/// Three channels of planes from `first` on, pixel by pixel, as solvers take them.
pub fn quads(planes: &Planes, first: usize) -> Vec<Quad> {
    let (width, pixels) = (planes.width, planes.width * planes.height);
    let value = |i: usize, c: usize| planes.at(first + c, (i % width) as isize, (i / width) as isize);
    (0..pixels).into_par_iter().map(|i| [value(i, 0), value(i, 1), value(i, 2), 0.0]).collect()
}

/// Variances raised to a share of the mean around them. Where all samples were zero the sample variance is zero too,
/// which does not mean that the pixel is known.
pub fn floor_variance(variance: &Planes, share: f32) -> Planes {
    variance.zip(&variance.box_mean(1), |variance, around| variance.max(share * around))
}

/// The geometric mean of the luminance, in which dark pixels count as a thousandth of the mean.
fn typical_luminance(color: &Image) -> f32 {
    let luminance = |pixel: &[f32]| f64::from(pixel.iter().sum::<f32>() / 3.0).max(0.0);
    let count = color.data.len() as f64 / 3.0;
    let mean = color.data.chunks_exact(3).map(luminance).sum::<f64>() / count;
    if mean <= 0.0 {
        return 1.0;
    }
    let log = color.data.chunks_exact(3).map(|pixel| (luminance(pixel) + 1e-3 * mean).ln()).sum::<f64>() / count;
    log.exp() as f32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn networks_are_given_no_larger_number_of_samples_than_in_training() {
        for (samples, given) in [(1.0, 0.0), (16.0, 1.0), (64.0, 1.5), (4096.0, 1.5)] {
            let mut frame = Frame::new(2, 1);
            frame.set(Layer::Color, Image::new(2, 1, 3));
            frame.set(Layer::Samples, Image { data: vec![samples; 2], ..Image::new(2, 1, 1) });
            assert_eq!(Inputs::new(&frame, 1).unwrap().samples_input(), given, "{samples}");
        }
    }

    #[test]
    fn mirrored_differences_are_those_of_the_mirrored_image() {
        let mut frame = Frame::new(5, 3);
        let image = Image::from_rgb(5, 3, |x, y| crate::math::Rgb::splat(1.0 + ((x * 7 + y * 5) % 6) as f32));
        let step = |dx: usize, dy: usize| {
            Image::from_rgb(5, 3, |x, y| {
                let inside = x + dx < 5 && y + dy < 3;
                if inside { image.rgb(x + dx, y + dy) - image.rgb(x, y) } else { crate::math::Rgb::ZERO }
            })
        };
        frame.set(Layer::Dx, step(1, 0));
        frame.set(Layer::Dy, step(0, 1));
        frame.set(Layer::Samples, Image { data: vec![4.0; 15], ..Image::new(5, 3, 1) });
        for layer in [Layer::DxVariance, Layer::DyVariance] {
            frame.set(layer, Image::new(5, 3, 3));
        }
        frame.set(Layer::Color, image);
        let inputs = Inputs::new(&frame, 8).unwrap();
        assert_eq!((inputs.width, inputs.height, inputs.spp), (8, 8, 4.0));
        let color = inputs.planes(Layer::Color, inputs.scale).unwrap();
        for axis in 0..2 {
            let [mean, _] = inputs.gradient(axis).unwrap();
            for (x, y) in (0..7).flat_map(|y| (0..7).map(move |x| (x, y))) {
                let next = if axis == 0 { (x + 1, y) } else { (x, y + 1) };
                let expected = color.at(1, next.0, next.1) - color.at(1, x, y);
                assert!((mean.at(1, x, y) - expected).abs() < 1e-6, "axis {axis} at {x},{y}");
            }
        }
    }
}
