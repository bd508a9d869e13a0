//! OpenImageIO: any image file to floats, and floats to any image file.
#![allow(unsafe_code)]

use std::ffi::{CStr, CString, c_char, c_void};
use std::ops::Deref;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};

use super::raw::oiio as raw;
use super::shim::{self, shim};
use crate::error::{Error, Result};
use crate::pixels::parts::{self, Merged, Part};
use crate::pixels::{DataWindow, Header, Kind, OpenImage, Pixels, Storage, exr_header};
use crate::sync::lock;

/// OpenImageIO's name of a kind of samples.
fn name(kind: Kind) -> &'static CStr {
    match kind {
        Kind::Float => c"float",
        Kind::Half => c"half",
        Kind::Uint8 => c"uint8",
    }
}

/// An image file whose header has been read.
pub struct ImageFile<'a> {
    header: Header,
    path: &'a Path,
    handle: *mut c_void,
    /// Numbers of the parts that are read, with their numbers of channels.
    parts: Vec<(i32, usize)>,
}

impl Deref for ImageFile<'_> {
    type Target = Header;

    fn deref(&self) -> &Header {
        &self.header
    }
}

impl Drop for ImageFile<'_> {
    fn drop(&mut self) {
        // SAFETY: the handle came from fluxion_image_open and is closed once.
        unsafe { shim().fluxion_image_close(self.handle) }
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
    /// Reads the headers of all parts.
    pub fn open(path: &'a Path) -> Result<Self> {
        let bytes = std::fs::metadata(path).map_err(|error| Error::io(path, error))?.len() as usize;
        exr_header::check(path)?;
        let name = path_string(path)?;
        shim::check()?;
        let mut error = raw::FluxionError::default();
        // SAFETY: all pointers are valid for the call.
        let handle = unsafe { shim().fluxion_image_open(name.as_ptr(), &mut error) };
        if handle.is_null() {
            return Err(Error::io(path, message(&error)));
        }
        let mut file = Self { header: Header::default(), path, handle, parts: Vec::new() };
        // SAFETY: the handle is open.
        let count = unsafe { shim().fluxion_image_parts(handle) };
        let parts = (0..count).map(|index| file.part(index)).collect::<Result<Vec<_>>>()?;
        let merged = parts::merge(&parts);
        let Merged { header, parts: positions } =
            merged.ok_or_else(|| Error::io(path, "deep images are not supported"))?;
        file.parts = positions.into_iter().map(|i| (i as i32, parts[i].header.channels.len())).collect();
        file.header = header;
        file.check(path, bytes)?;
        Ok(file)
    }

    /// Goes to a part.
    fn seek(&self, index: i32) -> Result<raw::FluxionImageSpec> {
        let mut spec = raw::FluxionImageSpec::default();
        let mut error = raw::FluxionError::default();
        // SAFETY: the handle is open, and all pointers are valid for the call.
        let found = unsafe { shim().fluxion_image_part(self.handle, index, &mut spec, &mut error) };
        if found { Ok(spec) } else { Err(Error::io(self.path, message(&error))) }
    }

    fn part(&self, index: i32) -> Result<Part> {
        let spec = self.seek(index)?;
        let [width, height] = [spec.width, spec.height].map(|n| usize::try_from(n).unwrap_or(0));
        let unsigned = |n: i32| usize::try_from(n).ok();
        let window = match [spec.x, spec.y, spec.full_width, spec.full_height].map(unsigned) {
            [Some(x), Some(y), Some(w), Some(h)] if w > 0 => Some(DataWindow { origin: (x, y), full: (w, h) }),
            _ => None,
        };
        // SAFETY: the arrays end in a zero, since the other side copies at most all but one of their bytes.
        let [format, name] =
            [spec.format.as_ptr(), spec.part.as_ptr()].map(|text| unsafe { owned(text) }.unwrap_or_default());
        let channels = (0..spec.channels)
            // SAFETY: the handle is open; the string lives as long.
            .map(|channel| unsafe { owned(shim().fluxion_image_channel(self.handle, channel)) }.unwrap_or_default())
            .collect();
        let storage = (0..spec.channels).map(|channel| self.storage_of(channel)).collect();
        let header =
            Header { width, height, origin: (spec.x, spec.y), window, format, channels, storage, ..Header::default() };
        Ok(Part { name, header, deep: spec.deep })
    }

    /// The samples of all parts; `read` fills those of the one that it is about.
    fn samples_of_parts<T: Copy + Default>(
        &self,
        read: impl Fn(*mut c_void, &mut [T], &mut raw::FluxionError) -> bool,
    ) -> Result<Vec<T>> {
        let of_part = |index: i32, count: usize| {
            self.seek(index)?;
            let mut data = vec![T::default(); self.width * self.height * count];
            let mut error = raw::FluxionError::default();
            if read(self.handle, &mut data, &mut error) { Ok(data) } else { Err(Error::io(self.path, message(&error))) }
        };
        if let [(index, count)] = *self.parts {
            return of_part(index, count);
        }
        let (mut all, mut first) = (vec![T::default(); self.samples()], 0);
        for &(index, count) in &self.parts {
            parts::interleave(&mut all, (self.channels.len(), first), &of_part(index, count)?, count);
            first += count;
        }
        Ok(all)
    }

    fn storage_of(&self, index: i32) -> Storage {
        use raw::FluxionSampleType as Type;
        // SAFETY: the handle is open, and the index is that of a channel.
        match unsafe { shim().fluxion_image_channel_type(self.handle, index) } {
            Type::FLUXION_FLOAT => Storage::Float,
            Type::FLUXION_UINT8 => Storage::Unsigned(8),
            Type::FLUXION_UINT16 => Storage::Unsigned(16),
            Type::FLUXION_UINT32 => Storage::Unsigned(32),
            Type::FLUXION_OTHER => Storage::Other,
        }
    }
}

impl OpenImage for ImageFile<'_> {
    fn attribute(&self, name: &str) -> Option<String> {
        let name = CString::new(name).ok()?;
        self.parts.iter().find_map(|&(index, _)| {
            self.seek(index).ok()?;
            // SAFETY: the handle is open; the string is copied before the next call.
            unsafe { owned(shim().fluxion_image_attribute(self.handle, name.as_ptr())) }
        })
    }

    fn floats(&self) -> Result<Vec<f32>> {
        // SAFETY: there is room for width * height * channels floats.
        self.samples_of_parts(|handle, data, error| unsafe {
            shim().fluxion_image_read_floats(handle, data.as_mut_ptr(), error)
        })
    }

    fn bytes(&self) -> Result<Vec<u8>> {
        // SAFETY: there is room for width * height * channels bytes.
        self.samples_of_parts(|handle, data, error| unsafe {
            shim().fluxion_image_read_bytes(handle, data.as_mut_ptr(), error)
        })
    }
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
        unsafe { shim().fluxion_texture_system_release(self.0) }
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
    lock(&FAILED).clone()
}

// SAFETY: as for the system that owns the texture.
unsafe impl Send for CachedTexture {}
// SAFETY: as above.
unsafe impl Sync for CachedTexture {}

impl TextureSystem {
    /// A system that keeps at most so many megabytes of tiles in memory.
    pub fn new(megabytes: u32) -> Option<Arc<Self>> {
        shim::check().ok()?;
        // SAFETY: takes no pointer.
        let raw = unsafe { shim().fluxion_texture_system_new(i32::try_from(megabytes).unwrap_or(i32::MAX)) };
        (!raw.is_null()).then(|| Arc::new(Self(raw)))
    }
}

impl CachedTexture {
    /// Opens a file.
    pub fn open(system: &Arc<TextureSystem>, path: &Path) -> Result<Self> {
        exr_header::check(path)?;
        let name = path_string(path)?;
        let mut error = raw::FluxionError::default();
        // SAFETY: all pointers are valid for the call.
        let texture = unsafe { shim().fluxion_texture_open(system.0, name.as_ptr(), &mut error) };
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
        if !unsafe { shim().fluxion_texture_texel(self.system.0, self.texture, x, y, count, samples.as_mut_ptr()) } {
            samples.fill(0.0);
            let mut failed = lock(&FAILED);
            failed.get_or_insert_with(|| (self.path.clone(), 0)).1 += 1;
        }
    }
}

/// Writes an image in the format of the path's extension.
pub fn write(path: &Path, pixels: &Pixels, kind: Kind, compression: Option<&str>) -> Result<()> {
    assert_eq!(pixels.data.len(), pixels.width * pixels.height * pixels.channels.len(), "samples and sizes differ");
    shim::check()?;
    let c_string = |text: &str| CString::new(text).map_err(|_| Error::io(path, "a name holds a NUL byte"));
    let file_name = path_string(path)?;
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
        shim().fluxion_image_write(
            file_name.as_ptr(),
            &spec,
            channels.as_ptr(),
            pixels.data.as_ptr(),
            name(kind).as_ptr(),
            compression.as_ref().map_or(std::ptr::null(), |text| text.as_ptr()),
            attributes.as_ptr(),
            attributes.len(),
            &mut error,
        )
    };
    if written { Ok(()) } else { Err(Error::io(path, message(&error))) }
}
