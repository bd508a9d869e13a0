//! What is known of an image at one resolution.

use super::features::Feature;
use crate::error::Result;
use crate::film::{Frame, Layer};
use crate::image::Image;
use crate::image::planes::{Planes, mirror};

/// Means and variances of the means, radiance in units of its typical luminance.
pub struct Level {
    /// Colour, and its variance.
    pub color: Planes,
    /// Variance of the colour.
    pub variance: Planes,
    /// Differences to the right and downwards. Those of the last column and row belong to no edge.
    pub gradients: [Planes; 2],
    /// Their variances, mean over the channels.
    pub noise: [Planes; 2],
    /// Albedo and normal, as far as they are there and asked for.
    pub features: Vec<Feature>,
}

/// Shares of the mean variance around them that the variances of a colour and of a difference are raised to. Where all
/// samples were zero the sample variance is zero too, which does not mean that the pixel is known.
const COLOR_FLOOR: f32 = 0.5;
const GRADIENT_FLOOR: f32 = 0.25;

impl Level {
    /// The same with variances raised to a share of those around them.
    pub fn without_certainty(self) -> Self {
        let raise = |variance: &Planes, share: f32| variance.zip(&variance.box_mean(1), |v, mean| v.max(share * mean));
        let noise = [raise(&self.noise[0], GRADIENT_FLOOR), raise(&self.noise[1], GRADIENT_FLOOR)];
        Self { variance: raise(&self.variance, COLOR_FLOOR), noise, ..self }
    }
}

/// Scattered radiance, as layers of a frame.
pub struct Inputs<'a> {
    frame: &'a Frame,
    /// Pixels in a row, after mirroring.
    pub width: usize,
    /// Rows, after mirroring.
    pub height: usize,
    /// What radiance is multiplied by: results then do not depend on the exposure.
    pub scale: f32,
    /// Mean number of samples of a pixel.
    pub spp: f32,
}

impl<'a> Inputs<'a> {
    /// The inputs of a frame, mirrored until both sides are multiples of `multiple`.
    pub fn new(frame: &'a Frame, multiple: usize) -> Result<Self> {
        let scale = 1.0 / typical_luminance(frame.require(Layer::Color)?);
        let samples = &frame.require(Layer::Samples)?.data;
        let spp = (samples.iter().map(|&n| f64::from(n)).sum::<f64>() / samples.len() as f64).max(1.0) as f32;
        let (width, height) = (frame.width.next_multiple_of(multiple), frame.height.next_multiple_of(multiple));
        Ok(Self { frame, width, height, scale, spp })
    }

    /// A layer times `scale`.
    pub fn planes(&self, layer: Layer, scale: f32) -> Result<Planes> {
        let image = self.frame.require(layer)?;
        let channels = image.channels;
        Ok(Planes::from_fn(self.width, self.height, channels, |c, x, y| {
            let (x, y) = (self.inside(x, image.width), self.inside(y, image.height));
            image.data[(y * image.width + x) * channels + c] * scale
        }))
    }

    /// Radiance and its variance.
    pub fn color(&self) -> Result<[Planes; 2]> {
        Ok([self.planes(Layer::Color, self.scale)?, self.planes(Layer::ColorVariance, self.scale * self.scale)?])
    }

    /// Differences along `axis` (0: to the right, 1: downwards) and their variances. Where the image is mirrored
    /// differences change their sign.
    pub fn gradient(&self, axis: usize) -> Result<[Planes; 2]> {
        let (mean, variance) = [(Layer::Dx, Layer::DxVariance), (Layer::Dy, Layer::DyVariance)][axis];
        let step = [(1, 0), (0, 1)][axis];
        let edges = |layer, scale: f32, back: f32| {
            let image = self.frame.require(layer)?;
            let (w, h) = (image.width, image.height);
            Ok::<_, crate::error::Error>(Planes::from_fn(self.width, self.height, 3, |c, x, y| {
                let near = (self.inside(x, w), self.inside(y, h));
                let far = (self.inside(x + step.0, w), self.inside(y + step.1, h));
                let value = |(x, y): (usize, usize)| image.data[(y * w + x) * 3 + c] * scale;
                match () {
                    () if far.0 + far.1 > near.0 + near.1 => value(near),
                    () if far.0 + far.1 < near.0 + near.1 => back * value(far),
                    () => 0.0,
                }
            }))
        };
        Ok([edges(mean, self.scale, -1.0)?, edges(variance, self.scale * self.scale, 1.0)?])
    }

    fn inside(&self, at: usize, length: usize) -> usize {
        if at < length { at } else { mirror(at as isize, length) }
    }
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
