//! Safe wrappers around the C libraries: the only unsafe code of the crate.

pub mod embree;
pub mod memory;
pub mod oidn;
#[cfg(feature = "openimageio")]
pub mod oiio;
#[cfg(feature = "openimageio")]
mod shim;
#[macro_use]
pub mod vectors;

/// The declarations that bindgen makes from the headers under `ffi/`.
#[allow(
    unsafe_code,
    dead_code,
    unsafe_op_in_unsafe_fn,
    missing_docs,
    non_camel_case_types,
    non_upper_case_globals,
    non_snake_case,
    clippy::all
)]
mod raw {
    pub mod embree {
        include!(concat!(env!("OUT_DIR"), "/embree.rs"));
    }
    #[cfg(feature = "openimageio")]
    pub mod oiio {
        include!(concat!(env!("OUT_DIR"), "/oiio.rs"));
    }
}
