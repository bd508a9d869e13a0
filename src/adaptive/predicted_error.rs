//! Samples go where the reconstructed image is estimated to be wrong.

use super::Allocator;
use super::allocate::need;
use crate::error::{Error, Result};
use crate::film::{Frame, Layer};
use crate::image::Image;
use crate::image::planes::Planes;
use crate::reconstruct::Solution;

/// Radius of the windows in which the image's mean is compared with that of the samples.
const RADIUS: usize = 7;

/// `predicted_error`.
pub struct PredictedError;

impl Allocator for PredictedError {
    fn id(&self) -> &'static str {
        "predicted_error"
    }

    fn summary(&self) -> &'static str {
        "by the relative error that the method estimates for its image"
    }

    fn needs_error(&self) -> bool {
        true
    }

    fn need(&self, frame: &Frame, solution: Option<&Solution>) -> Result<Vec<f32>> {
        let missing = || Error::Usage("the method has not estimated its error".into());
        let solution = solution.ok_or_else(missing)?;
        let mut error = solution.error.clone().ok_or_else(missing)?;
        error.add(&squared_bias(frame, &solution.image)?);
        need(frame, &solution.image, &error)
    }
}

/// Squared differences of means over windows from those of the samples, beyond their noise. Methods that trust what varies little
/// darken images of few samples, pixel by pixel by less than the noise; their own estimates do not show it.
fn squared_bias(frame: &Frame, image: &Image) -> Result<Image> {
    let (color, variance) = (frame.require(Layer::Color)?, frame.require(Layer::ColorVariance)?);
    let direct = frame.get(Layer::Direct);
    let residual = Planes::from_fn(frame.width, frame.height, 3, |c, x, y| {
        image.pixel(x, y)[c] - color.pixel(x, y)[c] - direct.map_or(0.0, |direct| direct.pixel(x, y)[c])
    });
    let variance = Planes::from_fn(frame.width, frame.height, 3, |c, x, y| variance.pixel(x, y)[c]);
    let pixels = ((2 * RADIUS + 1) * (2 * RADIUS + 1)) as f32;
    let beyond = |residual: f32, variance: f32| (residual * residual - variance / pixels).max(0.0);
    let bias = residual.box_mean(RADIUS).zip(&variance.box_mean(RADIUS), beyond);
    Ok(bias.to_image(frame.width, frame.height, 1.0))
}
