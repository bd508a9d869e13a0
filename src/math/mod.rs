//! Vectors, frames, random numbers and the small pieces of sampling everything else is made of.

pub mod alias;
pub mod frame;
pub mod fresnel;
pub mod half;
pub mod lanes;
pub mod partition;
pub mod quadrature;
pub mod rng;
pub mod warp;

pub use frame::Frame;
pub use glam::{Mat4, Vec2, Vec3, Vec4, vec2, vec3};

/// Linear RGB: radiance, reflectance or throughput, by context.
pub type Rgb = Vec3;

/// Shares of the channels in [`luminance`].
pub fn luminance_weights() -> Rgb {
    vec3(0.212_671, 0.715_160, 0.072_169)
}

/// Rec. 709 luminance of linear RGB.
pub fn luminance(color: Rgb) -> f32 {
    color.dot(luminance_weights())
}

/// The sRGB transfer function: linear in, display-encoded out, both nominally in [0, 1].
pub fn srgb_encode(linear: f32) -> f32 {
    if linear <= 0.003_130_8 { 12.92 * linear } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 }
}

/// The inverse of [`srgb_encode`].
pub fn srgb_decode(encoded: f32) -> f32 {
    if encoded <= 0.040_45 { encoded / 12.92 } else { ((encoded + 0.055) / 1.055).powf(2.4) }
}
