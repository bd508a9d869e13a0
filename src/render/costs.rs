//! Costs of samples from pixel to pixel.

use rayon::prelude::*;

use super::RenderSettings;
use super::outcome::RenderOutcome;
use super::wave::Wave;
use crate::film::Tile;
use crate::scene::Scene;

/// Cost of a sample of every pixel, row by row, in rays of paths. Rays are counted, not timed, in the first sample of every tile, so
/// that decisions by costs are the same on any machine.
pub fn sample_costs(scene: &Scene, settings: RenderSettings, outcome: &RenderOutcome) -> Vec<f32> {
    let RenderOutcome { film, choices, .. } = outcome;
    let wave_of = || Wave::new(scene, settings.needs, settings.shift, film.kernel().neighbours());
    let of_tile = |wave: &mut Wave, (number, tile): (usize, &Tile)| {
        let pixels = tile.pixels();
        let work = choices.shares.work(number, || wave.first_work(settings.seed, &pixels));
        (work.per_sample(pixels.len()), pixels)
    };
    let mut costs = vec![0.0; film.width * film.height];
    for (cost, pixels) in film.tiles().par_iter().enumerate().map_init(wave_of, of_tile).collect::<Vec<_>>() {
        pixels.iter().for_each(|&(x, y)| costs[y * film.width + x] = cost);
    }
    costs
}
