//! Image files through libraries in Rust, for builds without OpenImageIO: exr by one of its own, pfm here, and the usual
//! display formats, tiff and hdr. There is no cache of tiles: textures are held in memory whole.

#[cfg(not(feature = "openimageio"))]
mod cache;
mod exr;
mod pfm;
mod pictures;

use std::ops::Deref;
use std::path::Path;

#[cfg(not(feature = "openimageio"))]
pub use self::cache::{CachedTexture, TextureSystem, failed_lookups};

use crate::error::{Error, Result};
use crate::pixels::{Header, Kind, OpenImage, Pixels, exr_header};

/// A family of formats: its samples are read from the path again, after the header.
trait Format {
    /// A named string of the header.
    fn attribute(&self, _name: &str) -> Option<String> {
        None
    }

    /// All samples, channels interleaved.
    fn samples(&self, path: &Path) -> Result<Samples>;
}

/// Samples as they are stored.
enum Samples {
    /// Floats, or shares of the largest integer.
    Floats(Vec<f32>),
    /// Eight bits.
    Bytes(Vec<u8>),
}

/// An image file whose header has been read.
pub struct ImageFile<'a> {
    header: Header,
    path: &'a Path,
    format: Box<dyn Format>,
}

impl Deref for ImageFile<'_> {
    type Target = Header;

    fn deref(&self) -> &Header {
        &self.header
    }
}

impl<'a> ImageFile<'a> {
    /// Reads the header.
    pub fn open(path: &'a Path) -> Result<Self> {
        let bytes = std::fs::metadata(path).map_err(|error| Error::io(path, error))?.len() as usize;
        exr_header::check(path)?;
        let (header, format) = match pfm::open(path)? {
            Some(found) => found,
            None if exr::is_exr(path) => exr::open(path)?,
            None => pictures::open(path)?,
        };
        header.check(path, bytes)?;
        Ok(Self { header, path, format })
    }
}

impl OpenImage for ImageFile<'_> {
    fn attribute(&self, name: &str) -> Option<String> {
        self.format.attribute(name)
    }

    fn floats(&self) -> Result<Vec<f32>> {
        let floats = match self.format.samples(self.path)? {
            Samples::Floats(floats) => floats,
            Samples::Bytes(bytes) => bytes.into_iter().map(|byte| f32::from(byte) * (1.0 / 255.0)).collect(),
        };
        self.complete(floats)
    }

    fn bytes(&self) -> Result<Vec<u8>> {
        let bytes = match self.format.samples(self.path)? {
            Samples::Bytes(bytes) => bytes,
            Samples::Floats(floats) => floats.into_iter().map(byte).collect(),
        };
        self.complete(bytes)
    }
}

impl ImageFile<'_> {
    /// The samples, if they are as many as the header says.
    fn complete<T>(&self, samples: Vec<T>) -> Result<Vec<T>> {
        if samples.len() == self.samples() {
            return Ok(samples);
        }
        Err(Error::io(self.path, format!("there are {} samples, not {}", samples.len(), self.samples())))
    }
}

/// A share of the largest byte.
fn byte(value: f32) -> u8 {
    (value.clamp(0.0, 1.0) * 255.0 + 0.5) as u8
}

/// Writes an image in the format of the path's extension. Of the compressions of exr files there are `zips` and none.
pub fn write(path: &Path, pixels: &Pixels, kind: Kind, compression: Option<&str>) -> Result<()> {
    assert_eq!(pixels.data.len(), pixels.width * pixels.height * pixels.channels.len(), "samples and sizes differ");
    let extension = path.extension().unwrap_or_default().to_string_lossy().to_lowercase();
    if extension == "exr" {
        return exr::write(path, pixels, kind, compression);
    }
    pictures::write(path, pixels, kind, &extension)
}
