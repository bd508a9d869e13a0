//! Image files, through OpenImageIO or, in builds without it, through libraries in Rust: colour images in and out, with the
//! encoding each format expects.

use std::ops::Deref;
use std::path::Path;

use super::Image;
use super::channels::{ColorChannels, Integers};
#[cfg(not(feature = "openimageio"))]
use super::pure as library;
use super::radiance::Radiance;
use crate::error::{Error, Result};
#[cfg(feature = "openimageio")]
use crate::ffi::oiio as library;
use crate::files;
use crate::math::srgb_encode;
pub use crate::pixels::{DataWindow, Header, Kind, OpenImage, Pixels, Storage};
pub use library::{CachedTexture, TextureSystem, failed_lookups};

/// An image file whose header has been read.
pub enum ImageFile<'a> {
    /// By a library.
    Library(library::ImageFile<'a>),
    /// A Radiance file of a kind that libraries leave out.
    Radiance(Radiance),
}

impl<'a> ImageFile<'a> {
    /// Reads the header.
    pub fn open(path: &'a Path) -> Result<Self> {
        if std::fs::metadata(path).map_err(|error| Error::io(path, error))?.len() == 0 {
            return Err(Error::io(path, "the file is empty"));
        }
        match Radiance::open(path)? {
            Some(file) => Ok(Self::Radiance(file)),
            None => library::ImageFile::open(path).map(Self::Library),
        }
    }

    /// Whether [`CachedTexture`] reads the same: not of files of several parts, of which it knows the first.
    pub fn can_be_cached(&self) -> bool {
        matches!(self, Self::Library(file) if file.parts <= 1)
    }

    fn file(&self) -> &dyn OpenImage<Target = Header> {
        match self {
            Self::Library(file) => file,
            Self::Radiance(file) => file,
        }
    }
}

impl Deref for ImageFile<'_> {
    type Target = Header;

    fn deref(&self) -> &Header {
        self.file()
    }
}

impl OpenImage for ImageFile<'_> {
    fn attribute(&self, name: &str) -> Option<String> {
        self.file().attribute(name)
    }

    fn floats(&self) -> Result<Vec<f32>> {
        self.file().floats()
    }

    fn bytes(&self) -> Result<Vec<u8>> {
        self.file().bytes()
    }
}

/// Formats that hold linear radiance as floats.
const LINEAR: &[&str] = &["exr", "hdr", "pfm", "tif", "tiff"];
/// Formats that hold display-encoded eight-bit colour.
const ENCODED: &[&str] = &["png", "jpg", "jpeg"];
/// Formats that hold an alpha channel.
const WITH_ALPHA: &[&str] = &["exr", "tif", "tiff", "png"];

/// Everything that may be written along with an image.
#[derive(Clone, Debug, Default)]
pub struct Extras<'a> {
    /// Share of every pixel that is covered, by which its colour is multiplied already.
    pub alpha: Option<&'a Image>,
    /// Named layers of three channels or one, for exr files.
    pub layers: Vec<(&'a str, &'a Image)>,
    /// Named strings of the header.
    pub attributes: Vec<(String, String)>,
    /// The larger picture that the image is a part of, for exr files.
    pub window: Option<DataWindow>,
    /// Exposure of display-encoded formats, in powers of two.
    pub exposure: f32,
}

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
    Err(Error::Usage(format!("{}: the extension `{extension}` is not one of {formats}", path.display())))
}

/// Reads a whole image, and those of `attributes` that its header has.
pub fn read(path: &Path, attributes: &[&str]) -> Result<Pixels> {
    ImageFile::open(path)?.pixels(attributes)
}

/// Whether the format of the path's extension holds layers besides the colours.
pub fn has_layers(path: &Path) -> bool {
    extension(path) == "exr"
}

/// Writes an image in the format of the path's extension, whole or not at all.
pub fn write(path: &Path, pixels: &Pixels, kind: Kind, compression: Option<&str>) -> Result<()> {
    files::replace(path, |part| library::write(part, pixels, kind, compression))
}

/// Writes a linear RGB image: as it is to exr, hdr, pfm and tiff; exposed, clamped and sRGB-encoded to png and jpg, whose
/// colours are those without their alpha. What a format cannot hold is left out.
pub fn write_color(path: &Path, image: &Image, extras: &Extras) -> Result<()> {
    check_writable(path)?;
    let extension = extension(path);
    let (encoded, exr) = (ENCODED.contains(&extension.as_str()), has_layers(path));
    let alpha = extras.alpha.filter(|_| WITH_ALPHA.contains(&extension.as_str()));
    let layers = if exr { extras.layers.as_slice() } else { &[] };
    let mut channels = ["R", "G", "B"].map(String::from).to_vec();
    channels.extend(alpha.map(|_| "A".to_owned()));
    for (name, layer) in layers {
        let components = if layer.channels == 1 { &["Y"][..] } else { &["R", "G", "B"] };
        channels.extend(components.iter().map(|component| format!("{name}.{component}")));
    }
    let mut data = Vec::with_capacity(image.width * image.height * channels.len());
    for i in 0..image.width * image.height {
        let covered = alpha.map(|alpha| alpha.data[i]);
        if encoded {
            let share = covered.filter(|&share| share > 0.0).unwrap_or(1.0);
            let scale = extras.exposure.exp2() / share;
            data.extend(samples(image, i).iter().map(|value| srgb_encode((value * scale).clamp(0.0, 1.0))));
        } else {
            data.extend(samples(image, i));
        }
        data.extend(covered.map(|share| share.clamp(0.0, 1.0)));
        layers.iter().for_each(|(_, layer)| data.extend(samples(layer, i)));
    }
    let (width, height, attributes) = (image.width, image.height, extras.attributes.clone());
    if extension == "pfm" {
        return files::write(path, pfm(width, &data));
    }
    let pixels = Pixels { width, height, channels, data, window: extras.window.filter(|_| exr), attributes };
    write(path, &pixels, if encoded { Kind::Uint8 } else { Kind::Float }, exr.then_some("zips"))
}

/// A portable float map: little-endian, rows from the bottom.
fn pfm(width: usize, rgb: &[f32]) -> Vec<u8> {
    let rows = rgb.chunks_exact(3 * width);
    let mut bytes = format!("PF\n{width} {}\n-1.0\n", rows.len()).into_bytes();
    rows.rev().flatten().for_each(|value| bytes.extend(value.to_le_bytes()));
    bytes
}

/// The samples of pixel number `i`.
fn samples(image: &Image, i: usize) -> &[f32] {
    &image.data[i * image.channels..][..image.channels]
}

/// A colour image, multiplied by its alpha if it has one.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    /// Linear RGB.
    pub color: Image,
    /// Share of every pixel that is covered.
    pub alpha: Option<Image>,
    /// The larger picture that it is a part of, if it is.
    pub window: Option<DataWindow>,
}

impl From<Image> for Picture {
    fn from(color: Image) -> Self {
        Self { color, alpha: None, window: None }
    }
}

/// Reads the colours of an image file as linear RGB, and its alpha.
pub fn read_picture(path: &Path) -> Result<Picture> {
    let file = ImageFile::open(path)?;
    let colors = ColorChannels::of(&file, path, Integers::Srgb)?;
    let at = colors.alpha(&file);
    // Display formats hold colours without their alpha.
    let multiplied = file.storage[colors.order[0]] == Storage::Float;
    let (samples, count) = (file.floats()?, file.channels.len());
    let (mut color, mut alpha) = (Vec::with_capacity(3 * samples.len() / count), Vec::new());
    for pixel in samples.chunks_exact(count) {
        let covered = at.map(|at| pixel[at]);
        let share = covered.filter(|_| !multiplied).unwrap_or(1.0);
        color.extend((colors.color(pixel) * share).to_array());
        alpha.extend(covered);
    }
    let image = |channels, data| Image { width: file.width, height: file.height, channels, data };
    Ok(Picture { color: image(3, color), alpha: at.map(|_| image(1, alpha)), window: file.window })
}

/// Reads the colours of an image file as linear RGB, multiplied by its alpha if it has one.
pub fn read_color(path: &Path) -> Result<Image> {
    Ok(read_picture(path)?.color)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::vec3;

    /// A library of image files.
    struct Library {
        name: &'static str,
        read: fn(&Path, &[&str]) -> Result<Pixels>,
        write: fn(&Path, &Pixels, Kind, Option<&str>) -> Result<()>,
    }

    /// Every library that this build has.
    const LIBRARIES: &[Library] = &[
        #[cfg(feature = "openimageio")]
        Library {
            name: "OpenImageIO",
            read: |path, attributes| crate::ffi::oiio::ImageFile::open(path)?.pixels(attributes),
            write: crate::ffi::oiio::write,
        },
        Library {
            name: "Rust",
            read: |path, attributes| super::super::pure::ImageFile::open(path)?.pixels(attributes),
            write: super::super::pure::write,
        },
    ];

    /// Pairs of a library that writes and one that reads.
    fn pairs() -> impl Iterator<Item = (&'static Library, &'static Library)> {
        LIBRARIES.iter().flat_map(|writer| LIBRARIES.iter().map(move |reader| (writer, reader)))
    }

    /// Samples of one channel.
    fn channel(pixels: &Pixels, name: &str) -> Vec<f32> {
        let at = pixels.channels.iter().position(|other| other == name).unwrap();
        pixels.data.iter().skip(at).step_by(pixels.channels.len()).copied().collect()
    }

    #[test]
    fn exr_keeps_every_bit_name_and_attribute() {
        let channels = ["R", "G", "B", "depth.Z"].map(String::from).to_vec();
        let data: Vec<f32> = (0..3 * 2 * 4).map(|i| (i as f32).exp() * 1e-3).collect();
        let attributes = vec![("fluxion:seed".to_owned(), "7".to_owned())];
        for (writer, reader) in pairs() {
            for window in [None, Some(DataWindow { origin: (5, 6), full: (10, 9) })] {
                let file = tempfile::Builder::new().suffix(".exr").tempfile().unwrap();
                let (channels, data, attributes) = (channels.clone(), data.clone(), attributes.clone());
                let pixels = Pixels { width: 3, height: 2, channels, data, attributes, window };
                (writer.write)(file.path(), &pixels, Kind::Float, Some("zips")).unwrap();
                let back = (reader.read)(file.path(), &["fluxion:seed", "absent"]).unwrap();
                assert_eq!((&back.attributes, back.window), (&pixels.attributes, window), "{}", reader.name);
                for name in &pixels.channels {
                    let bits = |pixels| channel(pixels, name).iter().map(|value| value.to_bits()).collect::<Vec<_>>();
                    assert_eq!(bits(&back), bits(&pixels), "{} {} {name}", writer.name, reader.name);
                }
                (writer.write)(file.path(), &pixels, Kind::Half, None).unwrap();
                let halves = channel(&(reader.read)(file.path(), &[]).unwrap(), "R");
                let near = |(a, b): (&f32, f32)| (a - b).abs() <= b / 1024.0 || b > 65504.0;
                assert!(halves.iter().zip(channel(&pixels, "R")).all(near), "{} {}", writer.name, reader.name);
            }
        }
    }

    #[test]
    fn libraries_agree_on_every_format() {
        let image = Image::from_rgb(40, 24, |x, y| vec3(x as f32 / 40.0, y as f32 / 24.0, 0.5));
        let channels = ["R", "G", "B"].map(String::from).to_vec();
        let pixels = Pixels { width: 40, height: 24, channels, data: image.data.clone(), ..Pixels::default() };
        let folder = tempfile::tempdir().unwrap();
        let kinds = [
            ("a.tiff", Kind::Float, 0.0),
            ("a.hdr", Kind::Float, 0.01),
            ("a.png", Kind::Uint8, 0.003),
            ("a.jpg", Kind::Uint8, 0.1),
        ];
        for (name, kind, tolerance) in kinds {
            let path = folder.path().join(name);
            for writer in LIBRARIES {
                (writer.write)(&path, &pixels, kind, None).unwrap();
                let read: Vec<_> = LIBRARIES.iter().map(|library| (library.read)(&path, &[]).unwrap()).collect();
                for (library, back) in LIBRARIES.iter().zip(&read) {
                    let worst = back.data.iter().zip(&pixels.data).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
                    assert!(worst <= tolerance, "{name} by {}, {}: {worst}", writer.name, library.name);
                    assert!(
                        back.data == read[0].data && back.channels == read[0].channels,
                        "{name} by {}",
                        writer.name
                    );
                }
            }
        }
        let path = folder.path().join("a.pfm");
        std::fs::write(&path, pfm(40, &image.data)).unwrap();
        LIBRARIES.iter().for_each(|library| assert_eq!((library.read)(&path, &[]).unwrap().data, image.data));
    }

    #[test]
    fn alpha_does_not_darken_colours() {
        let channels = ["R", "G", "B", "A"].map(String::from).to_vec();
        let pixels = Pixels { width: 1, height: 1, channels, data: vec![1.0, 0.4, 0.2, 0.0], ..Pixels::default() };
        for (writer, reader) in pairs() {
            let file = tempfile::Builder::new().suffix(".png").tempfile().unwrap();
            (writer.write)(file.path(), &pixels, Kind::Uint8, None).unwrap();
            let back = (reader.read)(file.path(), &[]).unwrap();
            back.data.iter().zip(&pixels.data).for_each(|(a, b)| assert!((a - b).abs() < 1e-3, "{a} {b}"));
        }
    }

    #[test]
    fn missing_truncated_and_unwritable_files_are_errors_with_the_name() {
        let pixels = Pixels { width: 1, height: 1, channels: vec!["R".into()], data: vec![1.0], ..Pixels::default() };
        let folder = tempfile::tempdir().unwrap();
        for library in LIBRARIES {
            let missing = (library.read)(Path::new("/no/such.exr"), &[]).unwrap_err().to_string();
            assert!(missing.starts_with("/no/such.exr: "), "{missing}");
            for (name, bytes) in [
                ("a.exr", &b"v/1\x01nothing more"[..]),
                ("a.pfm", b"PF\n9 9\n-1\n"),
                ("a.png", b"\x89PNG\r\n\x1a\n"),
                ("a", b""),
            ] {
                let path = folder.path().join(name);
                std::fs::write(&path, bytes).unwrap();
                let truncated = (library.read)(&path, &[]).unwrap_err().to_string();
                assert!(truncated.len() > path.display().to_string().len() + 5, "{}: {truncated}", library.name);
            }
            assert!((library.write)(Path::new("/no/such/folder/a.exr"), &pixels, Kind::Float, None).is_err());
            assert!((library.write)(&folder.path().join("a.nosuchformat"), &pixels, Kind::Float, None).is_err());
        }
    }

    #[test]
    fn every_format_gives_back_what_it_can_hold() {
        let image = Image::from_rgb(40, 24, |x, y| vec3(x as f32 / 40.0, y as f32 / 24.0, 0.5));
        let folder = tempfile::tempdir().unwrap();
        for (name, tolerance) in
            [("a.exr", 0.0), ("a.pfm", 0.0), ("a.tiff", 0.0), ("a.hdr", 0.01), ("a.png", 0.01), ("a.jpg", 0.2)]
        {
            let path = folder.path().join(name);
            write_color(&path, &image, &Extras::default()).unwrap();
            let back = read_color(&path).unwrap();
            assert_eq!(back.shape(), image.shape());
            let worst = back.data.iter().zip(&image.data).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
            assert!(worst <= tolerance, "{name}: {worst}");
        }
        let alpha = Image { channels: 1, data: vec![0.5; 40 * 24], ..image.clone() };
        for (name, tolerance) in [("a.exr", 0.0), ("a.tiff", 0.0), ("a.png", 0.01)] {
            let path = folder.path().join(name);
            let extras = Extras { alpha: Some(&alpha), ..Extras::default() };
            // Multiplied by alpha, no colour is brighter than that.
            let dimmed = Image { data: image.data.iter().map(|value| 0.5 * value).collect(), ..image.clone() };
            write_color(&path, &dimmed, &extras).unwrap();
            let Picture { color, alpha: back, .. } = read_picture(&path).unwrap();
            let far = |a: &Image, b: &Image| a.data.iter().zip(&b.data).any(|(a, b)| (a - b).abs() > tolerance);
            assert!(!far(&color, &dimmed) && !far(&back.unwrap(), &alpha), "{name}");
        }
        let error = write_color(&folder.path().join("a.xyz"), &image, &Extras::default()).unwrap_err();
        assert!(error.to_string().contains("not one of exr"), "{error}");
    }
}
