//! Albedo and normal as guides: cleaned of their own noise, with the differences that are tolerated.

use super::inputs::Inputs;
use crate::error::Result;
use crate::film::{Frame, Layer};
use crate::image::nl_means::Guide;
use crate::image::planes::{PlaneTile, Planes};
use crate::math::lanes::Lanes;

/// A feature of three channels.
#[derive(Clone)]
pub struct Feature {
    /// Kind of the feature.
    pub kind: Kind,
    /// The values.
    pub mean: Planes,
    /// Variance of the mean, sum over the channels.
    pub variance: Planes,
}

/// Features that are used.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Material colour.
    Albedo,
    /// Shading normal.
    Normal,
}

impl Kind {
    /// Its mean and its variance.
    pub fn layers(self) -> [Layer; 2] {
        match self {
            Self::Albedo => [Layer::Albedo, Layer::AlbedoVariance],
            Self::Normal => [Layer::Normal, Layer::NormalVariance],
        }
    }
}

/// The warning that a method does without features that a frame lacks, of those that it takes.
pub fn without_features<const N: usize>(frame: &Frame, method: &str, taken: [Layer; N]) -> Vec<String> {
    let missing: Vec<_> = taken.iter().filter(|&&layer| frame.get(layer).is_none()).map(|layer| layer.name()).collect();
    let what = || format!("the frame lacks {}: {method} works without, and keeps fewer edges", missing.join(", "));
    if missing.is_empty() { Vec::new() } else { vec![what()] }
}

/// Beyond two pixels the weights of [`Feature::clean`] are e^-9 or less.
const RADIUS: isize = 2;

/// Squared differences of less than this per channel count as alike.
const ALIKE: f32 = 1e-3;

impl Feature {
    /// A feature of a frame, cleaned.
    pub fn of(kind: Kind, inputs: &Inputs) -> Result<Self> {
        let [mean, variance] = kind.layers();
        Ok(Self::clean(kind, &inputs.planes(mean, 1.0)?, &inputs.planes(variance, 1.0)?))
    }

    /// A feature cleaned by a bilateral filter: pixels whose difference noise explains are averaged.
    pub fn clean(kind: Kind, mean: &Planes, variance: &Planes) -> Self {
        let noise = variance.sum();
        let planes = Planes::from_tiles(mean.width, mean.height, 4, |tile| clean_tile(mean, &noise, tile));
        Self { kind, mean: planes.part(0, 3), variance: planes.part(3, 1) }
    }

    /// The feature as a guide of filters. Differences up to the noise, or up to those between neighbours, are tolerated.
    pub fn guide(&self) -> Guide {
        let mean = &self.mean;
        let tolerance = Planes::from_fn(mean.width, mean.height, 1, |_, x, y| {
            let (x, y) = (x as isize, y as isize);
            let squares = |c: usize| {
                let here = mean.at(c, x, y);
                let half = |dx: isize, dy: isize| ((mean.at(c, x + dx, y + dy) - here) * 0.5).powi(2);
                let slope = half(1, 0).min(half(-1, 0)) + half(0, 1).min(half(0, -1));
                slope.max(ALIKE)
            };
            (squares(0) + squares(1) + squares(2)).max(self.variance.at(0, x, y))
        });
        Guide { mean: mean.clone(), variance: self.variance.clone(), tolerance: Some(tolerance) }
    }
}

vectorized! {
    fn clean_tile(mean: &Planes, noise: &Planes, tile: PlaneTile) -> Vec<f32> {
        let mut out = vec![0.0; 4 * tile.width * tile.height];
        for (x, y) in tile.blocks() {
            let at = ((tile.x + x) as isize, (tile.y + y) as isize);
            let centre: [Lanes; 3] = std::array::from_fn(|c| mean.lanes(c, at.0, at.1));
            let here = noise.lanes(0, at.0, at.1);
            let tolerance = (here * Lanes::splat(100.0)).max(Lanes::splat(1e-4));
            let (mut total, mut variance, mut sums) = (Lanes::ZERO, Lanes::ZERO, [Lanes::ZERO; 3]);
            for (dx, dy) in (-RADIUS..=RADIUS).flat_map(|dy| (-RADIUS..=RADIUS).map(move |dx| (dx, dy))) {
                let q = (at.0 + dx, at.1 + dy);
                let values: [Lanes; 3] = std::array::from_fn(|c| mean.lanes(c, q.0, q.1));
                let there = noise.lanes(0, q.0, q.1);
                let mut beyond = Lanes::ZERO - (here + there);
                for c in 0..3 {
                    beyond += (values[c] - centre[c]) * (values[c] - centre[c]);
                }
                let far = beyond.max(Lanes::ZERO) / tolerance + Lanes::splat((dx * dx + dy * dy) as f32);
                let weight = (Lanes::ZERO - far).exp_negative();
                total += weight;
                variance += weight * weight * there;
                for c in 0..3 {
                    sums[c] += weight * values[c];
                }
            }
            for (c, sum) in sums.into_iter().enumerate() {
                tile.put(&mut out, c, x, y, sum / total);
            }
            tile.put(&mut out, 3, x, y, variance / (total * total));
        }
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::rng::{combine, unit};

    #[test]
    fn noise_goes_and_edges_stay() {
        let truth = |x: usize| if x < 20 { 0.2 } else { 0.8 };
        let noise = 0.05f32;
        let sample = |c: usize, x: usize, y: usize| unit(combine(c as u64, (y * 64 + x) as u64)) - 0.5;
        let noisy = Planes::from_fn(40, 30, 3, |c, x, y| truth(x) + noise * 12f32.sqrt() * sample(c, x, y));
        let variance = Planes::from_fn(40, 30, 3, |_, _, _| noise * noise);
        let clean = Feature::clean(Kind::Albedo, &noisy, &variance);
        let error = |planes: &Planes| {
            let pixels = (0..30).flat_map(|y| (0..40).map(move |x| (x, y)));
            pixels.map(|(x, y)| (planes.at(0, x, y) - truth(x as usize)).powi(2)).sum::<f32>() / 1200.0
        };
        assert!(error(&clean.mean) < 0.4 * error(&noisy), "{} of {}", error(&clean.mean), error(&noisy));
        let exact = Planes::from_fn(40, 30, 3, |_, x, _| truth(x));
        let still = Feature::clean(Kind::Albedo, &exact, &Planes::new(40, 30, 3));
        assert!((0..40).all(|x| (still.mean.at(1, x, 9) - truth(x as usize)).abs() < 1e-6));
    }
}
