//! Images denoised by Open Image Denoise.

use super::Image;
use crate::error::{Error, Result};
use crate::ffi::oidn::{self, Device};

/// Fails if Open Image Denoise is not there; the error says how to get it.
pub fn check() -> Result<()> {
    oidn::check().map_err(|what| Error::backend("open image denoise", what))
}

/// Denoises linear radiance with the help of albedo and normal, in about so many bytes of `memory`, which changes no bit. `clean` filters
/// features first, which Open Image Denoise calls accurate prefiltering.
pub fn denoise(color: &Image, [albedo, normal]: [&Image; 2], clean: bool, memory: Option<u64>) -> Result<Image> {
    let size = (color.width, color.height);
    let run = || {
        let device = Device::new(rayon::current_num_threads(), memory)?;
        let color = (c"color", color.data.as_slice());
        let data = if clean {
            let albedo = device.filter(size, &[(c"albedo", &albedo.data)], &[])?;
            let normal = device.filter(size, &[(c"normal", &normal.data)], &[])?;
            device.filter(size, &[color, (c"albedo", &albedo), (c"normal", &normal)], &[c"hdr", c"cleanAux"])?
        } else {
            device.filter(size, &[color, (c"albedo", &albedo.data), (c"normal", &normal.data)], &[c"hdr"])?
        };
        Ok(Image { data, ..Image::new(size.0, size.1, 3) })
    };
    run().map_err(|what: String| Error::backend("open image denoise", what))
}
