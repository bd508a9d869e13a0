//! Images denoised by Open Image Denoise.

use crate::error::{Error, Result};
pub use crate::ffi::oidn::Quality;
use crate::ffi::oidn::{self, Device};
use crate::image::Image;

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

/// Denoises linear radiance by networks of some quality, with the help of albedo and normal if there are any, and of the latter
/// beside the former only; in about so many bytes of `memory`, which changes no bit.
pub fn denoise(
    color: &Image,
    [albedo, normal]: [Option<&Image>; 2],
    (quality, features): (Quality, Features),
    memory: Option<u64>,
) -> Result<Image> {
    let images = albedo.iter().map(|image| (c"albedo", &image.data));
    let images: Vec<_> = images.chain(albedo.and(normal).map(|image| (c"normal", &image.data))).collect();
    let size = (color.width, color.height);
    let run = || {
        let device = Device::new(rayon::current_num_threads(), memory)?;
        let color = (c"color", color.data.as_slice());
        let cleaned: Vec<_> = match features {
            Features::Noisy => Vec::new(),
            Features::Prefiltered(smaller) => images
                .iter()
                .map(|&(name, data)| Ok((name, device.filter(size, &[(name, data)], &[], smaller)?)))
                .collect::<Result<_, String>>()?,
        };
        let (cleaned, flags): (Vec<_>, &[_]) = match cleaned.as_slice() {
            [] => (images.iter().map(|&(name, data)| (name, data.as_slice())).collect(), &[c"hdr"]),
            cleaned => (cleaned.iter().map(|(name, data)| (*name, data.as_slice())).collect(), &[c"hdr", c"cleanAux"]),
        };
        let inputs: Vec<_> = std::iter::once(color).chain(cleaned).collect();
        let data = device.filter(size, &inputs, flags, quality)?;
        Ok(Image { data, ..Image::new(size.0, size.1, 3) })
    };
    run().map_err(|what: String| Error::backend("open image denoise", what))
}
