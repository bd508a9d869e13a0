//! Distances between an image and its reference. All take linear RGB of equal size with finite values.

mod flip;
mod mean_ratio;
mod ms_ssim;
mod mse;
mod rel_mse;
mod smape;

use crate::error::{Error, Result};
use crate::image::Image;

/// A metric's outcome.
#[derive(Clone, Debug)]
pub struct Measure {
    /// The one figure.
    pub mean: f64,
    /// The figure of every pixel, one channel; none for figures of whole images.
    pub map: Option<Image>,
}

/// A row of the table of metrics.
pub struct Metric {
    /// Key in reports.
    pub id: &'static str,
    /// Description for tables.
    pub summary: &'static str,
    /// Measures an image against a reference; called through [`measure`] only.
    measure: fn(&Image, &Image) -> Measure,
}

/// Every metric.
pub const METRICS: &[Metric] =
    &[rel_mse::METRIC, smape::METRIC, flip::METRIC, ms_ssim::METRIC, mse::METRIC, mean_ratio::METRIC];

/// Fails on images that no metric can compare.
pub fn check(image: &Image, reference: &Image) -> Result<()> {
    if image.shape() != reference.shape() || image.channels != 3 || image.is_empty() {
        let text = |image: &Image| format!("{}x{} pixels of {} channels", image.width, image.height, image.channels);
        return Err(Error::Mismatch(format!("the images differ in shape: {} and {}", text(image), text(reference))));
    }
    for (name, image) in [("image", image), ("reference", reference)] {
        if let Some((x, y, _)) = image.not_finite() {
            return Err(Error::BadData(format!("the {name} is not finite at pixel {x},{y}")));
        }
    }
    Ok(())
}

impl Metric {
    /// Measures an image against a reference.
    pub fn measure(&self, image: &Image, reference: &Image) -> Result<Measure> {
        check(image, reference)?;
        Ok((self.measure)(image, reference))
    }
}

/// The metric with this key.
pub fn find(id: &str) -> Option<&'static Metric> {
    METRICS.iter().find(|metric| metric.id == id)
}

/// A mean over channels and pixels of `f(value, reference)`, with its map.
fn average(image: &Image, reference: &Image, f: impl Fn(f64, f64) -> f64) -> Measure {
    let mut map = Image::new(image.width, image.height, 1);
    let mut sum = 0.0;
    let pixels = image.data.chunks_exact(3).zip(reference.data.chunks_exact(3));
    for (slot, (a, b)) in map.data.iter_mut().zip(pixels) {
        let pixel = a.iter().zip(b).map(|(&a, &b)| f(f64::from(a), f64::from(b))).sum::<f64>() / 3.0;
        *slot = pixel as f32;
        sum += pixel;
    }
    Measure { mean: sum / map.data.len() as f64, map: Some(map) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::{Rgb, vec3};

    fn pair() -> (Image, Image) {
        let reference = Image::from_rgb(2, 2, |x, y| vec3(0.1 + x as f32, 0.5, 0.2 + y as f32));
        let image = Image::from_rgb(2, 2, |x, y| vec3(0.1 + x as f32, 0.6, 0.2 - y as f32));
        (image, reference)
    }

    #[test]
    fn an_image_is_at_no_distance_from_itself() {
        let (_, reference) = pair();
        for metric in METRICS {
            let expected = f64::from(u8::from(["mean_ratio", "ms_ssim"].contains(&metric.id)));
            let found = metric.measure(&reference, &reference).unwrap().mean;
            assert!((found - expected).abs() < 1e-12, "{}: {found}", metric.id);
        }
    }

    #[test]
    fn values_are_those_computed_by_hand() {
        let (image, reference) = pair();
        let mean = |id: &str| find(id).unwrap().measure(&image, &reference).unwrap().mean;
        // Green is off by 0.1 in all four pixels, blue by 2 in the lower two.
        assert!((mean("mse") - (4.0 * 0.01 + 2.0 * 4.0) / 12.0).abs() < 1e-6);
        assert!((mean("relmse") - (4.0 * 0.01 / 0.26 + 2.0 * 4.0 / 1.45) / 12.0).abs() < 1e-6);
        assert!((mean("smape") - (4.0 * 0.1 / 1.11 + 2.0 * 2.0 / 2.01) / 12.0).abs() < 1e-6);
        let sums = (4.0 * 0.6 + 4.0 * 0.6 - 4.0 * 0.4, 4.0 * 0.6 + 4.0 * 0.5 + 2.0 * 0.2 + 2.0 * 1.2);
        let sum = |image: &Image| image.data.iter().map(|&v| f64::from(v)).sum::<f64>();
        assert!((mean("mean_ratio") - sum(&image) / sum(&reference)).abs() < 1e-9 && sums.1 > sums.0);
        assert!((0.0..=1.0).contains(&mean("flip")) && mean("flip") > 0.05);
    }

    #[test]
    fn not_a_number_and_different_sizes_are_errors() {
        let (mut image, reference) = pair();
        let small = Image::from_rgb(1, 2, |_, _| Rgb::ONE);
        image.data[7] = f32::NAN;
        for metric in METRICS {
            assert!(metric.measure(&image, &reference).unwrap_err().to_string().contains("0,1"));
            assert!(metric.measure(&small, &reference).unwrap_err().to_string().contains("1x2"));
        }
    }
}
