//! Pixels in blocks of four by four, each of which is a vector.

use rayon::prelude::*;

use crate::image::planes::Planes;
use crate::math::lanes::Lanes;

/// Side of a block.
pub const SIDE: usize = 4;

/// Channels of pixels, block by block, row by row. Blocks may reach beyond the image.
pub struct Blocks {
    /// Blocks in a row.
    pub columns: usize,
    /// Rows of blocks.
    pub rows: usize,
    /// Channels.
    pub channels: usize,
    values: Vec<Lanes>,
}

impl Blocks {
    /// Blocks of a function of channel, column and row.
    pub fn from_fn(
        (width, height): (usize, usize),
        channels: usize,
        value: impl Fn(usize, usize, usize) -> f32 + Sync,
    ) -> Self {
        let (columns, rows) = (width.div_ceil(SIDE), height.div_ceil(SIDE));
        let mut values = vec![Lanes::ZERO; columns * rows * channels];
        values.par_chunks_mut(channels.max(1)).enumerate().for_each(|(block, slots)| {
            let (left, top) = (block % columns * SIDE, block / columns * SIDE);
            for (c, slot) in slots.iter_mut().enumerate() {
                *slot = Lanes(std::array::from_fn(|i| value(c, left + i % SIDE, top + i / SIDE)));
            }
        });
        Self { columns, rows, channels, values }
    }

    /// Blocks of planes.
    pub fn new(planes: &Planes) -> Self {
        let value = |c, x: usize, y: usize| planes.at(c, x as isize, y as isize);
        Self::from_fn((planes.width, planes.height), planes.channels(), value)
    }

    /// The channels of a block.
    #[inline(always)]
    pub fn at(&self, x: usize, y: usize) -> &[Lanes] {
        let first = (y * self.columns + x) * self.channels;
        &self.values[first..first + self.channels]
    }

    /// Blocks made of these, in parallel.
    pub fn map<const N: usize>(&self, compute: impl Fn(usize, usize) -> [Lanes; N] + Sync) -> Self {
        let mut values = vec![Lanes::ZERO; self.columns * self.rows * N];
        values.par_chunks_exact_mut(N).enumerate().for_each(|(block, slots)| {
            slots.copy_from_slice(&compute(block % self.columns, block / self.columns));
        });
        Self { channels: N, values, ..*self }
    }

    /// Some of the channels as planes of the image's size.
    pub fn planes(&self, (width, height): (usize, usize), first: usize, channels: usize) -> Planes {
        Planes::from_fn(width, height, channels, |c, x, y| {
            self.at(x / SIDE, y / SIDE)[first + c].0[y % SIDE * SIDE + x % SIDE]
        })
    }
}

/// Coordinates of a block's pixels relative to `centre`, both in pixels, times `scale`.
#[inline(always)]
pub fn coordinates((x, y): (usize, usize), centre: (f32, f32), scale: f32) -> [Lanes; 2] {
    let along = |block: usize, centre: f32, step: fn(usize) -> usize| {
        Lanes(std::array::from_fn(|i| ((block * SIDE + step(i)) as f32 - centre) * scale))
    };
    [along(x, centre.0, |i| i % SIDE), along(y, centre.1, |i| i / SIDE)]
}

/// The centre of a block, in pixels.
#[inline(always)]
pub fn centre((x, y): (usize, usize)) -> (f32, f32) {
    let middle = (SIDE - 1) as f32 / 2.0;
    ((x * SIDE) as f32 + middle, (y * SIDE) as f32 + middle)
}
