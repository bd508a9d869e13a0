//! Outputs of a render besides images and layers: shares of pixels by objects, and single samples.

pub mod mattes;
pub mod samples;
