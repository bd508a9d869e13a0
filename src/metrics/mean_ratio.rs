//! Ratio of mean values, to see lost or gained energy.

use super::{Measure, Metric};
use crate::image::Image;

/// Sum of all values over the reference's; 1 when both are black.
pub const METRIC: Metric =
    Metric { id: "mean_ratio", summary: "mean of the image over mean of the reference", measure };

fn measure(image: &Image, reference: &Image) -> Measure {
    let sum = |image: &Image| image.data.iter().map(|&value| f64::from(value)).sum::<f64>();
    let (a, b) = (sum(image), sum(reference));
    Measure { mean: if a == b { 1.0 } else { a / b }, map: None }
}
