//! Images of any number of channels, as networks pass them on.

use rayon::prelude::*;

/// Values of a grid of pixels, row by row, all channels of a pixel together.
#[derive(Clone, Debug, PartialEq)]
pub struct Tensor {
    /// Pixels in a row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Values of a pixel.
    pub channels: usize,
    /// The values.
    pub data: Vec<f32>,
}

impl Tensor {
    /// Zeros.
    pub fn new(width: usize, height: usize, channels: usize) -> Self {
        Self { width, height, channels, data: vec![0.0; width * height * channels] }
    }

    /// Values of a function of column and row, which fills the channels of a pixel.
    pub fn from_fn(
        width: usize,
        height: usize,
        channels: usize,
        fill: impl Fn(usize, usize, &mut [f32]) + Sync,
    ) -> Self {
        let mut made = Self::new(width, height, channels);
        made.fill_rows(&|y, row| {
            row.chunks_exact_mut(channels).enumerate().for_each(|(x, pixel)| fill(x, y, pixel));
        });
        made
    }

    /// Fills the rows in parallel, by code that all callers share.
    fn fill_rows(&mut self, fill: &(dyn Fn(usize, &mut [f32]) + Sync)) {
        self.rows_mut().for_each(|(y, row)| fill(y, row));
    }

    /// The channels of a pixel.
    #[inline(always)]
    pub fn pixel(&self, x: usize, y: usize) -> &[f32] {
        &self.data[(y * self.width + x) * self.channels..][..self.channels]
    }

    /// A row.
    pub fn row(&self, y: usize) -> &[f32] {
        let length = self.width * self.channels;
        &self.data[y * length..][..length]
    }

    /// Rows with their numbers, to be filled in parallel.
    pub fn rows_mut(&mut self) -> impl IndexedParallelIterator<Item = (usize, &mut [f32])> {
        let length = (self.width * self.channels).max(1);
        self.data.par_chunks_mut(length).enumerate()
    }

    /// Rows from `first` on.
    pub fn band(&self, first: usize, rows: usize) -> Self {
        let length = self.width * self.channels;
        Self { height: rows, data: self.data[first * length..][..rows * length].to_vec(), ..*self }
    }

    /// The first channels, and the others.
    pub fn split(&self, first: usize) -> (Self, Self) {
        let part = |from: usize, count: usize| {
            Self::from_fn(self.width, self.height, count, |x, y, pixel| {
                pixel.copy_from_slice(&self.pixel(x, y)[from..from + count]);
            })
        };
        (part(0, first), part(first, self.channels - first))
    }

    /// The channels of tensors of the same size after each other.
    pub fn concat(parts: &[&Self]) -> Self {
        let (width, height) = (parts[0].width, parts[0].height);
        assert!(parts.iter().all(|part| (part.width, part.height) == (width, height)), "tensors of the same size");
        let channels = parts.iter().map(|part| part.channels).sum();
        Self::from_fn(width, height, channels, |x, y, pixel| {
            let mut rest = pixel;
            for part in parts {
                let (own, others) = rest.split_at_mut(part.channels);
                own.copy_from_slice(part.pixel(x, y));
                rest = others;
            }
        })
    }
}

/// Pixels of a band, and of larger images the share of their rows that a band may have.
const PIXELS: usize = 1 << 20;
const SHARE: f64 = 0.6;

/// Rows of bands for a network whose outputs depend on inputs up to `reach` rows away: as few bands as memory has room for, as what
/// they have in common is computed twice.
pub fn band_rows((width, height): (usize, usize), reach: usize) -> usize {
    let most = (PIXELS / width.max(1)).max((SHARE * height as f64) as usize);
    if height <= most {
        return height;
    }
    let beside = |bands: usize| if bands == 2 { reach } else { 2 * reach };
    let bands = (2..=height).find(|&bands| height.div_ceil(bands) + beside(bands) <= most);
    height.div_ceil(bands.unwrap_or(2))
}

/// The network `apply` on bands of about `rows` rows, so that its own memory is bounded. The values are those of all rows at
/// once, if no output depends on inputs more than `reach` rows away and the network halves sizes by `multiple` at most.
pub fn in_bands(
    input: &Tensor,
    (rows, multiple, reach): (usize, usize, usize),
    apply: impl Fn(&Tensor) -> Tensor,
) -> Tensor {
    let rows = rows.next_multiple_of(multiple);
    if rows >= input.height {
        return apply(input);
    }
    let (mut data, mut channels) = (Vec::new(), 0);
    for first in (0..input.height).step_by(rows) {
        let (start, end) = (first.saturating_sub(reach) / multiple * multiple, input.height.min(first + rows));
        let bottom = input.height.min((end + reach).next_multiple_of(multiple));
        let band = apply(&input.band(start, bottom - start));
        let length = band.width * band.channels;
        data.extend_from_slice(&band.data[(first - start) * length..(end - start) * length]);
        channels = band.channels;
    }
    Tensor { channels, data, ..*input }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bands_are_few_and_no_larger_than_memory_has_room_for() {
        assert_eq!(band_rows((1280, 720), 96), 720);
        assert_eq!(band_rows((1920, 1080), 96), 540);
        assert_eq!(band_rows((3840, 2160), 96), 1080);
        for (width, height) in [(1, 1), (40_000, 30), (30, 40_000), (7680, 4320)] {
            let rows = band_rows((width, height), 96);
            assert!((1..=height).contains(&rows), "{rows} of {width}x{height}");
        }
    }
}
