//! Pictures of radiance and of errors, as a browser takes them.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;

use crate::error::{Error, Result};
use crate::image::Image;
use crate::image::io::Picture;
use crate::math::{Rgb, srgb_encode, vec3};

/// Side of the squares that transparent pixels lie on.
const SQUARE: usize = 8;

/// An error map in colours: blue is none, red the worst hundredth of the values or `top`.
pub fn heat(map: &Image, top: Option<f32>) -> Image {
    let top = top.unwrap_or_else(|| worst(map)).max(f32::MIN_POSITIVE);
    let (cold, middle, hot) = (vec3(0.02, 0.05, 0.3), vec3(0.9, 0.9, 0.9), vec3(0.6, 0.0, 0.02));
    Image::from_rgb(map.width, map.height, |x, y| {
        let share = (map.pixel(x, y)[0] / top).clamp(0.0, 1.0);
        let color: Rgb = if share < 0.5 { cold.lerp(middle, 2.0 * share) } else { middle.lerp(hot, 2.0 * share - 1.0) };
        color
    })
}

/// The 99th percentile of the values.
pub fn worst(map: &Image) -> f32 {
    let mut sorted = map.data.clone();
    sorted.sort_by(f32::total_cmp);
    sorted.get(sorted.len().saturating_sub(1) * 99 / 100).copied().unwrap_or_default()
}

/// The picture as FLIP sees it: each channel x / (1 + x), then sRGB. What shows through lies on a checkerboard.
pub fn tone_mapped(picture: &Picture) -> Image {
    let compress = |value: f32| value.max(0.0) / (1.0 + value.max(0.0));
    let Picture { color, alpha, .. } = picture;
    Image::from_rgb(color.width, color.height, |x, y| {
        let behind = if (x / SQUARE + y / SQUARE).is_multiple_of(2) { 0.25 } else { 0.4 };
        let uncovered = alpha.as_ref().map_or(0.0, |alpha| 1.0 - alpha.pixel(x, y)[0]);
        Rgb::from_array(color.rgb(x, y).to_array().map(compress)) + behind * uncovered
    })
}

/// An RGB image of values in [0, 1] as the address of a PNG that contains it.
pub fn data_url(image: &Image) -> Result<String> {
    let bytes: Vec<u8> =
        image.data.iter().map(|&value| (srgb_encode(value.clamp(0.0, 1.0)) * 255.0).round() as u8).collect();
    let mut png = Vec::new();
    let mut encoder = png::Encoder::new(&mut png, image.width as u32, image.height as u32);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    let written = encoder.write_header().and_then(|mut writer| writer.write_image_data(&bytes));
    written.map_err(|error| Error::backend("png", format!("cannot encode a picture: {error}")))?;
    Ok(format!("data:image/png;base64,{}", STANDARD.encode(&png)))
}
