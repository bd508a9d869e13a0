//! OpenImageIO: any image file to floats, and floats to any image file.
#![allow(unsafe_code)]

use std::ffi::{CStr, CString, c_char, c_void};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};

use super::exr_header;
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

/// How the samples of a channel are stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Storage {
    /// Floats of any size.
    Float,
    /// Integers of so many bits, read as shares of the largest.
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

/// More samples than this in one file are taken for a damaged or hostile header.
const MAX_SAMPLES: usize = 1 << 32;
/// More samples than this for every byte of the file are taken for a damaged header, too: no compression packs real
/// pictures like that.
const MAX_SAMPLES_PER_BYTE: usize = 1 << 11;

/// Rows that some of OpenEXR's compressions work on at once, and the samples in them that are no reason for doubt.
const ROWS_AT_ONCE: usize = 256;
const ROOM: usize = 1 << 27;

/// An image file whose header has been read.
pub struct ImageFile<'a> {
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
    path: &'a Path,
    handle: *mut c_void,
}

impl Drop for ImageFile<'_> {
    fn drop(&mut self) {
        // SAFETY: the handle came from fluxion_image_open and is closed once.
        unsafe { raw::fluxion_image_close(self.handle) }
    }
}

fn check_header(path: &Path) -> Result<()> {
    match exr_header::validate(path) {
        Ok(None) => Ok(()),
        Ok(Some(what)) => Err(Error::io(path, what)),
        Err(error) => Err(Error::io(path, error)),
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

impl<'a> ImageFile<'a> {
    /// Reads the header.
    pub fn open(path: &'a Path) -> Result<Self> {
        let bytes = std::fs::metadata(path).map_err(|error| Error::io(path, error))?.len() as usize;
        check_header(path)?;
        let name = path_string(path)?;
        let mut spec = raw::FluxionImageSpec::default();
        let mut error = raw::FluxionError::default();
        // SAFETY: all pointers are valid for the call.
        let handle = unsafe { raw::fluxion_image_open(name.as_ptr(), &mut spec, &mut error) };
        if handle.is_null() {
            return Err(Error::io(path, message(&error)));
        }
        let [width, height] = [spec.width, spec.height].map(|n| usize::try_from(n).unwrap_or(0));
        let unsigned = |n: i32| usize::try_from(n).ok();
        let window = [spec.x, spec.y, spec.full_width, spec.full_height].map(unsigned);
        let window = match window {
            [Some(x), Some(y), Some(w), Some(h)] if w > 0 => Some(DataWindow { origin: (x, y), full: (w, h) }),
            _ => None,
        };
        // SAFETY: the array ends in a zero, since the other side copies at most all but one of its bytes.
        let format = unsafe { owned(spec.format.as_ptr()) }.unwrap_or_default();
        let (origin, channels, storage) = ((spec.x, spec.y), Vec::new(), Vec::new());
        let mut file = Self { width, height, origin, channels, storage, window, format, path, handle };
        file.channels = (0..spec.channels)
            // SAFETY: the handle is open; the string lives as long.
            .map(|index| unsafe { owned(raw::fluxion_image_channel(handle, index)) }.unwrap_or_default())
            .collect();
        file.storage = (0..spec.channels).map(|index| file.storage_of(index)).collect();
        let samples = file.samples();
        if samples == 0 || samples > MAX_SAMPLES.min(bytes.saturating_mul(MAX_SAMPLES_PER_BYTE)) {
            let what = format!("the header claims {width}x{height} pixels of {} channels", spec.channels);
            return Err(Error::io(path, what));
        }
        // OpenEXR makes room for many rows, however few there are.
        let room = ROWS_AT_ONCE.saturating_mul(samples / height);
        if file.format == "openexr" && room > ROOM.max(4 * samples) {
            let what = format!("the header claims rows of {width} pixels, but {height} of them");
            return Err(Error::io(path, what));
        }
        Ok(file)
    }

    fn storage_of(&self, index: i32) -> Storage {
        use raw::FluxionSampleType as Type;
        // SAFETY: the handle is open, and the index is that of a channel.
        match unsafe { raw::fluxion_image_channel_type(self.handle, index) } {
            Type::FLUXION_FLOAT => Storage::Float,
            Type::FLUXION_UINT8 => Storage::Unsigned(8),
            Type::FLUXION_UINT16 => Storage::Unsigned(16),
            Type::FLUXION_UINT32 => Storage::Unsigned(32),
            Type::FLUXION_OTHER => Storage::Other,
        }
    }

    /// Whether every sample is stored in eight bits.
    pub fn is_eight_bit(&self) -> bool {
        self.storage.iter().all(|storage| *storage == Storage::Unsigned(8))
    }

    /// Samples of all pixels.
    fn samples(&self) -> usize {
        let pixels = self.width.checked_mul(self.height);
        pixels.and_then(|pixels| pixels.checked_mul(self.channels.len())).unwrap_or(usize::MAX)
    }

    /// A named string of the header.
    pub fn attribute(&self, name: &str) -> Option<String> {
        let name = CString::new(name).ok()?;
        // SAFETY: the handle is open; the string is copied before the next call.
        unsafe { owned(raw::fluxion_image_attribute(self.handle, name.as_ptr())) }
    }

    /// All samples as floats, channels interleaved.
    pub fn floats(&self) -> Result<Vec<f32>> {
        let mut data = vec![0.0; self.samples()];
        let mut error = raw::FluxionError::default();
        // SAFETY: `data` has room for width * height * channels floats.
        let read = unsafe { raw::fluxion_image_read_floats(self.handle, data.as_mut_ptr(), &mut error) };
        if read { Ok(data) } else { Err(Error::io(self.path, message(&error))) }
    }

    /// All samples in eight bits, channels interleaved.
    pub fn bytes(&self) -> Result<Vec<u8>> {
        let mut data = vec![0; self.samples()];
        let mut error = raw::FluxionError::default();
        // SAFETY: `data` has room for width * height * channels bytes.
        let read = unsafe { raw::fluxion_image_read_bytes(self.handle, data.as_mut_ptr(), &mut error) };
        if read { Ok(data) } else { Err(Error::io(self.path, message(&error))) }
    }
}

/// Reads a whole image, and those of `attributes` that its header has.
pub fn read(path: &Path, attributes: &[&str]) -> Result<Pixels> {
    let file = ImageFile::open(path)?;
    let attributes = attributes.iter().filter_map(|&name| Some((name.to_owned(), file.attribute(name)?))).collect();
    let (width, height, channels, window) = (file.width, file.height, file.channels.clone(), file.window);
    Ok(Pixels { width, height, channels, data: file.floats()?, window, attributes })
}

/// A cache of image files that are too large to be held at once.
pub struct TextureSystem(*mut c_void);

// SAFETY: OpenImageIO's texture systems are made to be shared by threads.
unsafe impl Send for TextureSystem {}
// SAFETY: as above.
unsafe impl Sync for TextureSystem {}

impl Drop for TextureSystem {
    fn drop(&mut self) {
        // SAFETY: the system came from fluxion_texture_system_new and is released once, after its textures.
        unsafe { raw::fluxion_texture_system_release(self.0) }
    }
}

/// A file in a texture system.
pub struct CachedTexture {
    system: Arc<TextureSystem>,
    texture: *mut c_void,
    path: PathBuf,
}

/// The first file whose texels could not be read, and how many there were in all.
static FAILED: Mutex<Option<(PathBuf, u64)>> = Mutex::new(None);

/// Lookups since the program started that found no texel since their file was gone or damaged, and the first such file.
pub fn failed_lookups() -> Option<(PathBuf, u64)> {
    FAILED.lock().unwrap_or_else(|poisoned| poisoned.into_inner()).clone()
}

// SAFETY: as for the system that owns the texture.
unsafe impl Send for CachedTexture {}
// SAFETY: as above.
unsafe impl Sync for CachedTexture {}

impl TextureSystem {
    /// A system that keeps at most so many megabytes of tiles in memory.
    pub fn new(megabytes: u32) -> Option<Arc<Self>> {
        // SAFETY: takes no pointer.
        let raw = unsafe { raw::fluxion_texture_system_new(i32::try_from(megabytes).unwrap_or(i32::MAX)) };
        (!raw.is_null()).then(|| Arc::new(Self(raw)))
    }
}

impl CachedTexture {
    /// Opens a file.
    pub fn open(system: &Arc<TextureSystem>, path: &Path) -> Result<Self> {
        check_header(path)?;
        let name = path_string(path)?;
        let mut error = raw::FluxionError::default();
        // SAFETY: all pointers are valid for the call.
        let texture = unsafe { raw::fluxion_texture_open(system.0, name.as_ptr(), &mut error) };
        if texture.is_null() {
            return Err(Error::io(path, message(&error)));
        }
        Ok(Self { system: Arc::clone(system), texture, path: path.to_path_buf() })
    }

    /// The first samples of a pixel by its place in the file; zero where the file can no longer be read, which
    /// [`failed_lookups`] counts.
    pub fn texel(&self, x: i32, y: i32, samples: &mut [f32]) {
        let count = samples.len() as i32;
        // SAFETY: the system is alive, the texture is one of its own, and `samples` has room for `count` floats.
        if !unsafe { raw::fluxion_texture_texel(self.system.0, self.texture, x, y, count, samples.as_mut_ptr()) } {
            samples.fill(0.0);
            let mut failed = FAILED.lock().unwrap_or_else(|poisoned| poisoned.into_inner());
            failed.get_or_insert_with(|| (self.path.clone(), 0)).1 += 1;
        }
    }
}

/// Writes an image in the format of the path's extension.
pub fn write(path: &Path, pixels: &Pixels, kind: Kind, compression: Option<&str>) -> Result<()> {
    assert_eq!(pixels.data.len(), pixels.width * pixels.height * pixels.channels.len(), "samples and sizes differ");
    let c_string = |text: &str| CString::new(text).map_err(|_| Error::io(path, "a name holds a NUL byte"));
    let name = path_string(path)?;
    let size = |n: usize| i32::try_from(n).map_err(|_| Error::io(path, "the image is too large for any format"));
    let DataWindow { origin, full } = pixels.window.unwrap_or_default();
    let spec = raw::FluxionImageSpec {
        width: size(pixels.width)?,
        height: size(pixels.height)?,
        channels: size(pixels.channels.len())?,
        x: size(origin.0)?,
        y: size(origin.1)?,
        full_width: size(full.0)?,
        full_height: size(full.1)?,
        ..raw::FluxionImageSpec::default()
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
        let window = DataWindow { origin: (5, 6), full: (10, 9) };
        let pixels = Pixels { width: 3, height: 2, channels, data, attributes, window: Some(window) };
        write(file.path(), &pixels, Kind::Float, Some("zips")).unwrap();
        let back = read(file.path(), &["fluxion:seed", "absent"]).unwrap();
        assert_eq!(back.attributes, pixels.attributes);
        assert_eq!(back.window, Some(window));
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
        let pixels = Pixels { width: 1, height: 1, channels, data, window: None, attributes: vec![] };
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
