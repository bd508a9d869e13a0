//! The shim of OpenImageIO, which the program holds as bytes and loads when the first image is read or written: with OpenImageIO come
//! hundreds of libraries, which commands without images need not wait for.
#![allow(unsafe_code)]

use std::ffi::{CStr, c_char, c_int, c_uint};
use std::fs::File;
use std::io::{self, Write};
use std::os::fd::{AsRawFd, FromRawFd};
use std::path::Path;
use std::sync::OnceLock;

use super::raw::oiio::Shim;
use crate::error::{Error, Result};

/// The library that build.rs has linked.
const BYTES: &[u8] = include_bytes!(concat!(env!("OUT_DIR"), "/fluxion_oiio.so"));

const NAME: &CStr = c"fluxion_oiio.so";

unsafe extern "C" {
    fn memfd_create(name: *const c_char, flags: c_uint) -> c_int;
}

static LOADED: OnceLock<std::result::Result<Shim, String>> = OnceLock::new();

/// Loads the library from memory, where no file system can forbid it.
fn from_memory() -> io::Result<Shim> {
    // SAFETY: the name ends in a zero.
    let descriptor = unsafe { memfd_create(NAME.as_ptr(), 0) };
    if descriptor < 0 {
        return Err(io::Error::last_os_error());
    }
    // SAFETY: the descriptor is a new one, and nobody else's.
    let mut file = unsafe { File::from_raw_fd(descriptor) };
    file.write_all(BYTES)?;
    load(Path::new(&format!("/proc/self/fd/{}", file.as_raw_fd())))
}

/// Loads the library from a temporary file, where there is no `/proc`.
fn from_file() -> io::Result<Shim> {
    let mut file = tempfile::NamedTempFile::new()?;
    file.write_all(BYTES)?;
    load(file.path())
}

fn load(path: &Path) -> io::Result<Shim> {
    // SAFETY: what runs when it is loaded is the start of OpenImageIO, as if it were linked.
    unsafe { Shim::new(path) }.map_err(io::Error::other)
}

fn loaded() -> &'static std::result::Result<Shim, String> {
    let by_file = |first: io::Error| from_file().map_err(|_| first.to_string());
    LOADED.get_or_init(|| from_memory().or_else(by_file))
}

/// Fails if the library cannot be loaded.
pub fn check() -> Result<()> {
    loaded().as_ref().map(|_| ()).map_err(|why| Error::backend("OpenImageIO", format!("cannot be loaded: {why}")))
}

/// The functions of the library, after [`check`] has succeeded.
pub fn shim() -> &'static Shim {
    loaded().as_ref().expect("what is opened was opened by it")
}
