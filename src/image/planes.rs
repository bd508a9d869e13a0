//! Images in separate planes with a mirrored border: the form that filters work on.

use rayon::prelude::*;

use super::Image;
use crate::math::lanes::{LANES, Lanes};

/// Pixels of border on each side, mirrored about the outermost pixels. Windows of filters may reach this far.
pub const BORDER: usize = 16;

/// Values after the last row, so that whole vectors can be read from everywhere.
const SLACK: usize = 128;

/// Side of the squares that images are worked on in: small enough that a square's scratch stays in cache.
pub const TILE: usize = 64;

/// `width * height` pixels in separate planes of floats, each with [`BORDER`] pixels around it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Planes {
    /// Pixels in a row, without border.
    pub width: usize,
    /// Number of rows, without border.
    pub height: usize,
    planes: Vec<Vec<f32>>,
}

/// A rectangle of pixels.
#[derive(Clone, Copy, Debug)]
pub struct PlaneTile {
    /// Left column.
    pub x: usize,
    /// Top row.
    pub y: usize,
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
}

impl PlaneTile {
    /// Columns and rows, within the tile, where blocks of [`LANES`] pixels begin, row by row.
    #[inline(always)]
    pub fn blocks(self) -> impl Iterator<Item = (usize, usize)> {
        (0..self.height).flat_map(move |y| (0..self.width).step_by(LANES).map(move |x| (x, y)))
    }

    /// Puts values from column `x` of row `y` on into channel `c` of a tile, as [`Planes::from_tiles`] takes it;
    /// values beyond the last column are left out.
    #[inline(always)]
    pub fn put(&self, out: &mut [f32], c: usize, x: usize, y: usize, values: Lanes) {
        let count = LANES.min(self.width - x);
        let at = (c * self.height + y) * self.width + x;
        if count == LANES {
            values.store(&mut out[at..]);
        } else {
            out[at..at + count].copy_from_slice(&values.0[..count]);
        }
    }
}

impl Planes {
    /// Planes of zeros.
    pub fn new(width: usize, height: usize, channels: usize) -> Self {
        let size = (width + 2 * BORDER) * (height + 2 * BORDER) + SLACK;
        Self { width, height, planes: vec![vec![0.0; size]; channels] }
    }

    /// Planes from a function of channel, column and row.
    pub fn from_fn(
        width: usize,
        height: usize,
        channels: usize,
        value: impl Fn(usize, usize, usize) -> f32 + Sync,
    ) -> Self {
        let mut planes = Self::new(width, height, channels);
        for c in 0..channels {
            planes.fill_rows(c, &|y, row| {
                row.iter_mut().enumerate().for_each(|(x, slot)| *slot = value(c, x, y));
            });
        }
        planes.mirror_border();
        planes
    }

    /// Fills the rows of a plane in parallel. Callers share its code: with a type of `fill` in place of a reference there would be a
    /// copy of the scheduler in every one of them.
    fn fill_rows(&mut self, c: usize, fill: &(dyn Fn(usize, &mut [f32]) + Sync)) {
        self.interior(c).enumerate().for_each(|(y, row)| fill(y, row));
    }

    /// Planes of the same size, made in parallel; all of its callers share its code, too.
    fn made(&self, channels: usize, make: &(dyn Fn(usize) -> Vec<f32> + Sync)) -> Self {
        Self { planes: (0..channels).into_par_iter().map(make).collect(), ..*self }
    }

    /// Planes whose tiles are computed in parallel: `compute` returns a tile's channels one after the other.
    pub fn from_tiles(
        width: usize,
        height: usize,
        channels: usize,
        compute: impl Fn(PlaneTile) -> Vec<f32> + Sync,
    ) -> Self {
        Self::of_tiles(width, height, channels, &compute)
    }

    fn of_tiles(
        width: usize,
        height: usize,
        channels: usize,
        compute: &(dyn Fn(PlaneTile) -> Vec<f32> + Sync),
    ) -> Self {
        let mut planes = Self::new(width, height, channels);
        for y in (0..height).step_by(TILE) {
            let tile = |x| PlaneTile { x, y, width: TILE.min(width - x), height: TILE.min(height - y) };
            let lefts: Vec<_> = (0..width).step_by(TILE).collect();
            let tiles: Vec<_> = lefts.into_par_iter().map(|x| (tile(x), compute(tile(x)))).collect();
            for (tile, values) in tiles {
                let rows = values.chunks_exact(tile.width).enumerate();
                rows.for_each(|(i, row)| {
                    let at = planes.index(tile.x as isize, (tile.y + i % tile.height) as isize);
                    planes.planes[i / tile.height][at..at + tile.width].copy_from_slice(row);
                });
            }
        }
        planes.mirror_border();
        planes
    }

    /// The top left `width` by `height` pixels as an image, scaled by `scale`.
    pub fn to_image(&self, width: usize, height: usize, scale: f32) -> Image {
        let mut image = Image::new(width, height, self.channels());
        let channels = self.channels();
        image.data.par_chunks_exact_mut(width * channels).enumerate().for_each(|(y, row)| {
            for (i, slot) in row.iter_mut().enumerate() {
                *slot = self.at(i % channels, (i / channels) as isize, y as isize) * scale;
            }
        });
        image
    }

    /// Number of planes.
    pub fn channels(&self) -> usize {
        self.planes.len()
    }

    /// Floats from a pixel to the one below it.
    pub fn stride(&self) -> usize {
        self.width + 2 * BORDER
    }

    /// Position of a pixel, from `-BORDER` on, in a plane.
    #[inline(always)]
    pub fn index(&self, x: isize, y: isize) -> usize {
        ((y + BORDER as isize) * self.stride() as isize + x + BORDER as isize) as usize
    }

    /// A value; columns and rows may lie in the border.
    #[inline(always)]
    pub fn at(&self, c: usize, x: isize, y: isize) -> f32 {
        self.planes[c][self.index(x, y)]
    }

    /// `length` values of a row from column `x` on.
    #[inline(always)]
    pub fn span(&self, c: usize, x: isize, y: isize, length: usize) -> &[f32] {
        let at = self.index(x, y);
        &self.planes[c][at..at + length]
    }

    /// Values from a pixel on, at least a hundred of them; the row is followed by the border and the next row.
    #[inline(always)]
    pub fn tail_from(&self, c: usize, x: isize, y: isize) -> &[f32] {
        &self.planes[c][self.index(x, y)..]
    }

    /// [`LANES`] values of a row from column `x` on.
    #[inline(always)]
    pub fn lanes(&self, c: usize, x: isize, y: isize) -> Lanes {
        Lanes::load(self.tail_from(c, x, y))
    }

    /// Rows of a plane without the border, to write in parallel. [`Planes::mirror_border`] must follow.
    pub fn interior(&mut self, c: usize) -> impl IndexedParallelIterator<Item = &mut [f32]> {
        let (width, height, stride) = (self.width, self.height, self.stride());
        let rows = &mut self.planes[c][BORDER * stride..(BORDER + height) * stride];
        rows.par_chunks_exact_mut(stride).map(move |row| &mut row[BORDER..BORDER + width])
    }

    /// Fills the border from the inside.
    pub fn mirror_border(&mut self) {
        let (width, height, stride) = (self.width, self.height, self.stride());
        self.planes.par_iter_mut().for_each(|plane| {
            for row in plane.chunks_exact_mut(stride).skip(BORDER).take(height) {
                for i in 0..BORDER {
                    row[i] = row[BORDER + mirror(i as isize - BORDER as isize, width)];
                    row[BORDER + width + i] = row[BORDER + mirror((width + i) as isize, width)];
                }
            }
            for i in 0..BORDER {
                for (to, y) in [(i, i as isize - BORDER as isize), (BORDER + height + i, (height + i) as isize)] {
                    let from = (BORDER + mirror(y, height)) * stride;
                    plane.copy_within(from..from + stride, to * stride);
                }
            }
        });
    }

    /// The sum of the planes, as one plane.
    pub fn sum(&self) -> Self {
        let add = |i: usize| self.planes.iter().map(|plane| plane[i]).sum();
        let plane = (0..self.planes[0].len()).into_par_iter().map(add).collect();
        Self { planes: vec![plane], ..*self }
    }

    /// Planes whose values are a function of these here and those of `other` there.
    pub fn zip(&self, other: &Self, f: impl Fn(f32, f32) -> f32 + Sync) -> Self {
        let channels = self.planes.len().min(other.planes.len());
        self.made(channels, &|c| self.planes[c].iter().zip(&other.planes[c]).map(|(&a, &b)| f(a, b)).collect())
    }

    /// Planes whose values are a function of these.
    pub fn map(&self, f: impl Fn(f32) -> f32 + Sync) -> Self {
        self.made(self.planes.len(), &|c| self.planes[c].iter().map(|&value| f(value)).collect())
    }

    /// Means over squares of the given radius around every pixel.
    pub fn box_mean(&self, radius: usize) -> Self {
        let r = radius as isize;
        let share = 1.0 / (2 * radius + 1) as f32;
        let across = |from: &Self, step: (isize, isize)| {
            Self::from_fn(self.width, self.height, self.channels(), |c, x, y| {
                let at = |k: isize| from.at(c, x as isize + k * step.0, y as isize + k * step.1);
                (-r..=r).map(at).sum::<f32>() * share
            })
        };
        across(&across(self, (1, 0)), (0, 1))
    }

    /// Medians over squares of the given radius, at most 3, around every pixel.
    pub fn median(&self, radius: usize) -> Self {
        let r = radius as isize;
        let count = (2 * radius + 1) * (2 * radius + 1);
        Self::from_fn(self.width, self.height, self.channels(), |c, x, y| {
            let mut around = [0.0; 49];
            let rows = around[..count].chunks_exact_mut(2 * radius + 1).zip(y as isize - r..);
            rows.for_each(|(row, y)| row.copy_from_slice(self.span(c, x as isize - r, y, 2 * radius + 1)));
            *around[..count].select_nth_unstable_by(count / 2, f32::total_cmp).1
        })
    }

    /// `count` of the planes from `first` on.
    pub fn part(&self, first: usize, count: usize) -> Self {
        Self { planes: self.planes[first..first + count].to_vec(), ..*self }
    }

    /// Rows `y..y + height`, with the rows around them as border.
    pub fn band(&self, y: usize, height: usize) -> Self {
        let range = y * self.stride()..(y + height + 2 * BORDER) * self.stride();
        let cut = |plane: &Vec<f32>| plane[range.clone()].iter().copied().chain([0.0; SLACK]).collect();
        Self { width: self.width, height, planes: self.planes.iter().map(cut).collect() }
    }

    /// Puts rows `from..` of a band at rows `range`.
    pub fn put_rows(&mut self, range: std::ops::Range<usize>, band: &Self, from: usize) {
        let stride = self.stride();
        let (to, from) = ((range.start + BORDER) * stride, (from + BORDER) * stride);
        let length = range.len() * stride;
        for (plane, band) in self.planes.iter_mut().zip(&band.planes) {
            plane[to..to + length].copy_from_slice(&band[from..from + length]);
        }
    }

    /// These planes and those of `other` of the same size, one after the other.
    pub fn and(&self, other: &Self) -> Self {
        let planes = self.planes.iter().chain(&other.planes).cloned().collect();
        Self { planes, ..*self }
    }
}

/// Reflection about the first and last pixel, which are not repeated, as often as it takes.
pub fn mirror(at: isize, length: usize) -> usize {
    let period = 2 * (length as isize - 1);
    if period == 0 {
        return 0;
    }
    let inside = at.rem_euclid(period);
    inside.min(period - inside) as usize
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn borders_mirror_at_every_size() {
        for (width, height) in [(1, 1), (2, 1), (3, 5), (40, 17)] {
            let planes = Planes::from_fn(width, height, 2, |c, x, y| (c * 1000 + y * 50 + x) as f32);
            for y in -16..(height + 16) as isize {
                for x in -16..(width + 16) as isize {
                    let expected = (1000 + mirror(y, height) * 50 + mirror(x, width)) as f32;
                    assert_eq!(planes.at(1, x, y), expected, "{x},{y} of {width}x{height}");
                }
            }
        }
        assert_eq!((mirror(-1, 4), mirror(-4, 4), mirror(4, 4), mirror(7, 4)), (1, 2, 2, 1));
    }

    #[test]
    fn tiles_make_up_the_whole() {
        let expected = Planes::from_fn(150, 70, 2, |c, x, y| (c * 31 + x * 7 + y) as f32);
        let tiled = Planes::from_tiles(150, 70, 2, |tile| {
            let pixels =
                (0..2).flat_map(|c| (0..tile.height).flat_map(move |y| (0..tile.width).map(move |x| (c, x, y))));
            pixels.map(|(c, x, y)| (c * 31 + (tile.x + x) * 7 + tile.y + y) as f32).collect()
        });
        assert_eq!(tiled, expected);
    }
}
