//! Image files as texels: in memory while there is room, otherwise through a cache of tiles.

use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, OnceLock};

use crate::error::Result;
use crate::ffi::vectors::prefetch;
use crate::image::channels::{ColorChannels, Decoding, Integers};
use crate::image::io::{CachedTexture, DataWindow, ImageFile, OpenImage, TextureSystem};
use crate::math::{Rgb, half, srgb_decode, vec3};

/// Part of an image file that is read.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Selection {
    /// How integers are decoded.
    pub integers: Integers,
    /// A single channel in place of the colours.
    pub channel: Option<String>,
}

/// An image as linear colours: alpha dropped, grey spread over all three channels.
pub struct Texels {
    /// Pixels in a row.
    pub width: usize,
    /// Number of rows.
    pub height: usize,
    samples: Samples,
}

enum Samples {
    /// Eight bits, with the linear values of all bytes.
    Byte(Vec<[u8; 3]>, &'static [f32; 256]),
    Float(Vec<Rgb>),
    /// Floats that sixteen bits are enough for: half of the memory to wait for.
    Half(Vec<[u16; 3]>),
    /// Beyond the memory bound.
    Cached {
        texture: CachedTexture,
        origin: (i32, i32),
        colors: ColorChannels,
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

/// Properties of a file that textures do not show as they are.
pub struct Oddities {
    /// Number of texels that are not finite: infinity counts as the largest half float, and NaN as zero. Those of files beyond
    /// the memory bound are not counted.
    pub infinite: usize,
    /// The larger picture of which the pixels of the file are a part. The texture consists of that part alone.
    pub window: Option<DataWindow>,
}

impl Texels {
    /// Reads an image file, or only its header when there is no room for the rest.
    pub fn read(path: &Path, selection: &Selection, memory: &mut Memory) -> Result<(Self, Oddities)> {
        let file = ImageFile::open(path)?;
        let colors = match &selection.channel {
            Some(channel) => ColorChannels::single(&file, path, channel, selection.integers)?,
            None => ColorChannels::of(&file, path, selection.integers)?,
        };
        let (width, height, order) = (file.width, file.height, colors.order);
        let eight_bit = colors.is_eight_bit(&file);
        let size = (width * height * if eight_bit { 3 } else { 12 }) as u64;
        if size > memory.left && file.can_be_cached() && order.iter().all(|&channel| channel < MAX_CHANNELS) {
            if let Some(system) = memory.system() {
                let texture = CachedTexture::open(&system, path)?;
                let samples = Samples::Cached { texture, origin: file.origin, colors };
                return Ok((Self { width, height, samples }, Oddities { infinite: 0, window: file.window }));
            }
        }
        memory.left = memory.left.saturating_sub(size);
        let (count, infinite) = (file.channels.len(), AtomicUsize::new(0));
        let samples = if eight_bit {
            let bytes = file.bytes()?;
            let texels = bytes.chunks_exact(count).map(|pixel| order.map(|channel| pixel[channel])).collect();
            Samples::Byte(texels, decoded(colors.decoding[0]))
        } else {
            let texel = |pixel: &[f32]| {
                let color = colors.color(pixel);
                infinite.fetch_add(usize::from(!color.is_finite()), Ordering::Relaxed);
                finite(color)
            };
            compact(file.floats()?.chunks_exact(count).map(texel).collect())
        };
        Ok((Self { width, height, samples }, Oddities { infinite: infinite.into_inner(), window: file.window }))
    }

    /// Texels that are already linear colours.
    pub fn from_colors(width: usize, colors: Vec<Rgb>) -> Self {
        Self { width, height: colors.len() / width, samples: Samples::Float(colors) }
    }

    /// Linear colour of a texel.
    #[inline]
    pub fn texel(&self, x: usize, y: usize) -> Rgb {
        match &self.samples {
            Samples::Float(texels) => texels[y * self.width + x],
            Samples::Half(texels) => expand(texels[y * self.width + x]),
            Samples::Byte(texels, table) => decode(texels[y * self.width + x], table),
            Samples::Cached { texture, origin, colors } => {
                let mut samples = [0.0; MAX_CHANNELS];
                let count = colors.order.iter().max().map_or(1, |&last| last + 1);
                texture.texel(origin.0 + x as i32, origin.1 + y as i32, &mut samples[..count]);
                finite(colors.color(&samples))
            }
        }
    }
}

impl Texels {
    /// Has the texels of two rows in a column brought into the cache, to be looked up soon.
    #[inline]
    pub fn prefetch(&self, column: usize, rows: [usize; 2]) {
        for row in rows {
            let index = row * self.width + column;
            match &self.samples {
                Samples::Float(texels) => prefetch(texels, index),
                Samples::Half(texels) => prefetch(texels, index),
                Samples::Byte(texels, _) => prefetch(texels, index),
                Samples::Cached { .. } => {}
            }
        }
    }

    /// Linear colours of the texels in two columns of two rows.
    #[inline]
    pub fn square(&self, [left, right]: [usize; 2], [above, below]: [usize; 2]) -> [Rgb; 4] {
        let (above, below) = (above * self.width, below * self.width);
        // Four calls: mapping an array is not inlined.
        let of = |texel: &dyn Fn(usize) -> Rgb| {
            [texel(above + left), texel(above + right), texel(below + left), texel(below + right)]
        };
        match &self.samples {
            Samples::Float(texels) => of(&|index| texels[index]),
            Samples::Half(texels) => of(&|index| expand(texels[index])),
            Samples::Byte(texels, table) => of(&|index| decode(texels[index], table)),
            Samples::Cached { .. } => of(&|index| self.texel(index % self.width, index / self.width)),
        }
    }
}

/// Texels as half floats, if these are the same numbers.
fn compact(texels: Vec<Rgb>) -> Samples {
    let half = |texel: &Rgb| {
        let [r, g, b] = texel.to_array().map(half::encode);
        Some([r?, g?, b?])
    };
    match texels.iter().map(half).collect() {
        Some(halves) => Samples::Half(halves),
        None => Samples::Float(texels),
    }
}

#[inline(always)]
fn expand([r, g, b]: [u16; 3]) -> Rgb {
    vec3(half::decode(r), half::decode(g), half::decode(b))
}

/// The largest half float, which a sun that was brighter is clipped to.
const BRIGHTEST: f32 = 65504.0;

/// A texel that is not finite would spoil every path that hits it.
fn finite(color: Rgb) -> Rgb {
    let finite = |value: f32| match value {
        f32::INFINITY => BRIGHTEST,
        value if value.is_finite() => value,
        _ => 0.0,
    };
    if color.is_finite() { color } else { Rgb::from_array(color.to_array().map(finite)) }
}

#[inline]
fn decode([r, g, b]: [u8; 3], table: &[f32; 256]) -> Rgb {
    vec3(table[r as usize], table[g as usize], table[b as usize])
}

/// Linear values of all bytes.
fn decoded(decoding: Decoding) -> &'static [f32; 256] {
    static LINEAR: OnceLock<[f32; 256]> = OnceLock::new();
    static SRGB: OnceLock<[f32; 256]> = OnceLock::new();
    match decoding {
        Decoding::Srgb => SRGB.get_or_init(|| std::array::from_fn(|i| srgb_decode(i as f32 / 255.0))),
        Decoding::Linear | Decoding::Integer | Decoding::Gamma(_) => {
            LINEAR.get_or_init(|| std::array::from_fn(|i| i as f32 / 255.0))
        }
    }
}

#[cfg(all(test, feature = "openimageio"))]
mod tests {
    use super::*;
    use crate::image::{Image, io};

    #[test]
    fn texels_are_the_same_in_memory_and_beyond_its_bound() {
        let image = Image::from_rgb(90, 70, |x, y| vec3(x as f32 / 90.0, y as f32 / 70.0, 0.5));
        let folder = tempfile::tempdir().unwrap();
        for name in ["a.png", "a.exr"] {
            let path = folder.path().join(name);
            io::write_color(&path, &image, &io::Extras::default()).unwrap();
            let read = |raw, bytes| {
                Texels::read(
                    &path,
                    &Selection { integers: if raw { Integers::Raw } else { Integers::Srgb }, channel: None },
                    &mut Memory::new(bytes),
                )
                .unwrap()
                .0
            };
            for (x, y, raw) in [(0, 0, false), (89, 69, true), (40, 65, false), (70, 3, true)] {
                let (held, cached) = (read(raw, 1 << 20), read(raw, 100));
                assert!(matches!(cached.samples, Samples::Cached { .. }));
                assert!(!matches!(held.samples, Samples::Cached { .. }));
                assert!(held.texel(x, y).distance(cached.texel(x, y)) < 1e-6, "{name} {x} {y}");
            }
        }
    }
}
