//! From estimated errors to needs, and from needs to sample counts.

use crate::error::Result;
use crate::film::{Frame, Layer};
use crate::image::Image;
use crate::image::planes::Planes;
use crate::math::rng;

/// Radius of the squares that needs are averaged over: error estimates of single pixels are noisy, and a pixel's samples
/// improve those around it, too.
const RADIUS: usize = 3;

/// Floor of the luminance that errors are relative to, over the image's mean: like that of relMSE, at any exposure.
const DARK: f64 = 0.2;

/// Share of the samples that are spread evenly, so that no pixel is starved by a bad estimate: methods darken what has few
/// samples, and their estimates do not show all of it. A quarter gains as much where estimates are good, and loses where not.
const MINIMUM: f64 = 0.5;

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

/// Allocates `samples` to pixels that have `counts` so far, so that the totals are as nearly proportional to `need` as
/// possible. The result's sum is `samples` exactly.
pub fn allocate(need: &[f32], counts: &[u32], samples: u64) -> Vec<u32> {
    let even = samples as f64 / need.len() as f64;
    let (alike, most) = (MINIMUM * even, MOST * even);
    // The new samples of a pixel if the totals are `level` times the needs.
    let share = |level: f64, i: usize| (level * f64::from(need[i].max(0.0)) - f64::from(counts[i])).clamp(alike, most);
    let total = |level: f64| (0..need.len()).map(|i| share(level, i)).sum::<f64>();
    let (mut low, mut high) = (0.0, 1.0);
    while total(high) < samples as f64 && high < 1e30 {
        (low, high) = (high, high * 4.0);
    }
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if total(middle) < samples as f64 { low = middle } else { high = middle }
    }
    round(|i| share(low, i), need.len(), samples)
}

/// Integers near shares, with a given sum: the remainder of a pixel is carried over to the next, from a random start.
fn round(share: impl Fn(usize) -> f64, pixels: usize, samples: u64) -> Vec<u32> {
    let scale = samples as f64 / (0..pixels).map(&share).sum::<f64>().max(1e-300);
    let start = f64::from(rng::unit(rng::combine(samples, pixels as u64)));
    let (mut sum, mut given) = (start, 0);
    let mut counts: Vec<u32> = (0..pixels)
        .map(|i| {
            sum += share(i) * scale;
            let count = (sum as u64).min(samples) - given;
            given += count;
            count as u32
        })
        .collect();
    // Rounding of the sum itself.
    if let Some(last) = counts.last_mut() {
        *last += (samples - given) as u32;
    }
    counts
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn budgets_are_met_to_the_sample_and_everyone_gets_a_share() {
        for (pixels, samples) in [(1, 7), (100, 3), (1000, 12345), (4096, 1 << 20)] {
            for spread in [0.0, 1.0, 20.0] {
                let need: Vec<f32> =
                    (0..pixels).map(|i| (spread * rng::unit(rng::combine(3, i as u64))).exp() - 1.0).collect();
                let before: Vec<u32> = (0..pixels as u32).map(|i| i % 17).collect();
                let counts = allocate(&need, &before, samples);
                assert_eq!(counts.iter().map(|&n| u64::from(n)).sum::<u64>(), samples);
                let even = samples as f64 / pixels as f64;
                assert!(counts.iter().all(|&n| f64::from(n) >= (0.45 * even).floor()), "{pixels} {samples} {spread}");
            }
        }
    }

    #[test]
    fn totals_are_proportional_to_needs() {
        let need: Vec<f32> = (0..100).map(|i| if i < 50 { 2.0 } else { 3.0 }).collect();
        let before = vec![10; 100];
        let counts = allocate(&need, &before, 3000);
        // 4000 in all: 32 for each of the first half, 48 for each of the second.
        assert!(counts[..50].iter().all(|&n| n.abs_diff(22) <= 1));
        assert!(counts[50..].iter().all(|&n| n.abs_diff(38) <= 1));
    }
}
