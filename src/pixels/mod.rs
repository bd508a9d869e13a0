//! Pixels as image files hold them, and what their headers say: the same for every library that reads and writes them.

pub mod exr_header;
pub mod parts;

use std::ops::Deref;
use std::path::Path;

use crate::error::{Error, Result};

/// How samples are stored in a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// 32-bit float.
    Float,
    /// 16-bit float.
    Half,
    /// Eight bits, already display-encoded.
    Uint8,
}

/// How the samples of a channel are stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Storage {
    /// Floats of any size.
    Float,
    /// Integers of a number of bits, read as shares of the largest.
    Unsigned(u32),
    /// Signed integers and other types that pictures rarely have.
    Other,
}

/// Position of an image in a larger picture, of which it is a part.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct DataWindow {
    /// Column and row of its first pixel.
    pub origin: (usize, usize),
    /// Width and height of the whole picture.
    pub full: (usize, usize),
}

/// Pixels as files hold them: rows from the top, channels interleaved in the order of `channels`.
#[derive(Clone, Debug, Default)]
pub struct Pixels {
    /// Pixels in a row.
    pub width: usize,
    /// Number of rows.
    pub height: usize,
    /// Channel names. Readers must go by name: EXR files sort their channels.
    pub channels: Vec<String>,
    /// `width * height * channels.len()` samples.
    pub data: Vec<f32>,
    /// The larger picture that the pixels are a part of, if they are. Only exr files keep it.
    pub window: Option<DataWindow>,
    /// Named strings of the file's header that were asked for, or that are to be written.
    pub attributes: Vec<(String, String)>,
}

/// Header of an image file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Header {
    /// Pixels in a row.
    pub width: usize,
    /// Number of rows.
    pub height: usize,
    /// Index of the first pixel in the file.
    pub origin: (i32, i32),
    /// Channel names, in the order of the file.
    pub channels: Vec<String>,
    /// How each channel is stored.
    pub storage: Vec<Storage>,
    /// The larger picture that it is a part of, if it is.
    pub window: Option<DataWindow>,
    /// OpenImageIO's name of the format, as in `openexr`.
    pub format: String,
    /// Number of the file's parts.
    pub parts: usize,
}

/// An image file whose header has been read.
pub trait OpenImage: Deref<Target = Header> {
    /// A named string of the header.
    fn attribute(&self, name: &str) -> Option<String>;

    /// All samples as floats, channels interleaved.
    fn floats(&self) -> Result<Vec<f32>>;

    /// All samples in eight bits, channels interleaved.
    fn bytes(&self) -> Result<Vec<u8>>;

    /// All pixels, and those of `attributes` that the header has.
    fn pixels(&self, attributes: &[&str]) -> Result<Pixels> {
        let Header { width, height, channels, window, .. } = Header::clone(self);
        let attributes = attributes.iter().filter_map(|&name| Some((name.to_owned(), self.attribute(name)?))).collect();
        Ok(Pixels { width, height, channels, data: self.floats()?, window, attributes })
    }
}

/// More samples than this in one file are taken for a damaged or hostile header.
const MAX_SAMPLES: usize = 1 << 32;
/// More samples than this for every byte of the file are taken for a damaged header, too: no compression packs real
/// pictures like that.
const MAX_SAMPLES_PER_BYTE: usize = 1 << 11;

/// Rows that some of OpenEXR's compressions work on at once, and the number of samples in them that is accepted without a check.
const ROWS_AT_ONCE: usize = 256;
const ROOM: usize = 1 << 27;

impl Header {
    /// Samples of all pixels.
    pub fn samples(&self) -> usize {
        let pixels = self.width.checked_mul(self.height);
        pixels.and_then(|pixels| pixels.checked_mul(self.channels.len())).unwrap_or(usize::MAX)
    }

    /// Whether every sample is stored in eight bits.
    pub fn is_eight_bit(&self) -> bool {
        self.storage.iter().all(|storage| *storage == Storage::Unsigned(8))
    }

    /// Fails if a file of this number of bytes cannot hold what its header claims.
    pub fn check(&self, path: &Path, bytes: usize) -> Result<()> {
        let (width, height, samples) = (self.width, self.height, self.samples());
        if samples == 0 || samples > MAX_SAMPLES.min(bytes.saturating_mul(MAX_SAMPLES_PER_BYTE)) {
            let what = format!("the header claims {width}x{height} pixels of {} channels", self.channels.len());
            return Err(Error::io(path, what));
        }
        // OpenEXR makes room for many rows, however few there are.
        let room = ROWS_AT_ONCE.saturating_mul(samples / height);
        if self.format == "openexr" && room > ROOM.max(4 * samples) {
            let what = format!("the header claims rows of {width} pixels, but {height} of them");
            return Err(Error::io(path, what));
        }
        Ok(())
    }
}
