//! Display formats, tiff and hdr.

use std::fs::File;
use std::io::BufWriter;
use std::path::Path;

use image::codecs::jpeg::JpegEncoder;
use image::codecs::{hdr::HdrEncoder, png::PngEncoder, tiff::TiffEncoder};
use image::{
    ColorType, DynamicImage, ExtendedColorType, ImageDecoder, ImageEncoder, ImageError, ImageFormat, ImageReader,
    Limits,
};

use super::{Format, Samples, byte};
use crate::error::{Error, Result};
use crate::pixels::{Header, Kind, Pixels, Storage};

/// Quality of jpg files, of a hundred.
const QUALITY: u8 = 98;

/// A format that the library recognises by the file's first bytes or, where these say nothing, its extension.
struct Picture;

fn reader(path: &Path) -> Result<ImageReader<std::io::BufReader<File>>> {
    let reader = ImageReader::open(path).and_then(ImageReader::with_guessed_format);
    let mut reader = reader.map_err(|error| Error::io(path, error))?;
    // What a header claims is checked before there is room made for it.
    reader.limits(Limits::no_limits());
    Ok(reader)
}

/// Reads a header.
pub fn open(path: &Path) -> Result<(Header, Box<dyn Format>)> {
    let reader = reader(path)?;
    let format = reader.format().map_or(String::new(), |format| format!("{format:?}").to_lowercase());
    let decoder = reader.into_decoder().map_err(|error| Error::io(path, error))?;
    let (width, height) = decoder.dimensions();
    let color = decoder.color_type();
    let names: &[&str] = match color {
        ColorType::L8 | ColorType::L16 => &["Y"],
        ColorType::La8 | ColorType::La16 => &["Y", "A"],
        ColorType::Rgb8 | ColorType::Rgb16 | ColorType::Rgb32F => &["R", "G", "B"],
        _ => &["R", "G", "B", "A"],
    };
    let storage = match color {
        ColorType::Rgb32F | ColorType::Rgba32F => Storage::Float,
        ColorType::L16 | ColorType::La16 | ColorType::Rgb16 | ColorType::Rgba16 => Storage::Unsigned(16),
        _ => Storage::Unsigned(8),
    };
    let header = Header {
        width: width as usize,
        height: height as usize,
        channels: names.iter().map(|&name| name.to_owned()).collect(),
        storage: vec![storage; names.len()],
        format,
        ..Header::default()
    };
    Ok((header, Box::new(Picture)))
}

impl Format for Picture {
    fn samples(&self, path: &Path) -> Result<Samples> {
        let shares = |values: Vec<u16>| values.into_iter().map(|value| f32::from(value) / 65535.0).collect();
        let reader = reader(path)?;
        if let Some(bytes) = (reader.format() == Some(ImageFormat::Jpeg)).then(|| jpeg(path)).flatten() {
            return Ok(Samples::Bytes(bytes));
        }
        let image = reader.decode().map_err(|error| Error::io(path, error))?;
        Ok(match image {
            DynamicImage::ImageLuma16(image) => Samples::Floats(shares(image.into_raw())),
            DynamicImage::ImageLumaA16(image) => Samples::Floats(shares(image.into_raw())),
            DynamicImage::ImageRgb16(image) => Samples::Floats(shares(image.into_raw())),
            DynamicImage::ImageRgba16(image) => Samples::Floats(shares(image.into_raw())),
            DynamicImage::ImageRgb32F(image) => Samples::Floats(image.into_raw()),
            DynamicImage::ImageRgba32F(image) => Samples::Floats(image.into_raw()),
            other => Samples::Bytes(other.into_bytes()),
        })
    }
}

/// Samples of a jpg file, decoded by the code that OpenImageIO calls: others round in their own ways. None where that code gives up,
/// which it does by unwinding.
fn jpeg(path: &Path) -> Option<Vec<u8>> {
    let decode = || {
        let file = mozjpeg::Decompress::new_path(path)?;
        let mut lines = if file.components().len() == 1 { file.grayscale()? } else { file.rgb()? };
        let bytes = lines.read_scanlines::<u8>()?;
        lines.finish()?;
        Ok::<_, std::io::Error>(bytes)
    };
    std::panic::catch_unwind(decode).ok()?.ok()
}

/// Writes the channels of a colour, in eight bits or floats as the format has them.
pub fn write(path: &Path, pixels: &Pixels, kind: Kind, extension: &str) -> Result<()> {
    let size = |n: usize| u32::try_from(n).map_err(|_| Error::io(path, "the image is too large for any format"));
    let (width, height) = (size(pixels.width)?, size(pixels.height)?);
    let color = match (pixels.channels.len(), kind) {
        (1, Kind::Uint8) => ExtendedColorType::L8,
        (3, Kind::Uint8) => ExtendedColorType::Rgb8,
        (4, Kind::Uint8) => ExtendedColorType::Rgba8,
        (3, _) => ExtendedColorType::Rgb32F,
        (4, _) => ExtendedColorType::Rgba32F,
        (count, _) => return Err(Error::io(path, format!("this format has no {count} channels"))),
    };
    let bytes: Vec<u8> = match kind {
        Kind::Uint8 => pixels.data.iter().map(|&value| byte(value)).collect(),
        Kind::Float | Kind::Half => pixels.data.iter().flat_map(|value| value.to_ne_bytes()).collect(),
    };
    if !["png", "jpg", "jpeg", "tif", "tiff", "hdr"].contains(&extension) {
        return Err(Error::io(path, "no writer for this file name's extension"));
    }
    let file = BufWriter::new(File::create(path).map_err(|error| Error::io(path, error))?);
    let written: std::result::Result<(), ImageError> = match extension {
        "png" => PngEncoder::new(file).write_image(&bytes, width, height, color),
        "jpg" | "jpeg" => JpegEncoder::new_with_quality(file, QUALITY).write_image(&bytes, width, height, color),
        "hdr" => HdrEncoder::new(file).write_image(&bytes, width, height, color),
        _ => TiffEncoder::new(file).write_image(&bytes, width, height, color),
    };
    written.map_err(|error| Error::io(path, error))
}
