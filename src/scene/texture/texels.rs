//! Image files as texels: in memory while there is room, otherwise through a cache of tiles.

use std::path::Path;
use std::sync::{Arc, OnceLock};

use crate::error::Result;
use crate::image::io::{self, CachedTexture, ImageFile, TextureSystem};
use crate::math::{Rgb, srgb_decode, vec3};

/// An image as it is stored: three channels, alpha dropped, grey spread over all three.
pub struct Texels {
    /// Pixels in a row.
    pub width: usize,
    /// Number of rows.
    pub height: usize,
    samples: Samples,
}

enum Samples {
    Byte(Vec<[u8; 3]>),
    Float(Vec<Rgb>),
    /// Beyond the memory bound.
    Cached {
        texture: CachedTexture,
        origin: (i32, i32),
        order: [usize; 3],
        eight_bit: bool,
    },
}

/// Memory for texels, and the cache of images that do not fit.
pub struct Memory {
    left: u64,
    system: Option<Arc<TextureSystem>>,
}

/// Megabytes of tiles that are kept of images beyond the bound.
const CACHE: u32 = 256;
/// Channels of a cached file that are looked at.
const MAX_CHANNELS: usize = 8;

impl Memory {
    /// Memory for so many bytes.
    pub fn new(bytes: u64) -> Self {
        Self { left: bytes, system: None }
    }

    fn system(&mut self) -> Option<Arc<TextureSystem>> {
        if self.system.is_none() {
            self.system = TextureSystem::new(CACHE);
        }
        self.system.clone()
    }
}

impl Texels {
    /// Reads an image file, or only its header when there is no room for the rest.
    pub fn read(path: &Path, memory: &mut Memory) -> Result<Self> {
        let file = ImageFile::open(path)?;
        let (width, height, eight_bit) = (file.width, file.height, file.eight_bit);
        let order = io::rgb_channels(path, &file.channels, 2)?;
        let size = (width * height * if eight_bit { 3 } else { 12 }) as u64;
        if size > memory.left && order.iter().all(|&channel| channel < MAX_CHANNELS) {
            if let Some(system) = memory.system() {
                let texture = CachedTexture::open(&system, path)?;
                let samples = Samples::Cached { texture, origin: file.origin, order, eight_bit };
                return Ok(Self { width, height, samples });
            }
        }
        memory.left = memory.left.saturating_sub(size);
        let count = file.channels.len();
        let samples = if eight_bit {
            let bytes = file.bytes()?;
            Samples::Byte(bytes.chunks_exact(count).map(|pixel| order.map(|channel| pixel[channel])).collect())
        } else {
            let floats = file.floats()?;
            let texel = |pixel: &[f32]| finite(Rgb::from_array(order.map(|channel| pixel[channel])));
            Samples::Float(floats.chunks_exact(count).map(texel).collect())
        };
        Ok(Self { width, height, samples })
    }

    /// Texels that are already linear colours.
    #[cfg(test)]
    pub fn from_colors(width: usize, colors: Vec<Rgb>) -> Self {
        Self { width, height: colors.len() / width, samples: Samples::Float(colors) }
    }

    /// Linear colour of a texel. `raw`: take eight-bit values as they are instead of decoding sRGB.
    #[inline]
    pub fn texel(&self, x: usize, y: usize, raw: bool) -> Rgb {
        match &self.samples {
            Samples::Float(texels) => texels[y * self.width + x],
            Samples::Byte(texels) => decode(texels[y * self.width + x], raw),
            Samples::Cached { texture, origin, order, eight_bit } => {
                let mut samples = [0.0; MAX_CHANNELS];
                let count = order.iter().max().map_or(1, |&last| last + 1);
                texture.texel(origin.0 + x as i32, origin.1 + y as i32, &mut samples[..count]);
                let color = order.map(|channel| samples[channel]);
                if *eight_bit {
                    decode(color.map(|value| (value * 255.0).round() as u8), raw)
                } else {
                    finite(Rgb::from_array(color))
                }
            }
        }
    }
}

impl Texels {
    /// Linear colours of the texels in two columns of two rows.
    #[inline]
    pub fn square(&self, [left, right]: [usize; 2], [above, below]: [usize; 2], raw: bool) -> [Rgb; 4] {
        let (above, below) = (above * self.width, below * self.width);
        // Four calls: mapping an array is not inlined.
        let of = |texel: &dyn Fn(usize) -> Rgb| {
            [texel(above + left), texel(above + right), texel(below + left), texel(below + right)]
        };
        match &self.samples {
            Samples::Float(texels) => of(&|index| texels[index]),
            Samples::Byte(texels) => {
                let table = decoded(raw);
                of(&|index| {
                    let [r, g, b] = texels[index];
                    vec3(table[r as usize], table[g as usize], table[b as usize])
                })
            }
            Samples::Cached { .. } => of(&|index| self.texel(index % self.width, index / self.width, raw)),
        }
    }
}

/// A texel that is not finite would spoil every path that hits it.
fn finite(color: Rgb) -> Rgb {
    Rgb::from_array(color.to_array().map(|value| if value.is_finite() { value } else { 0.0 }))
}

#[inline]
fn decode([r, g, b]: [u8; 3], raw: bool) -> Rgb {
    let table = decoded(raw);
    vec3(table[r as usize], table[g as usize], table[b as usize])
}

/// Linear values of all bytes.
#[inline]
fn decoded(raw: bool) -> &'static [f32; 256] {
    static LINEAR: OnceLock<[f32; 256]> = OnceLock::new();
    static SRGB: OnceLock<[f32; 256]> = OnceLock::new();
    if raw {
        LINEAR.get_or_init(|| std::array::from_fn(|i| i as f32 / 255.0))
    } else {
        SRGB.get_or_init(|| std::array::from_fn(|i| srgb_decode(i as f32 / 255.0)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Image;

    #[test]
    fn texels_are_the_same_in_memory_and_beyond_its_bound() {
        let image = Image::from_rgb(90, 70, |x, y| vec3(x as f32 / 90.0, y as f32 / 70.0, 0.5));
        let folder = tempfile::tempdir().unwrap();
        for name in ["a.png", "a.exr"] {
            let path = folder.path().join(name);
            io::write_color(&path, &image, &[], &[]).unwrap();
            let held = Texels::read(&path, &mut Memory::new(1 << 20)).unwrap();
            let cached = Texels::read(&path, &mut Memory::new(100)).unwrap();
            assert!(
                matches!(cached.samples, Samples::Cached { .. }) && !matches!(held.samples, Samples::Cached { .. })
            );
            for (x, y, raw) in [(0, 0, false), (89, 69, true), (40, 65, false), (70, 3, true)] {
                assert_eq!(held.texel(x, y, raw), cached.texel(x, y, raw), "{name} {x} {y}");
            }
        }
    }
}
