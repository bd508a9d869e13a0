//! Costs of samples from pixel to pixel.

use rayon::prelude::*;

use super::RenderSettings;
use super::outcome::RenderOutcome;
use super::wave::Wave;
use crate::film::{Kernel, TILE};
use crate::scene::Scene;

/// Cost of a sample of every pixel, row by row, in rays of paths. Rays are counted, not timed, in the first sample of every tile, so
/// that decisions by costs are the same on any machine.
pub fn sample_costs(scene: &Scene, settings: RenderSettings, outcome: &RenderOutcome) -> Vec<f32> {
    let (width, height) = (outcome.film.width, outcome.film.height);
    let neighbours = if let Kernel::Chosen(neighbours) = outcome.film.kernel() { Some(&**neighbours) } else { None };
    let wave_of = || Wave::new(scene, settings.needs, settings.shift, neighbours);
    let corners: Vec<_> =
        (0..height).step_by(TILE).flat_map(|y| (0..width).step_by(TILE).map(move |x| (x, y))).collect();
    let of_tile = |wave: &mut Wave, (number, &(left, top)): (usize, &(usize, usize))| {
        let rows = top..(top + TILE).min(height);
        let pixels: Vec<_> = rows.flat_map(|y| (left..(left + TILE).min(width)).map(move |x| (x, y))).collect();
        let work = outcome.choices.shares.work(number, || {
            wave.trace((settings.seed, 0), &pixels, &[], true);
            wave.work()
        });
        (work.per_sample(pixels.len()), pixels)
    };
    let mut costs = vec![0.0; width * height];
    for (cost, pixels) in corners.par_iter().enumerate().map_init(wave_of, of_tile).collect::<Vec<_>>() {
        pixels.iter().for_each(|&(x, y)| costs[y * width + x] = cost);
    }
    costs
}
