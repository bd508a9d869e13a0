//! Guided linear down- and upsampling by two (Song et al. 2023): a coarse pixel is the mean of its four fine ones
//! or one of them, a fine pixel is a mixture of two coarse ones nearby, and both are chosen so that going down
//! and up again changes a guide image least.

use rayon::prelude::*;

use crate::image::planes::Planes;
use crate::math::lanes::{LANES, Lanes};

/// Fine pixels whose guide is further away than this after going down and up are looked at again. In units of the
/// typical luminance.
const TOLERANCE: f32 = 0.3;

/// The choices for one step of the pyramid.
pub struct Resampling {
    /// For each coarse pixel: 0 for the mean of its four fine ones, or 1 to 4 for one of them, row by row.
    flags: Vec<u8>,
    /// Coarse pixels that each fine pixel is a mixture of; empty for bilinear interpolation.
    pairs: Vec<Pair>,
    /// Size of the coarse image.
    width: usize,
    height: usize,
}

/// Two of the nine coarse pixels around a fine one, numbered row by row, and the weight of the first.
#[derive(Clone, Copy, Default)]
struct Pair {
    first: u8,
    second: u8,
    weight: f32,
}

/// How a fine image is mixed, and how far from the guide that leaves it.
struct Fit {
    pairs: Vec<Pair>,
    left: Vec<f32>,
}

/// Pixel number `k` of the nine around (x, y).
#[inline(always)]
fn around(k: usize, x: usize, y: usize) -> (isize, isize) {
    ((x + k % 3) as isize - 1, (y + k / 3) as isize - 1)
}

impl Resampling {
    /// Means and bilinear interpolation, whatever the image.
    pub fn bilinear(width: usize, height: usize) -> Self {
        Self { flags: vec![0; width * height / 4], pairs: Vec::new(), width: width / 2, height: height / 2 }
    }

    /// The choices that suit `guide`, whose sides are even and whose channels are at most nine.
    pub fn guided(guide: &Planes) -> Self {
        let mut this = Self { pairs: Vec::new(), ..Self::bilinear(guide.width, guide.height) };
        let before = this.fit(guide);
        let clusters = clusters(&before.left, guide.width);
        // Where a cell's worst pixel is in a cluster, that pixel stands for the cell.
        let cluster_of = |cell: usize, k: usize| clusters[this.fine(cell, k)];
        let flags: Vec<u8> = (0..this.flags.len())
            .map(|cell| {
                let error = |k: usize| before.left[this.fine(cell, k)];
                let worst = (0..4).fold(0, |worst, k| if error(k) > error(worst) { k } else { worst });
                if cluster_of(cell, worst) > 0 { worst as u8 + 1 } else { 0 }
            })
            .collect();
        if flags.iter().all(|&flag| flag == 0) {
            this.pairs = before.pairs;
            return this;
        }
        let tried = Self { flags, pairs: Vec::new(), ..this };
        let after = tried.fit(guide);
        // Clusters that this made worse go back to means.
        let mut change = vec![0.0f64; clusters.iter().max().map_or(0, |&most| most as usize) + 1];
        for (i, &cluster) in clusters.iter().enumerate() {
            change[cluster as usize] += f64::from(after.left[i]) - f64::from(before.left[i]);
        }
        let worse =
            |cell: usize, flag: u8| flag > 0 && change[clusters[tried.fine(cell, flag as usize - 1)] as usize] > 0.0;
        let kept: Vec<u8> =
            tried.flags.iter().enumerate().map(|(cell, &flag)| if worse(cell, flag) { 0 } else { flag }).collect();
        if kept == tried.flags {
            return Self { pairs: after.pairs, ..tried };
        }
        let last = Self { flags: kept, ..tried };
        Self { pairs: last.fit(guide).pairs, ..last }
    }

    /// Position of fine pixel `k` of a cell, in a fine image without border.
    fn fine(&self, cell: usize, k: usize) -> usize {
        let (x, y) = (cell % self.width, cell / self.width);
        (2 * y + k / 2) * 2 * self.width + 2 * x + k % 2
    }

    /// The best pair for every fine pixel.
    fn fit(&self, guide: &Planes) -> Fit {
        let coarse = self.down(guide);
        let rows: Vec<Fit> = (0..guide.height).into_par_iter().map(|y| fit_row(guide, &coarse, y)).collect();
        Fit {
            pairs: rows.iter().flat_map(|row| &row.pairs).copied().collect(),
            left: rows.iter().flat_map(|row| &row.left).copied().collect(),
        }
    }

    /// The coarse image.
    pub fn down(&self, fine: &Planes) -> Planes {
        self.reduce(fine, 0.25)
    }

    /// The variance of [`Resampling::down`] of an image with independent pixels of variance `fine`.
    pub fn down_variance(&self, fine: &Planes) -> Planes {
        self.reduce(fine, 0.0625)
    }

    fn reduce(&self, fine: &Planes, share: f32) -> Planes {
        Planes::from_fn(self.width, self.height, fine.channels(), |c, x, y| {
            let at = |k: usize| fine.at(c, (2 * x + k % 2) as isize, (2 * y + k / 2) as isize);
            match self.flag(x, y) {
                0 => share * (at(0) + at(1) + at(2) + at(3)),
                flag => at(flag as usize - 1),
            }
        })
    }

    /// The fine image.
    pub fn up(&self, coarse: &Planes) -> Planes {
        self.expand(coarse, |weight| weight)
    }

    /// The variance of [`Resampling::up`] of an image with independent pixels of variance `coarse`.
    pub fn up_variance(&self, coarse: &Planes) -> Planes {
        self.expand(coarse, |weight| weight * weight)
    }

    fn expand(&self, coarse: &Planes, share: impl Fn(f32) -> f32 + Sync) -> Planes {
        Planes::from_fn(2 * self.width, 2 * self.height, coarse.channels(), |c, x, y| {
            let (cx, cy) = (x / 2, y / 2);
            if self.pairs.is_empty() {
                let (sx, sy) = (2 * (x % 2) as isize - 1, 2 * (y % 2) as isize - 1);
                let at = |dx: isize, dy: isize| coarse.at(c, cx as isize + dx, cy as isize + dy);
                let beside = share(0.1875) * (at(sx, 0) + at(0, sy));
                return share(0.5625) * at(0, 0) + beside + share(0.0625) * at(sx, sy);
            }
            let Pair { first, second, weight } = self.pairs[y * 2 * self.width + x];
            let at = |k: u8| {
                let (x, y) = around(usize::from(k), cx, cy);
                coarse.at(c, x, y)
            };
            share(weight) * at(first) + share(1.0 - weight) * at(second)
        })
    }

    /// Representative of every coarse pixel: 0 for the mean, 1 to 4 for one of its fine pixels.
    pub fn flag(&self, x: usize, y: usize) -> u8 {
        self.flags[y * self.width + x]
    }
}

/// Most channels of a guide.
const CHANNELS: usize = 9;

vectorized! {
    fn fit_row(guide: &Planes, coarse: &Planes, y: usize) -> Fit {
        let channels = guide.channels().min(CHANNELS);
        let mut fit = Fit { pairs: vec![Pair::default(); guide.width], left: vec![0.0; guide.width] };
        for (x0, odd) in (0..coarse.width).step_by(LANES).flat_map(|x| [(x, 0), (x, 1)]) {
            let mut target = [Lanes::ZERO; CHANNELS];
            let mut near = [[Lanes::ZERO; CHANNELS]; 9];
            let mut away = [Lanes::ZERO; 9];
            for c in 0..channels {
                let row = guide.tail_from(c, (2 * x0 + odd) as isize, y as isize);
                target[c] = Lanes(std::array::from_fn(|l| row[2 * l]));
                for k in 0..9 {
                    let (x, y) = around(k, x0, y / 2);
                    near[k][c] = coarse.lanes(c, x, y);
                    away[k] += (target[c] - near[k][c]) * (target[c] - near[k][c]);
                }
            }
            let (mut best, mut weight, mut code) = (Lanes::splat(f32::INFINITY), Lanes::ZERO, Lanes::ZERO);
            for (a, b) in (0..9).flat_map(|a| (0..a).map(move |b| (a, b))) {
                let (mut dot, mut length) = (Lanes::ZERO, Lanes::ZERO);
                for c in 0..channels {
                    let d = near[a][c] - near[b][c];
                    dot += (target[c] - near[b][c]) * d;
                    length += d * d;
                }
                let share = (dot / (length + Lanes::splat(1e-5))).max(Lanes::ZERO).min(Lanes::splat(1.0));
                let left = away[b] + share * (share * length - dot - dot);
                weight = share.where_greater(best, left, weight);
                code = Lanes::splat((9 * a + b) as f32).where_greater(best, left, code);
                best = best.min(left);
            }
            for l in 0..LANES.min(coarse.width - x0) {
                let (x, code) = (2 * (x0 + l) + odd, code.0[l] as u8);
                fit.pairs[x] = Pair { first: code / 9, second: code % 9, weight: weight.0[l] };
                fit.left[x] = best.0[l].max(0.0).sqrt();
            }
        }
        fit
    }
}

/// Numbers the groups of touching pixels over the tolerance from 1 on; 0 for the others.
fn clusters(error: &[f32], width: usize) -> Vec<u32> {
    let (mut labels, height) = (vec![0u32; error.len()], error.len() / width);
    let (mut count, mut queue) = (0, Vec::new());
    for start in 0..error.len() {
        if error[start] <= TOLERANCE || labels[start] > 0 {
            continue;
        }
        count += 1;
        labels[start] = count;
        queue.push(start);
        while let Some(i) = queue.pop() {
            let (x, y) = (i % width, i / width);
            let ys = y.saturating_sub(1)..(y + 2).min(height);
            let near = ys.flat_map(|y| (x.saturating_sub(1)..(x + 2).min(width)).map(move |x| y * width + x));
            for j in near {
                if error[j] > TOLERANCE && labels[j] == 0 {
                    labels[j] = count;
                    queue.push(j);
                }
            }
        }
    }
    labels
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::rng::{combine, unit};

    fn random(seed: usize, x: usize, y: usize) -> f32 {
        unit(combine(seed as u64, (y * 1000 + x) as u64))
    }

    /// Edges, a thin line and a dot.
    fn picture() -> Planes {
        Planes::from_fn(48, 36, 3, |c, x, y| {
            let block = if x > 13 && y > 9 { 2.0 } else { 0.3 };
            let line = if x + y == 40 { 3.0 } else { 0.0 };
            block + line + if (x, y) == (5, 5) { 9.0 } else { 0.0 } + 0.1 * c as f32
        })
    }

    fn error(a: &Planes, b: &Planes) -> f64 {
        let pixels = (0..a.height as isize).flat_map(|y| (0..a.width as isize).map(move |x| (x, y)));
        pixels.map(|(x, y)| f64::from(a.at(1, x, y) - b.at(1, x, y)).powi(2)).sum()
    }

    #[test]
    fn going_down_and_up_keeps_what_bilinear_interpolation_loses() {
        let picture = picture();
        let guided = Resampling::guided(&picture);
        let bilinear = Resampling::bilinear(48, 36);
        let there_and_back = |choices: &Resampling| choices.up(&choices.down(&picture));
        let (ours, plain) = (error(&there_and_back(&guided), &picture), error(&there_and_back(&bilinear), &picture));
        assert!(ours < 0.1 * plain, "{ours} of {plain}");
        assert!((there_and_back(&guided).at(0, 5, 5) - picture.at(0, 5, 5)).abs() < 1e-4);
        assert!(guided.flags.contains(&0) && guided.flags.iter().any(|&flag| flag > 0));
    }

    #[test]
    fn variances_are_those_of_many_noisy_images() {
        let choices = Resampling::guided(&picture());
        let variance = Planes::from_fn(48, 36, 1, |_, x, y| 0.2 + random(5, x, y));
        let (down, up) = (choices.down_variance(&variance), choices.up_variance(&choices.down_variance(&variance)));
        let (mut seen_down, mut seen_up) = (vec![0.0; 24 * 18], vec![0.0; 48 * 36]);
        let runs = 400;
        for run in 0..runs {
            let noise = |x: usize, y: usize| 12f32.sqrt() * (random(100 + run, x, y) - 0.5);
            let noisy =
                Planes::from_fn(48, 36, 1, |_, x, y| variance.at(0, x as isize, y as isize).sqrt() * noise(x, y));
            let coarse = choices.down(&noisy);
            let fine = choices.up(&coarse);
            let square = |planes: &Planes, i: usize| {
                planes.at(0, (i % planes.width) as isize, (i / planes.width) as isize).powi(2)
            };
            (0..seen_down.len()).for_each(|i| seen_down[i] += square(&coarse, i) / runs as f32);
            (0..seen_up.len()).for_each(|i| seen_up[i] += square(&fine, i) / runs as f32);
        }
        for (seen, planes) in [(seen_down, down), (seen_up, up)] {
            let at = |i: usize| planes.at(0, (i % planes.width) as isize, (i / planes.width) as isize);
            let ratios: Vec<f32> = seen.iter().enumerate().map(|(i, seen)| seen / at(i)).collect();
            let mean = ratios.iter().sum::<f32>() / ratios.len() as f32;
            assert!((mean - 1.0).abs() < 0.02, "{mean}");
            // Relative spread of a variance from so many values is 0.06 or so for sums of uniform noise.
            assert!(ratios.iter().all(|ratio| (0.6..1.5).contains(ratio)));
        }
    }
}
