//! How far pixels and patches are apart, in units of their noise.

use crate::image::planes::{PlaneTile, Planes};
use crate::math::lanes::{LANES, Lanes};

/// Images of a few channels with the sums of their variances and of their tolerances.
pub struct Guide {
    /// The values.
    pub mean: Planes,
    /// Sum over the channels of the variance of the mean.
    pub variance: Planes,
    /// Sum over the channels of the squared difference that counts as alike; the variance where there is none.
    pub tolerance: Option<Planes>,
}

/// A guide image in the form that distances are computed from.
#[derive(Clone, Copy)]
pub enum Other {
    /// The pixel at an offset.
    At(isize, isize),
    /// The mean of that pixel and the opposite one.
    Mean(isize, isize),
}

impl Guide {
    /// Squared difference between pixels of [`LANES`] columns and others, less the part that noise explains, over `k2`
    /// times the tolerated difference (Rousselle et al. 2013, eq. 4, with sums over the channels).
    #[inline(always)]
    pub fn distance(&self, (x, y): (isize, isize), other: Other, k2: f32) -> Lanes {
        let load = |planes: &Planes, c: usize, dx: isize, dy: isize| planes.lanes(c, x + dx, y + dy);
        match other {
            Other::At(dx, dy) => self.beyond((x, y), k2, |planes, c, _| load(planes, c, dx, dy)),
            Other::Mean(dx, dy) => self.beyond((x, y), k2, |planes, c, share| {
                (load(planes, c, dx, dy) + load(planes, c, -dx, -dy)) * Lanes::splat(share)
            }),
        }
    }

    /// [`Guide::distance`] to pixels that `there` loads; they are a mean of two whose sum it scales by its last
    /// argument, or just one.
    #[inline(always)]
    fn beyond(&self, (x, y): (isize, isize), k2: f32, there: impl Fn(&Planes, usize, f32) -> Lanes) -> Lanes {
        let here = |planes: &Planes, c: usize| planes.lanes(c, x, y);
        let (vp, vq) = (here(&self.variance, 0), there(&self.variance, 0, 0.25));
        let mut beyond = Lanes::ZERO - (vp + vp.min(vq));
        for c in 0..self.mean.channels() {
            let difference = here(&self.mean, c) - there(&self.mean, c, 0.5);
            beyond += difference * difference;
        }
        let (tp, tq) = match &self.tolerance {
            Some(tolerance) => (here(tolerance, 0), there(tolerance, 0, 0.25)),
            None => (vp, vq),
        };
        beyond / (Lanes::splat(1e-10) + Lanes::splat(k2) * (tp + tq))
    }
}

/// Distances of a tile's pixels and their surroundings to others, summed along rows.
pub struct Patches {
    tile: PlaneTile,
    reach: usize,
    distance: Vec<f32>,
    /// Sums along rows for each radius.
    rows: Vec<Vec<f32>>,
}

impl Patches {
    /// Memory for patches of the given number of radii, the largest `reach`.
    pub fn new(tile: PlaneTile, reach: usize, radii: usize) -> Self {
        let rows = tile.height + 2 * reach;
        let width = tile.width.next_multiple_of(LANES);
        // A vector more than the patches need, and one to read beyond it.
        Self { tile, reach, distance: vec![0.0; width + 2 * LANES], rows: vec![vec![0.0; width * rows]; radii] }
    }

    /// Compares with other pixels.
    #[inline(always)]
    pub fn compare(&mut self, guide: &Guide, other: Other, k2: f32, radii: &[usize]) {
        let width = self.tile.width.next_multiple_of(LANES);
        let reach = self.reach as isize;
        for row in 0..self.tile.height + 2 * self.reach {
            let y = self.tile.y as isize - reach + row as isize;
            for x in (0..width + LANES).step_by(LANES) {
                let at = (self.tile.x as isize - reach + x as isize, y);
                guide.distance(at, other, k2).store(&mut self.distance[x..]);
            }
            for (&radius, rows) in radii.iter().zip(&mut self.rows) {
                for x in (0..width).step_by(LANES) {
                    let from = &self.distance[x + self.reach - radius..];
                    let sum = (1..2 * radius + 1).fold(<Lanes>::load(from), |sum, k| sum + Lanes::load(&from[k..]));
                    sum.store(&mut rows[row * width + x..]);
                }
            }
        }
    }

    /// Means over the patches around [`LANES`] pixels of the tile, of the radius at position `which` of those asked for.
    #[inline(always)]
    pub fn mean(&self, which: usize, radius: usize, x: usize, y: usize) -> Lanes {
        let width = self.tile.width.next_multiple_of(LANES);
        let from = &self.rows[which][(y + self.reach - radius) * width + x..];
        let sum = (1..2 * radius + 1).fold(Lanes::load(from), |sum, k| sum + Lanes::load(&from[k * width..]));
        sum * Lanes::splat(1.0 / ((2 * radius + 1) * (2 * radius + 1)) as f32)
    }
}
