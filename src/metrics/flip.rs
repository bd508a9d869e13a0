//! FLIP: the difference that a viewer sees when flipping between two images (Andersson et al. 2020), by NVIDIA's
//! own implementation.

use nv_flip::{DEFAULT_PIXELS_PER_DEGREE, FlipImageRgb8};

use super::{Measure, Metric};
use crate::image::Image;
use crate::math::srgb_encode;

/// LDR-FLIP of the images tone mapped alike: each channel x / (1 + x), then sRGB.
pub const METRIC: Metric =
    Metric { id: "flip", summary: "LDR-FLIP at 67 pixels per degree after x / (1 + x) and sRGB", measure };

fn display(image: &Image) -> FlipImageRgb8 {
    let encode = |&value: &f32| (srgb_encode(value.max(0.0) / (1.0 + value.max(0.0))) * 255.0).round() as u8;
    let bytes: Vec<u8> = image.data.iter().map(encode).collect();
    FlipImageRgb8::with_data(image.width as u32, image.height as u32, &bytes)
}

fn measure(image: &Image, reference: &Image) -> Measure {
    let errors = nv_flip::flip(display(reference), display(image), DEFAULT_PIXELS_PER_DEGREE);
    let map = Image { width: image.width, height: image.height, channels: 1, data: errors.to_vec() };
    let mean = map.data.iter().map(|&value| f64::from(value)).sum::<f64>() / map.data.len() as f64;
    Measure { mean, map: Some(map) }
}
