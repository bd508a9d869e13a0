//! Images denoised by Open Image Denoise.

use super::Image;
use crate::error::{Error, Result};
pub use crate::ffi::oidn::Quality;
use crate::ffi::oidn::{self, Device};

/// State of albedo and normal.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Features {
    /// As noisy as they were sampled.
    Noisy,
    /// Noisy, and to be denoised first, each by itself, by networks of this quality.
    Prefiltered(Quality),
}

/// Fails if Open Image Denoise is not there; the error says how to get it.
pub fn check() -> Result<()> {
    oidn::check().map_err(|what| Error::backend("open image denoise", what))
}

/// Denoises linear radiance by networks of some quality, with the help of albedo and normal, in about so many bytes of `memory`,
/// which changes no bit.
pub fn denoise(
    color: &Image,
    [albedo, normal]: [&Image; 2],
    (quality, features): (Quality, Features),
    memory: Option<u64>,
) -> Result<Image> {
    let size = (color.width, color.height);
    let run = || {
        let device = Device::new(rayon::current_num_threads(), memory)?;
        let color = (c"color", color.data.as_slice());
        let data = match features {
            Features::Noisy => {
                let inputs = [color, (c"albedo", &albedo.data), (c"normal", &normal.data)];
                device.filter(size, &inputs, &[c"hdr"], quality)?
            }
            Features::Prefiltered(smaller) => {
                let albedo = device.filter(size, &[(c"albedo", &albedo.data)], &[], smaller)?;
                let normal = device.filter(size, &[(c"normal", &normal.data)], &[], smaller)?;
                let inputs = [color, (c"albedo", &albedo), (c"normal", &normal)];
                device.filter(size, &inputs, &[c"hdr", c"cleanAux"], quality)?
            }
        };
        Ok(Image { data, ..Image::new(size.0, size.1, 3) })
    };
    run().map_err(|what: String| Error::backend("open image denoise", what))
}
