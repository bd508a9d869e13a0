//! The shim of OpenImageIO, which the program holds as bytes and loads when the first image is read or written: with OpenImageIO come
//! hundreds of libraries, which commands without images need not wait for.
#![allow(unsafe_code)]

use std::ffi::{CStr, c_char, c_int, c_uint};
use std::fs::File;
use std::io::{self, Write};
use std::os::fd::{AsRawFd, FromRawFd};
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
fn load() -> io::Result<Shim> {
    // SAFETY: the name ends in a zero.
    let descriptor = unsafe { memfd_create(NAME.as_ptr(), 0) };
    if descriptor < 0 {
        return Err(io::Error::last_os_error());
    }
    // SAFETY: the descriptor is a new one, and nobody else's.
    let mut file = unsafe { File::from_raw_fd(descriptor) };
    file.write_all(BYTES)?;
    let path = format!("/proc/self/fd/{}", file.as_raw_fd());
    // SAFETY: what runs when it is loaded is the start of OpenImageIO, as if it were linked.
    unsafe { Shim::new(path) }.map_err(io::Error::other)
}

fn loaded() -> &'static std::result::Result<Shim, String> {
    LOADED.get_or_init(|| load().map_err(|error| error.to_string()))
}

/// Fails if the library cannot be loaded.
pub fn check() -> Result<()> {
    loaded().as_ref().map(|_| ()).map_err(|why| Error::backend("OpenImageIO", format!("cannot be loaded: {why}")))
}

/// The functions of the library, after [`check`] has succeeded.
pub fn shim() -> &'static Shim {
    loaded().as_ref().expect("what is opened was opened by it")
}
