//! Camera samples of a wave: the pixels of a tile, all at the same position within the pixel.

use super::Sampler;
use crate::math::lanes::{Bits, LANES, Lanes};
use crate::math::{Vec2, vec2};
use crate::scene::Scene;
use crate::scene::packet::Rays;

/// One sample of each of some pixels, and their random numbers.
#[derive(Clone, Copy)]
pub struct CameraSamples<'a> {
    /// Random numbers of samples with this index.
    pub sampler: Sampler,
    /// Column and row of every pixel.
    pub pixels: &'a [(usize, usize)],
    /// Position within the pixels, in [0, 1)².
    pub film: Vec2,
    /// Columns and rows of the film.
    pub size: (usize, usize),
}

impl<'a> CameraSamples<'a> {
    /// Sample number `index` of the pixels.
    pub fn new(scene: &Scene, seed: u64, index: u32, pixels: &'a [(usize, usize)]) -> Self {
        let sampler = Sampler::new(seed, index);
        Self { sampler, pixels, film: sampler.film(), size: (scene.sensor().width, scene.sensor().height) }
    }

    /// Hash that keeps the random numbers of a pixel of the list apart.
    pub fn hash(&self, index: usize) -> u32 {
        let (x, y) = self.pixels[index];
        self.sampler.hash((y * self.size.0 + x) as u64)
    }

    /// Hashes that keep the random numbers of sixteen pixels apart, from pixel `first` of the list on.
    pub fn hashes(&self, first: usize) -> Bits {
        let mut hashes = Bits::ZERO;
        for (hash, index) in hashes.0.iter_mut().zip(first..self.pixels.len()) {
            *hash = self.hash(index);
        }
        hashes
    }

    /// Camera rays through sixteen film positions: those of the pixels from `first` on, as many pixels beside them as `steps` says
    /// for each, if it does.
    pub fn rays(&self, scene: &Scene, first: usize, hashes: Bits, steps: &[(i32, i32)]) -> Rays {
        let mut at = [Lanes::ZERO; 2];
        for (lane, &(x, y)) in self.pixels[first..].iter().take(LANES).enumerate() {
            let step = steps.get(lane).map_or(Vec2::ZERO, |&(x, y)| vec2(x as f32, y as f32));
            let film = vec2(x as f32, y as f32) + self.film + step;
            (at[0].0[lane], at[1].0[lane]) = film.into();
        }
        self.rays_through(scene, at, hashes)
    }

    /// Camera rays through any sixteen film positions.
    pub fn rays_through(&self, scene: &Scene, at: [Lanes; 2], hashes: Bits) -> Rays {
        let sensor = scene.sensor();
        let lens = if sensor.has_lens() { self.sampler.lens(hashes) } else { [Lanes::ZERO; 2] };
        sensor.rays(at, lens)
    }

    /// The pixel `step` beside another one, unless it lies outside the film.
    pub fn neighbour(&self, (x, y): (usize, usize), step: (i32, i32)) -> Option<(usize, usize)> {
        let x = x.checked_add_signed(step.0 as isize).filter(|&x| x < self.size.0)?;
        let y = y.checked_add_signed(step.1 as isize).filter(|&y| y < self.size.1)?;
        Some((x, y))
    }
}
