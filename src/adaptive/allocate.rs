//! From estimated errors to needs, and from needs to sample counts.

use crate::error::Result;
use crate::film::{Frame, Layer};
use crate::image::Image;
use crate::image::planes::Planes;

/// Radius of the squares that needs are averaged over: error estimates of single pixels are noisy, and a pixel's samples
/// improve those around it, too.
const RADIUS: usize = 3;

/// Floor of the luminance that errors are relative to, over the image's mean: like that of relMSE, at any exposure.
const DARK: f64 = 0.2;

/// Share of the samples that are spread evenly, so that no pixel is starved by a bad estimate: methods darken what has few
/// samples, and their estimates do not show all of it. A quarter gains as much where estimates are good, and loses where not.
const MINIMUM: f64 = 0.5;

/// Side of the squares of pixels that are allocated samples together, so that their paths fill packets to the last sample.
const BLOCK: usize = 4;

/// Exponent of deviations over costs that totals of samples are proportional to. It makes the mean of the deviations that are left,
/// Σ deviation / √samples, least for its cost; squares of them would ask for deviation / √cost, which leaves more for the eye to see.
const EXPONENT: f64 = 2.0 / 3.0;

/// Largest number of samples that a pixel gets, over that of even samples.
const MOST: f64 = 16.0;

/// Standard deviations of single samples, relative to the image's brightness: an `error` that falls with the number of
/// samples is this, squared, over the number. Means are those of deviations rather than of squares, which single fireflies would
/// own.
pub fn need(frame: &Frame, image: &Image, error: &Image) -> Result<Vec<f32>> {
    let samples = frame.require(Layer::Samples)?;
    let (width, height) = (frame.width, frame.height);
    let mean = image.data.iter().map(|&value| f64::from(value.max(0.0))).sum::<f64>() / image.data.len() as f64;
    let floor = ((DARK * mean).powi(2) as f32).max(1e-30);
    let deviations = Planes::from_fn(width, height, 1, |_, x, y| {
        let both = image.pixel(x, y).iter().zip(error.pixel(x, y));
        let relative: f32 = both.map(|(value, error)| error / (value * value + floor)).sum();
        (relative * samples.pixel(x, y)[0]).max(0.0).sqrt()
    });
    Ok(deviations.box_mean(RADIUS).to_image(width, height, 1.0).data)
}

/// Needs and costs of the pixels that samples are allocated to.
pub struct Demand<'a> {
    /// Columns.
    pub width: usize,
    /// Deviations of single samples, row by row.
    pub need: &'a [f32],
    /// Costs of single samples.
    pub cost: &'a [f32],
    /// Samples so far.
    pub counts: &'a [u32],
}

/// Pixels that are allocated samples together.
struct Block {
    pixels: Vec<usize>,
    /// Number that the totals of its pixels are to be proportional to.
    weight: f64,
    /// Mean samples of its pixels so far.
    count: f64,
}

impl Demand<'_> {
    fn blocks(&self) -> Vec<Block> {
        let height = self.need.len() / self.width;
        let corners = (0..height).step_by(BLOCK).flat_map(|y| (0..self.width).step_by(BLOCK).map(move |x| (x, y)));
        let of_corner = |(left, top): (usize, usize)| {
            let columns = left..(left + BLOCK).min(self.width);
            let rows = top..(top + BLOCK).min(height);
            let pixels: Vec<_> = rows.flat_map(|y| columns.clone().map(move |x| y * self.width + x)).collect();
            let mean = |of: &dyn Fn(usize) -> f64| pixels.iter().map(|&i| of(i)).sum::<f64>() / pixels.len() as f64;
            let weight = mean(&|i| f64::from(self.need[i].max(0.0) / self.cost[i]).powf(EXPONENT));
            let count = mean(&|i| f64::from(self.counts[i]));
            Block { pixels, weight, count }
        };
        corners.map(of_corner).collect()
    }
}

/// Allocates `samples`, so that the totals are as nearly as possible those of the least relative error for the cost. The result's
/// sum is `samples` exactly.
pub fn allocate(demand: &Demand, samples: u64) -> Vec<u32> {
    let blocks = demand.blocks();
    let even = samples as f64 / demand.need.len() as f64;
    let (alike, most) = (MINIMUM * even, MOST * even);
    // The new samples of each pixel of a block if the totals are `level` times the weights.
    let share = |level: f64, block: &Block| (level * block.weight - block.count).clamp(alike, most);
    let total = |level: f64| blocks.iter().map(|block| share(level, block) * block.pixels.len() as f64).sum::<f64>();
    let (mut low, mut high) = (0.0, 1.0);
    while total(high) < samples as f64 && high < 1e30 {
        (low, high) = (high, high * 4.0);
    }
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if total(middle) < samples as f64 { low = middle } else { high = middle }
    }
    round(&blocks, |block| share(low, block), (demand.need.len(), samples))
}

/// Integers near the shares of blocks, with a given sum: the remainder of a block is carried over to the next.
fn round(blocks: &[Block], share: impl Fn(&Block) -> f64, (pixels, samples): (usize, u64)) -> Vec<u32> {
    let all: f64 = blocks.iter().map(|block| share(block) * block.pixels.len() as f64).sum();
    let scale = samples as f64 / all.max(1e-300);
    let mut counts = vec![0; pixels];
    let (mut due, mut left) = (0.0, samples);
    for block in blocks {
        let size = block.pixels.len() as u64;
        due += share(block) * scale * size as f64;
        let each = (due as u64).min(left) / size;
        block.pixels.iter().for_each(|&pixel| counts[pixel] = each as u32);
        (due, left) = (due - (each * size) as f64, left - each * size);
    }
    // The rest is too little for one more block.
    counts.iter_mut().rev().zip(0..left).for_each(|(count, _)| *count += 1);
    counts
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::rng;

    fn demand<'a>(width: usize, [need, cost]: [&'a [f32]; 2], counts: &'a [u32]) -> Demand<'a> {
        Demand { width, need, cost, counts }
    }

    #[test]
    fn budgets_are_met_to_the_sample_and_everyone_gets_a_share() {
        for (width, pixels, samples) in [(1, 1, 7), (10, 100, 3), (50, 1000, 12345), (33, 33 * 41, 1 << 18)] {
            for spread in [0.0, 1.0, 20.0] {
                let random = |salt: u64, i: usize| rng::unit(rng::combine(salt, i as u64));
                let need: Vec<f32> = (0..pixels).map(|i| (spread * random(3, i)).exp() - 1.0).collect();
                let cost: Vec<f32> = (0..pixels).map(|i| 1.0 + random(4, i)).collect();
                let before: Vec<u32> = (0..pixels as u32).map(|i| i % 17).collect();
                let counts = allocate(&demand(width, [&need, &cost], &before), samples);
                assert_eq!(counts.iter().map(|&n| u64::from(n)).sum::<u64>(), samples);
                let even = samples as f64 / pixels as f64;
                let least = (0.45 * even).floor() - 1.0;
                assert!(counts.iter().all(|&n| f64::from(n) >= least), "{pixels} {samples} {spread}");
            }
        }
    }

    #[test]
    fn totals_leave_the_least_deviation_for_their_cost() {
        let halves =
            |first: f32, second: f32| -> Vec<f32> { (0..128).map(|i| if i < 64 { first } else { second }).collect() };
        let (need, cost, before) = (halves(2.0, 3.0), halves(1.0, 2.0), vec![100; 128]);
        let counts = allocate(&demand(16, [&need, &cost], &before), 128 * 300);
        // The last sample saves the same deviation for its cost everywhere.
        let saved = |i: usize| f64::from(need[i] / cost[i]) * f64::from(counts[i] + before[i]).powf(-1.5);
        assert!((saved(0) / saved(127) - 1.0).abs() < 0.05, "{counts:?}");
        assert!(counts[..64].iter().all(|&n| n.abs_diff(counts[0]) <= 1));
    }

    #[test]
    fn pixels_of_a_block_get_the_same() {
        let need: Vec<f32> = (0..400).map(|i| rng::unit(rng::combine(5, i))).collect();
        let counts = allocate(&demand(20, [&need, &[1.0; 400]], &[0; 400]), 400 * 23);
        for block in (0..20).step_by(4).flat_map(|y| (0..20).step_by(4).map(move |x| y * 20 + x)).take(24) {
            assert!((0..16).all(|i| counts[block + i / 4 * 20 + i % 4] == counts[block]), "{block}");
        }
    }
}
