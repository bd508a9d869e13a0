//! OpenImageIO: any image file to floats, and floats to any image file.
#![allow(unsafe_code)]

use std::ffi::{CStr, CString, c_char, c_void};
use std::path::Path;

use super::raw::oiio as raw;
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

impl Kind {
    fn name(self) -> &'static CStr {
        match self {
            Self::Float => c"float",
            Self::Half => c"half",
            Self::Uint8 => c"uint8",
        }
    }
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
    /// Whether the file holds eight bits a sample; `data` is then a multiple of 1/255.
    pub eight_bit: bool,
    /// Named strings of the file's header that were asked for, or that are to be written.
    pub attributes: Vec<(String, String)>,
}

/// More samples than this in one file are taken for a damaged or hostile header.
const MAX_SAMPLES: usize = 1 << 32;
/// So are more than this for every byte of the file: no compression packs real pictures like that.
const MAX_SAMPLES_PER_BYTE: usize = 1 << 11;

struct Open(*mut c_void);

impl Drop for Open {
    fn drop(&mut self) {
        // SAFETY: the handle came from fluxion_image_open and is closed once.
        unsafe { raw::fluxion_image_close(self.0) }
    }
}

fn path_string(path: &Path) -> Result<CString> {
    CString::new(path.as_os_str().as_encoded_bytes()).map_err(|_| Error::io(path, "the name holds a NUL byte"))
}

fn message(error: &raw::FluxionError) -> String {
    // SAFETY: the shim always terminates the message; a fresh one is all zero.
    let text = unsafe { CStr::from_ptr(error.message.as_ptr()) };
    text.to_string_lossy().trim().replace('\n', "; ")
}

/// SAFETY: `text` is null or a NUL-terminated string that lives through the call.
unsafe fn owned(text: *const c_char) -> Option<String> {
    // SAFETY: by the caller's promise.
    (!text.is_null()).then(|| unsafe { CStr::from_ptr(text) }.to_string_lossy().into_owned())
}

/// Reads a whole image, and those of `attributes` that its header has.
pub fn read(path: &Path, attributes: &[&str]) -> Result<Pixels> {
    let bytes = std::fs::metadata(path).map_err(|error| Error::io(path, error))?.len() as usize;
    let name = path_string(path)?;
    let mut spec = raw::FluxionImageSpec::default();
    let mut error = raw::FluxionError::default();
    // SAFETY: all pointers are valid for the call.
    let handle = unsafe { raw::fluxion_image_open(name.as_ptr(), &mut spec, &mut error) };
    if handle.is_null() {
        return Err(Error::io(path, message(&error)));
    }
    let open = Open(handle);
    let [width, height, count] = [spec.width, spec.height, spec.channels].map(|n| usize::try_from(n).unwrap_or(0));
    let samples = width.checked_mul(height).and_then(|pixels| pixels.checked_mul(count)).unwrap_or(usize::MAX);
    if samples == 0 || samples > MAX_SAMPLES.min(bytes.saturating_mul(MAX_SAMPLES_PER_BYTE)) {
        return Err(Error::io(path, format!("the header claims {width}x{height} pixels of {count} channels")));
    }
    let channels = (0..spec.channels)
        // SAFETY: the handle is open; the string lives as long.
        .map(|index| unsafe { owned(raw::fluxion_image_channel(open.0, index)) }.unwrap_or_default())
        .collect();
    let found = attributes.iter().filter_map(|&name| {
        let c_name = CString::new(name).ok()?;
        // SAFETY: the handle is open; the string is copied before the next call.
        let value = unsafe { owned(raw::fluxion_image_attribute(open.0, c_name.as_ptr())) }?;
        Some((name.to_owned(), value))
    });
    let attributes = found.collect();
    let mut data = vec![0.0; samples];
    // SAFETY: `data` has room for width * height * channels floats.
    if !unsafe { raw::fluxion_image_read(open.0, data.as_mut_ptr(), &mut error) } {
        return Err(Error::io(path, message(&error)));
    }
    Ok(Pixels { width, height, channels, data, eight_bit: spec.eight_bit, attributes })
}

/// Writes an image in the format of the path's extension.
pub fn write(path: &Path, pixels: &Pixels, kind: Kind, compression: Option<&str>) -> Result<()> {
    assert_eq!(pixels.data.len(), pixels.width * pixels.height * pixels.channels.len(), "samples and sizes differ");
    let c_string = |text: &str| CString::new(text).map_err(|_| Error::io(path, "a name holds a NUL byte"));
    let name = path_string(path)?;
    let size = |n: usize| i32::try_from(n).map_err(|_| Error::io(path, "the image is too large for any format"));
    let spec = raw::FluxionImageSpec {
        width: size(pixels.width)?,
        height: size(pixels.height)?,
        channels: size(pixels.channels.len())?,
        eight_bit: kind == Kind::Uint8,
    };
    let channels = pixels.channels.iter().map(|channel| c_string(channel)).collect::<Result<Vec<_>>>()?;
    let channels: Vec<_> = channels.iter().map(|channel| channel.as_ptr()).collect();
    let pairs = pixels.attributes.iter().map(|(name, value)| Ok((c_string(name)?, c_string(value)?)));
    let pairs = pairs.collect::<Result<Vec<_>>>()?;
    let attributes: Vec<_> =
        pairs.iter().map(|(n, v)| raw::FluxionAttribute { name: n.as_ptr(), value: v.as_ptr() }).collect();
    let compression = compression.map(c_string).transpose()?;
    let mut error = raw::FluxionError::default();
    // SAFETY: every pointer outlives the call, and the sizes are those of the buffers behind them.
    let written = unsafe {
        raw::fluxion_image_write(
            name.as_ptr(),
            &spec,
            channels.as_ptr(),
            pixels.data.as_ptr(),
            kind.name().as_ptr(),
            compression.as_ref().map_or(std::ptr::null(), |text| text.as_ptr()),
            attributes.as_ptr(),
            attributes.len(),
            &mut error,
        )
    };
    if written { Ok(()) } else { Err(Error::io(path, message(&error))) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exr_keeps_every_bit_name_and_attribute() {
        let file = tempfile::Builder::new().suffix(".exr").tempfile().unwrap();
        let channels = ["R", "G", "B", "depth.Z"].map(String::from).to_vec();
        let data: Vec<f32> = (0..3 * 2 * 4).map(|i| (i as f32).exp() * 1e-3).collect();
        let attributes = vec![("fluxion:seed".to_owned(), "7".to_owned())];
        let pixels = Pixels { width: 3, height: 2, channels, data, eight_bit: false, attributes };
        write(file.path(), &pixels, Kind::Float, Some("zips")).unwrap();
        let back = read(file.path(), &["fluxion:seed", "absent"]).unwrap();
        assert_eq!(back.attributes, pixels.attributes);
        for (index, name) in pixels.channels.iter().enumerate() {
            let at = back.channels.iter().position(|other| other == name).unwrap();
            for pixel in 0..6 {
                assert_eq!(back.data[pixel * 4 + at].to_bits(), pixels.data[pixel * 4 + index].to_bits());
            }
        }
    }

    #[test]
    fn alpha_does_not_darken_colours() {
        let file = tempfile::Builder::new().suffix(".png").tempfile().unwrap();
        let channels = ["R", "G", "B", "A"].map(String::from).to_vec();
        let data = vec![1.0, 0.4, 0.2, 0.0];
        let pixels = Pixels { width: 1, height: 1, channels, data, eight_bit: true, attributes: vec![] };
        write(file.path(), &pixels, Kind::Uint8, None).unwrap();
        let back = read(file.path(), &[]).unwrap();
        back.data.iter().zip(&pixels.data).for_each(|(a, b)| assert!((a - b).abs() < 1e-3, "{a} {b}"));
    }

    #[test]
    fn missing_truncated_and_unwritable_files_are_errors_with_the_name() {
        let missing = read(Path::new("/no/such.exr"), &[]).unwrap_err().to_string();
        assert!(missing.starts_with("/no/such.exr: "), "{missing}");
        let file = tempfile::Builder::new().suffix(".exr").tempfile().unwrap();
        std::fs::write(file.path(), b"v/1\x01nothing more").unwrap();
        let truncated = read(file.path(), &[]).unwrap_err().to_string();
        assert!(truncated.len() > file.path().display().to_string().len() + 5, "{truncated}");
        let pixels = Pixels { width: 1, height: 1, channels: vec!["R".into()], data: vec![1.0], ..Default::default() };
        assert!(write(Path::new("/no/such/folder/a.exr"), &pixels, Kind::Float, None).is_err());
        assert!(write(Path::new("a.nosuchformat"), &pixels, Kind::Float, None).is_err());
    }
}
