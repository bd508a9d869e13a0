//! Image files, through OpenImageIO: colour images in and out, with the encoding each format expects.

use std::path::Path;

use super::Image;
use crate::error::{Error, Result};
use crate::ffi::oiio;
pub use crate::ffi::oiio::{CachedTexture, ImageFile, Kind, Pixels, TextureSystem, failed_lookups, read};
use crate::files;
use crate::math::srgb_encode;

/// Formats that hold linear radiance as floats.
const LINEAR: &[&str] = &["exr", "hdr"];
/// Formats that hold display-encoded eight-bit colour.
const ENCODED: &[&str] = &["png", "jpg", "jpeg"];

fn extension(path: &Path) -> String {
    path.extension().unwrap_or_default().to_string_lossy().to_lowercase()
}

/// Fails on an extension that [`write_color`] cannot write, so that it can be found out before the work.
pub fn check_writable(path: &Path) -> Result<()> {
    let extension = extension(path);
    if LINEAR.contains(&extension.as_str()) || ENCODED.contains(&extension.as_str()) {
        return Ok(());
    }
    let formats = [LINEAR, ENCODED].concat().join(", ");
    Err(Error::io(path, format!("the extension `{extension}` is not one of {formats}")))
}

/// Writes an image in the format of the path's extension, whole or not at all.
pub fn write(path: &Path, pixels: &Pixels, kind: Kind, compression: Option<&str>) -> Result<()> {
    files::replace(path, |part| oiio::write(part, pixels, kind, compression))
}

/// Writes a linear RGB image: as it is to exr and hdr; clamped and sRGB-encoded to png and jpg. An exr file gets
/// the named `layers`, too, of three channels or one.
pub fn write_color(
    path: &Path,
    image: &Image,
    layers: &[(&str, &Image)],
    attributes: &[(String, String)],
) -> Result<()> {
    check_writable(path)?;
    let encoded = ENCODED.contains(&extension(path).as_str());
    let encode = |&value: &f32| srgb_encode(value.clamp(0.0, 1.0));
    let exr = extension(path) == "exr";
    let layers = if exr { layers } else { &[] };
    let mut channels = ["R", "G", "B"].map(String::from).to_vec();
    for (name, layer) in layers {
        let components = if layer.channels == 1 { &["Y"][..] } else { &["R", "G", "B"] };
        channels.extend(components.iter().map(|component| format!("{name}.{component}")));
    }
    let data = if encoded {
        image.data.iter().map(encode).collect()
    } else {
        let all = || std::iter::once(image).chain(layers.iter().map(|(_, layer)| *layer));
        let pixels = 0..image.width * image.height;
        pixels
            .flat_map(|i| all().flat_map(move |image| &image.data[i * image.channels..][..image.channels]))
            .copied()
            .collect()
    };
    let (width, height, attributes) = (image.width, image.height, attributes.to_vec());
    let pixels = Pixels { width, height, channels, data, eight_bit: encoded, attributes };
    write(path, &pixels, if encoded { Kind::Uint8 } else { Kind::Float }, exr.then_some("zips"))
}

/// Positions of the R, G and B channels. Without them, a file of up to `grey` channels has its first one thrice.
pub fn rgb_channels(path: &Path, channels: &[String], grey: usize) -> Result<[usize; 3]> {
    let find = |name: &str| channels.iter().position(|other| other.eq_ignore_ascii_case(name));
    match (find("R"), find("G"), find("B")) {
        (Some(r), Some(g), Some(b)) => Ok([r, g, b]),
        _ if channels.len() <= grey => Ok([0; 3]),
        _ => Err(Error::io(path, format!("no channels R, G, B among {}", channels.join(", ")))),
    }
}

/// Reads the R, G and B channels of a linear image (or its single channel, as grey). Eight-bit files are
/// decoded from sRGB.
pub fn read_color(path: &Path) -> Result<Image> {
    let pixels = read(path, &[])?;
    let wanted = rgb_channels(path, &pixels.channels, 1)?;
    let decode = |value: f32| if pixels.eight_bit { crate::math::srgb_decode(value) } else { value };
    let count = pixels.channels.len();
    let data = pixels.data.chunks_exact(count).flat_map(|pixel| wanted.map(|c| decode(pixel[c]))).collect();
    Ok(Image { width: pixels.width, height: pixels.height, channels: 3, data })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::vec3;

    #[test]
    fn every_format_gives_back_what_it_can_hold() {
        let image = Image::from_rgb(40, 24, |x, y| vec3(x as f32 / 40.0, y as f32 / 24.0, 0.5));
        let folder = tempfile::tempdir().unwrap();
        for (name, tolerance) in [("a.exr", 0.0), ("a.hdr", 0.01), ("a.png", 0.01), ("a.jpg", 0.2)] {
            let path = folder.path().join(name);
            write_color(&path, &image, &[], &[]).unwrap();
            let back = read_color(&path).unwrap();
            assert_eq!(back.shape(), image.shape());
            let worst = back.data.iter().zip(&image.data).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
            assert!(worst <= tolerance, "{name}: {worst}");
        }
        let error = write_color(&folder.path().join("a.xyz"), &image, &[], &[]).unwrap_err();
        assert!(error.to_string().contains("not one of exr"), "{error}");
    }
}
