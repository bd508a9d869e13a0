//! Fluxion: gradient-domain path tracing and image reconstruction.
//!
//! ```text
//! scene -> render (waves of tiles) -> Film --develop--> Frame -> reconstruct -> Solution -> metrics
//! ```

pub mod error;
pub mod ffi;
pub mod film;
pub mod image;
pub mod math;
pub mod metrics;
pub mod plan;
pub mod reconstruct;
pub mod render;
pub mod scene;
pub mod solve;
pub mod validate;
