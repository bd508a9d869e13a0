//! Non-local means: pixels are averaged with those whose surroundings look the same, as far as noise lets this be seen
//! (Buades et al. 2005; Rousselle et al. 2012, 2013).

mod distance;
pub mod rdfc;

pub use self::distance::Guide;
use self::distance::{Other, Patches};
use super::planes::{PlaneTile, Planes};
use crate::math::lanes::{LANES, Lanes};

/// Guides that pixels are compared by: colours over patches, and features, of which the largest distance counts.
pub struct Guides {
    /// The colour.
    pub color: Guide,
    /// Albedo, normal and the like.
    pub features: Vec<Guide>,
}

impl Guides {
    /// Rows `y..y + height`, with the rows around them as border.
    pub fn band(&self, y: usize, height: usize) -> Self {
        let cut = |guide: &Guide| Guide {
            mean: guide.mean.band(y, height),
            variance: guide.variance.band(y, height),
            tolerance: guide.tolerance.as_ref().map(|tolerance| tolerance.band(y, height)),
        };
        Self { color: cut(&self.color), features: self.features.iter().map(cut).collect() }
    }

    /// The largest distance of any feature, at least zero.
    #[inline(always)]
    fn apart(&self, at: (isize, isize), other: Other, k2: f32) -> Lanes {
        self.features.iter().fold(Lanes::ZERO, |apart, guide| apart.max(guide.distance(at, other, k2)))
    }
}

/// How alike pixels must be.
#[derive(Clone, Copy)]
pub struct NlmSettings {
    /// Radius of the window of pixels that are averaged.
    pub window: usize,
    /// Radius of the patches that are compared.
    pub patch: usize,
    /// Tolerance of colours, in standard deviations.
    pub color: f32,
    /// Tolerance of features; none to leave them out.
    pub feature: Option<f32>,
}

/// Averages the planes of `values`. The window and a patch must fit in the border.
pub fn filter(values: &Planes, guides: &Guides, settings: NlmSettings) -> Planes {
    Planes::from_tiles(values.width, values.height, values.channels(), |tile| {
        filter_tile(values, guides, settings, tile)
    })
}

/// An image cleaned of its own noise, as auxiliary ones are: windows of 11x11 pixels, patches of 7x7.
pub fn clean(noisy: &Guide, tolerance: f32) -> Planes {
    let Guide { mean, variance, tolerance: limit } = noisy;
    let color = Guide { mean: mean.clone(), variance: variance.clone(), tolerance: limit.clone() };
    let settings = NlmSettings { window: 5, patch: 3, color: tolerance, feature: None };
    filter(mean, &Guides { color, features: Vec::new() }, settings)
}

vectorized! {
    /// Weights of a tile's pixels for those of their windows, centres included, by colour alone. For each of the tile's
    /// blocks the offsets follow each other, row by row, with a weight for every pixel. Those outside the image have none.
    pub fn weights(guide: &Guide, settings: NlmSettings, tile: PlaneTile) -> Vec<f32> {
        let offsets = (2 * settings.window + 1).pow(2);
        let mut weights = vec![0.0; offsets * tile.height * tile.width.next_multiple_of(LANES)];
        let mut patches = Patches::new(tile, settings.patch, 1);
        for (k, (dx, dy)) in window(settings.window).enumerate() {
            patches.compare(guide, Other::At(dx, dy), settings.color * settings.color, &[settings.patch]);
            for (block, (x, y)) in tile.blocks().enumerate() {
                let distance = patches.mean(0, settings.patch, x, y).max(Lanes::ZERO);
                let mut weight = (Lanes::ZERO - distance).exp_negative();
                let row = (tile.y + y) as isize + dy;
                let column = (tile.x + x) as isize + dx;
                let rows = 0..guide.mean.height as isize;
                for (i, weight) in weight.0.iter_mut().enumerate() {
                    let inside = (0..guide.mean.width as isize).contains(&(column + i as isize));
                    if !(inside && rows.contains(&row) && x + i < tile.width) {
                        *weight = 0.0;
                    }
                }
                weight.store(&mut weights[(block * offsets + k) * LANES..]);
            }
        }
        weights
    }
}

/// Offsets of a window, row by row.
fn window(radius: usize) -> impl Iterator<Item = (isize, isize)> {
    let r = radius as isize;
    (-r..=r).flat_map(move |dy| (-r..=r).map(move |dx| (dx, dy)))
}

/// Offsets of a window except the centre.
fn offsets(radius: usize) -> impl Iterator<Item = (isize, isize)> {
    window(radius).filter(|&offset| offset != (0, 0))
}

vectorized! {
    fn filter_tile(values: &Planes, guides: &Guides, settings: NlmSettings, tile: PlaneTile) -> Vec<f32> {
        let width = tile.width.next_multiple_of(LANES);
        let channels = values.channels();
        let mut patches = Patches::new(tile, settings.patch, 1);
        // Total weight, largest weight, and the sums of each channel.
        let mut sums = vec![Lanes::ZERO; (2 + channels) * tile.height * width / LANES];
        for (dx, dy) in offsets(settings.window) {
            patches.compare(&guides.color, Other::At(dx, dy), settings.color * settings.color, &[settings.patch]);
            for ((x, y), sums) in tile.blocks().zip(sums.chunks_exact_mut(2 + channels)) {
                let (px, py) = ((tile.x + x) as isize, (tile.y + y) as isize);
                let mut distance = patches.mean(0, settings.patch, x, y).max(Lanes::ZERO);
                if let Some(k) = settings.feature {
                    distance = distance.max(guides.apart((px, py), Other::At(dx, dy), k * k));
                }
                let weight = (Lanes::ZERO - distance).exp_negative();
                sums[0] += weight;
                sums[1] = sums[1].max(weight);
                for c in 0..channels {
                    sums[2 + c] += weight * values.lanes(c, px + dx, py + dy);
                }
            }
        }
        let mut out = vec![0.0; channels * tile.width * tile.height];
        for ((x, y), sums) in tile.blocks().zip(sums.chunks_exact(2 + channels)) {
            // The centre is like itself, but no more so than the best of the others: its noise is its own.
            let centre = sums[1].max(Lanes::splat(1e-3));
            for c in 0..channels {
                let value = values.lanes(c, (tile.x + x) as isize, (tile.y + y) as isize);
                let mean = (sums[2 + c] + centre * value) / (sums[0] + centre);
                tile.put(&mut out, c, x, y, mean);
            }
        }
        out
    }
}
