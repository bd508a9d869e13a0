//! Differences between coarse pixels from differences between fine ones.
//!
//! A coarse pixel stands for the mean of its four fine pixels or for one of them, so the difference of two
//! neighbours is a sum of fine differences along any way from one to the other. All monotone staircases between
//! the fine pixels that stand for them are averaged, which lowers the variance and keeps curl-free fields exact.

use super::resample::Resampling;
use crate::image::planes::Planes;

/// Weights of the fine differences in two cells side by side: along both rows, and across from upper to lower row.
#[derive(Clone, Copy, Default)]
struct Stencil {
    along: [[f32; 3]; 2],
    across: [f32; 4],
}

impl Stencil {
    /// All staircases from one fine pixel (column, row) to another further right.
    fn between(from: (usize, usize), to: (usize, usize)) -> Self {
        let mut stencil = Self::default();
        let n = to.0 - from.0;
        if from.1 == to.1 {
            (from.0..to.0).for_each(|x| stencil.along[from.1][x] = 1.0);
            return stencil;
        }
        let share = 1.0 / (n + 1) as f32;
        for k in 0..n {
            stencil.along[from.1][from.0 + k] = (n - k) as f32 * share;
            stencil.along[to.1][from.0 + k] = (k + 1) as f32 * share;
        }
        let sign = if to.1 > from.1 { 1.0 } else { -1.0 };
        (0..=n).for_each(|k| stencil.across[from.0 + k] = sign * share);
        stencil
    }

    fn add(&mut self, other: &Self, weight: f32) {
        for (sum, value) in self.along.as_flattened_mut().iter_mut().zip(other.along.as_flattened()) {
            *sum += weight * value;
        }
        self.across.iter_mut().zip(&other.across).for_each(|(sum, value)| *sum += weight * value);
    }

    /// Difference from the left cell to the right one, given the representative of each: 0 for the mean, 1 to 4 for one
    /// pixel.
    fn of(left: u8, right: u8) -> Self {
        let pixel = |flag: u8| ((flag as usize - 1) % 2, (flag as usize - 1) / 2);
        let mut sum = Self::default();
        match (left, right) {
            (0, 0) => (1..5).for_each(|k| {
                let (x, y) = pixel(k);
                sum.add(&Self::between((x, y), (x + 2, y)), 0.25);
            }),
            _ => {
                let choices = |flag: u8| if flag == 0 { 1..5 } else { flag..flag + 1 };
                let weight = 1.0 / (choices(left).len() * choices(right).len()) as f32;
                for (a, b) in choices(left).flat_map(|a| choices(right).map(move |b| (a, b))) {
                    let (to, row) = pixel(b);
                    sum.add(&Self::between(pixel(a), (to + 2, row)), weight);
                }
            }
        }
        sum
    }
}

/// Differences to the right at the coarser level with their variances, or downwards when `transposed`.
fn coarse(choices: &Resampling, (along, across): (&Planes, &Planes), squared: bool, transposed: bool) -> Planes {
    let stencils: Vec<Stencil> = (0..25).map(|k| Stencil::of(k / 5, k % 5)).collect();
    let (width, height) = (along.width / 2, along.height / 2);
    // Pixels of a cell are numbered row by row: transposition swaps the second and the third.
    let flip = |flag: u8| if transposed { [0, 1, 3, 2, 4][flag as usize] } else { flag };
    Planes::from_fn(width, height, along.channels(), |c, x, y| {
        let next = if transposed { (x, y + 1) } else { (x + 1, y) };
        if next.0 >= width || next.1 >= height {
            return 0.0;
        }
        let stencil = &stencils[(flip(choices.flag(x, y)) * 5 + flip(choices.flag(next.0, next.1))) as usize];
        let at = |planes: &Planes, i: usize, j: usize| {
            let (i, j) = if transposed { (j, i) } else { (i, j) };
            planes.at(c, (2 * x + i) as isize, (2 * y + j) as isize)
        };
        let weight = |w: f32| if squared { w * w } else { w };
        let rows = (0..2).flat_map(|j| (0..3).map(move |i| (i, j)));
        let sum: f32 = rows.map(|(i, j)| weight(stencil.along[j][i]) * at(along, i, j)).sum();
        sum + (0..4).map(|i| weight(stencil.across[i]) * at(across, i, 0)).sum::<f32>()
    })
}

/// Both differences at the coarser level.
pub fn gradients(choices: &Resampling, [dx, dy]: &[Planes; 2]) -> [Planes; 2] {
    [coarse(choices, (dx, dy), false, false), coarse(choices, (dy, dx), false, true)]
}

/// Their variances, from those of the finer level.
pub fn variances(choices: &Resampling, [dx, dy]: &[Planes; 2]) -> [Planes; 2] {
    [coarse(choices, (dx, dy), true, false), coarse(choices, (dy, dx), true, true)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn differences_of_an_image_become_those_of_the_coarse_image_whatever_stands_for_its_pixels() {
        // Dots and lines make all kinds of cells; the choices are taken from one image and applied to another.
        let guide = Planes::from_fn(64, 48, 3, |_, x, y| {
            let hash = crate::math::rng::combine(3, (y * 64 + x) as u64) % 5;
            if hash == 0 { 5.0 } else { 0.2 * (x / 9) as f32 }
        });
        let choices = Resampling::guided(&guide);
        let image = Planes::from_fn(64, 48, 3, |c, x, y| ((x * x + 3 * y * x) as f32 * 0.37 + c as f32).sin());
        let step = |dx: isize, dy: isize| {
            Planes::from_fn(64, 48, 3, |c, x, y| {
                let (x, y) = (x as isize, y as isize);
                image.at(c, x + dx, y + dy) - image.at(c, x, y)
            })
        };
        let [dx, dy] = gradients(&choices, &[step(1, 0), step(0, 1)]);
        let coarse = choices.down(&image);
        let mut kinds = std::collections::HashSet::new();
        for (x, y) in (0..24).flat_map(|y| (0..32).map(move |x| (x, y))) {
            let (i, j) = (x as isize, y as isize);
            if x < 31 {
                kinds.insert((choices.flag(x, y), choices.flag(x + 1, y)));
                assert!((dx.at(1, i, j) - (coarse.at(1, i + 1, j) - coarse.at(1, i, j))).abs() < 1e-5);
            }
            if y < 23 {
                assert!((dy.at(1, i, j) - (coarse.at(1, i, j + 1) - coarse.at(1, i, j))).abs() < 1e-5);
            }
        }
        assert!(kinds.len() >= 20, "only {} kinds of neighbours", kinds.len());
    }

    #[test]
    fn weights_of_independent_differences_give_their_variance() {
        // From mean to mean: (1, 2, 1) / 4 in both rows.
        let [dx, _] = variances(&Resampling::bilinear(4, 4), &[1, 2].map(|_| Planes::from_fn(4, 4, 1, |_, _, _| 1.0)));
        assert!((dx.at(0, 0, 0) - 2.0 * (1.0 + 4.0 + 1.0) / 16.0).abs() < 1e-6);
    }
}
