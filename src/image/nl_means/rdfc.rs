//! Robust denoising using feature and colour information (Rousselle et al. 2013): three filters of different
//! sensitivity, of which each pixel takes the one with the least estimated error.

use super::distance::{Other, Patches};
use super::{Guide, Guides, NlmSettings, filter, offsets};
use crate::image::planes::{PlaneTile, Planes};
use crate::math::lanes::{LANES, Lanes};

/// Colour distances of the three filters: two patch sizes, and no colours at all.
const PATCHES: [usize; 2] = [1, 3];
const COLOR_TOLERANCE: f32 = 0.45;
const FEATURE_TOLERANCE: f32 = 0.6;

/// Parameters of the method.
#[derive(Clone, Copy, Debug)]
pub struct Options {
    /// Radius of the window.
    pub window: usize,
    /// Whether opposite pixels whose mean fits better than they do are weighted by how well it does.
    pub symmetric: bool,
    /// Radius of the window that the choice between the filters is smoothed over; zero to take it pixel by pixel, from
    /// errors that are not smoothed either.
    pub choice: usize,
    /// Most rows to work on at a time; the result does not depend on it.
    pub rows: usize,
}

/// A denoised image and its estimated squared error, mean over the channels.
pub struct Denoised {
    /// The image.
    pub image: Planes,
    /// Stein's unbiased estimate of its squared error, smoothed; may be negative.
    pub error: Planes,
}

/// Rows that smoothing the errors and the choice between the filters looks beyond a band.
const OVERLAP: usize = 4;

/// Denoises a colour image; `progress` is called with the finished share.
pub fn denoise(guides: &Guides, options: Options, progress: &dyn Fn(f32)) -> Denoised {
    let (width, height) = (guides.color.mean.width, guides.color.mean.height);
    if options.rows >= height {
        return denoise_band(guides, options);
    }
    let mut all = Denoised { image: Planes::new(width, height, 3), error: Planes::new(width, height, 1) };
    for y in (0..height).step_by(options.rows) {
        let rows = y..height.min(y + options.rows);
        let top = y.saturating_sub(OVERLAP);
        let bottom = height.min(rows.end + OVERLAP);
        let band = denoise_band(&guides.band(top, bottom - top), options);
        all.image.put_rows(rows.clone(), &band.image, y - top);
        all.error.put_rows(rows.clone(), &band.error, y - top);
        progress(rows.end as f32 / height as f32);
    }
    all.image.mirror_border();
    all.error.mirror_border();
    all
}

fn denoise_band(guides: &Guides, options: Options) -> Denoised {
    let (width, height) = (guides.color.mean.width, guides.color.mean.height);
    let candidates = Planes::from_tiles(width, height, 3 * 5, |tile| denoise_tile(guides, tile, options));
    let errors = candidates.part(9, 3);
    let smooth = options.choice > 0;
    let of_errors = NlmSettings { window: 1, patch: 3, color: 1.0, feature: None };
    let errors = if smooth { filter(&errors, guides, of_errors) } else { errors };
    let best = |x: isize, y: isize| {
        let slope = |k: usize| candidates.at(12 + k, x, y);
        let first = usize::from(smooth && slope(0) >= slope(1));
        (first..3).min_by(|&a, &b| errors.at(a, x, y).total_cmp(&errors.at(b, x, y))).unwrap_or(2)
    };
    let mut choice =
        Planes::from_fn(width, height, 3, |k, x, y| f32::from(u8::from(best(x as isize, y as isize) == k)));
    if smooth {
        let of_choice = NlmSettings { window: options.choice, patch: 1, color: 0.5, feature: Some(FEATURE_TOLERANCE) };
        choice = filter(&choice, guides, of_choice);
    }
    let blend = |from: &Planes, first: usize, step: usize, x: usize, y: usize| {
        let (x, y) = (x as isize, y as isize);
        (0..3).map(|k| choice.at(k, x, y) * from.at(first + step * k, x, y)).sum()
    };
    Denoised {
        image: Planes::from_fn(width, height, 3, |c, x, y| blend(&candidates, c, 3, x, y)),
        error: Planes::from_fn(width, height, 1, |_, x, y| blend(&errors, 0, 1, x, y)),
    }
}

/// Sums of one filter over the windows of some pixels.
#[derive(Clone, Copy)]
#[repr(align(64))]
struct Sums {
    weight: Lanes,
    largest: Lanes,
    /// Weighted mean of the differences to the centre.
    color: [Lanes; 3],
    /// Contribution of the weights' dependence on the centre's colour to the derivative of the result.
    weight_derivative: Lanes,
    /// Differences to the centre, weighted by the part of the weights that depends on the centre's colour.
    weighted_steps: [Lanes; 3],
}

const EMPTY: Sums = Sums {
    weight: Lanes::ZERO,
    largest: Lanes::ZERO,
    color: [Lanes::ZERO; 3],
    weight_derivative: Lanes::ZERO,
    weighted_steps: [Lanes::ZERO; 3],
};

/// A pixel of the window, seen from the centre.
#[repr(align(64))]
struct Neighbour {
    step: [Lanes; 3],
    square: Lanes,
    /// Normalisation of the distances.
    noise: Lanes,
}

impl Neighbour {
    #[inline(always)]
    fn new(guides: &Guides, (x, y): (isize, isize), (dx, dy): (isize, isize)) -> Self {
        let Guide { mean, variance, .. } = &guides.color;
        let mut step = [Lanes::ZERO; 3];
        let mut square = Lanes::ZERO;
        for (c, step) in step.iter_mut().enumerate() {
            *step = mean.lanes(c, x + dx, y + dy) - mean.lanes(c, x, y);
            square += *step * *step;
        }
        let both = variance.lanes(0, x, y) + variance.lanes(0, x + dx, y + dy);
        let noise = Lanes::splat(1e-10) + Lanes::splat(COLOR_TOLERANCE * COLOR_TOLERANCE) * both;
        Self { step, square, noise }
    }
}

impl Sums {
    /// Adds a pixel; `follows` is its weight where that depends on the colour, and zero elsewhere.
    #[inline(always)]
    fn add(&mut self, pixel: &Neighbour, weight: Lanes, follows: Lanes) {
        self.weight += weight;
        self.largest = self.largest.max(weight);
        let follows = follows / pixel.noise;
        self.weight_derivative += follows * pixel.square;
        for c in 0..3 {
            self.color[c] += weight * pixel.step[c];
            self.weighted_steps[c] += follows * pixel.step[c];
        }
    }
}

/// Distances by colour of the filter `k`, and the largest by any feature.
#[inline(always)]
fn alike(patches: &Patches, k: usize, x: usize, y: usize) -> Lanes {
    if k < 2 { patches.mean(k, PATCHES[k], x, y) } else { Lanes::ZERO }
}

vectorized! {
    /// Nine planes of filtered colours, three of errors, three of slopes.
    fn denoise_tile(guides: &Guides, tile: PlaneTile, options: Options) -> Vec<f32> {
        let width = tile.width.next_multiple_of(LANES);
        let mut sums = vec![[EMPTY; 3]; tile.height * width / LANES];
        if options.symmetric {
            add_pairs(guides, tile, options.window, &mut sums);
        } else {
            add_pixels(guides, tile, options.window, &mut sums);
        }
        finish(guides, tile, &sums)
    }
}

#[inline(always)]
fn add_pixels(guides: &Guides, tile: PlaneTile, window: usize, sums: &mut [[Sums; 3]]) {
    let mut patches = Patches::new(tile, PATCHES[1], 2);
    for (dx, dy) in offsets(window) {
        let other = Other::At(dx, dy);
        patches.compare(&guides.color, other, COLOR_TOLERANCE * COLOR_TOLERANCE, &PATCHES);
        for ((x, y), sums) in tile.blocks().zip(&mut *sums) {
            let at = ((tile.x + x) as isize, (tile.y + y) as isize);
            let pixel = Neighbour::new(guides, at, (dx, dy));
            let apart = guides.apart(at, other, FEATURE_TOLERANCE * FEATURE_TOLERANCE);
            for (k, sums) in sums.iter_mut().enumerate() {
                let alike = alike(&patches, k, x, y);
                let weight = (Lanes::ZERO - alike.max(apart)).exp_negative();
                sums.add(&pixel, weight, weight.where_greater(alike, apart, Lanes::ZERO));
            }
        }
    }
}

/// Like [`add_pixels`]; but where the mean of two opposite pixels is more like the centre than they are together,
/// as on a ramp, both get its weight. Pixels that are far off, each for itself, stay out.
#[inline(always)]
fn add_pairs(guides: &Guides, tile: PlaneTile, window: usize, sums: &mut [[Sums; 3]]) {
    const FAR: f32 = 25.0;
    let mut patches: [Patches; 3] = std::array::from_fn(|_| Patches::new(tile, PATCHES[1], 2));
    for (dx, dy) in offsets(window).filter(|&(dx, dy)| dy > 0 || (dy == 0 && dx > 0)) {
        let others = [Other::At(dx, dy), Other::At(-dx, -dy), Other::Mean(dx, dy)];
        for (patches, other) in patches.iter_mut().zip(others) {
            patches.compare(&guides.color, other, COLOR_TOLERANCE * COLOR_TOLERANCE, &PATCHES);
        }
        for ((x, y), sums) in tile.blocks().zip(&mut *sums) {
            let at = ((tile.x + x) as isize, (tile.y + y) as isize);
            let pixels = [Neighbour::new(guides, at, (dx, dy)), Neighbour::new(guides, at, (-dx, -dy))];
            let apart = others.map(|other| guides.apart(at, other, FEATURE_TOLERANCE * FEATURE_TOLERANCE));
            for (k, sums) in sums.iter_mut().enumerate() {
                let alike = [0, 1, 2].map(|i| alike(&patches[i], k, x, y));
                let far = [0, 1, 2].map(|i| alike[i].max(apart[i]));
                let weight = far.map(|far| (Lanes::ZERO - far).exp_negative());
                let gain = (weight[2] / (weight[0] + weight[1]) - Lanes::splat(1.0)).max(Lanes::ZERO);
                let share = gain.min(Lanes::splat(1.0));
                let share = share.where_greater(Lanes::splat(FAR), far[0].max(far[1]), Lanes::ZERO);
                for i in 0..2 {
                    let joint = weight[i] + share * (weight[2] - weight[i]);
                    sums.add(&pixels[i], joint, weight[i].where_greater(alike[i], apart[i], Lanes::ZERO));
                }
            }
        }
    }
}

/// Results from the sums, the centre included.
#[inline(always)]
fn finish(guides: &Guides, tile: PlaneTile, sums: &[[Sums; 3]]) -> Vec<f32> {
    let color = &guides.color;
    let mut out = vec![0.0; 15 * tile.width * tile.height];
    for ((x, y), sums) in tile.blocks().zip(sums) {
        let load = |planes: &Planes, c| planes.lanes(c, (tile.x + x) as isize, (tile.y + y) as isize);
        let noise = load(&color.variance, 0);
        for (k, sums) in sums.iter().enumerate() {
            let side = 2 * PATCHES[k.min(1)] + 1;
            let centre = sums.largest.max(Lanes::splat(1e-3));
            let total = sums.weight + centre;
            let (mut error, mut weight_derivative) = (Lanes::ZERO - noise, sums.weight_derivative);
            for c in 0..3 {
                let step = sums.color[c] / total;
                tile.put(&mut out, 3 * k + c, x, y, load(&color.mean, c) + step);
                error += step * step;
                weight_derivative = weight_derivative - step * sums.weighted_steps[c];
            }
            // dF/du, mean over the channels; values outside [0, 1] are noise, and clamped.
            let direct = centre / total;
            let follows = Lanes::splat(2.0 / (3 * side * side) as f32) * noise * weight_derivative / total;
            let slope = direct + if k < 2 { follows } else { Lanes::ZERO };
            let slope = direct.where_greater(Lanes::ZERO, slope, direct.where_greater(slope, Lanes::splat(1.0), slope));
            tile.put(&mut out, 9 + k, x, y, Lanes::splat(1.0 / 3.0) * (error + Lanes::splat(2.0) * noise * slope));
            tile.put(&mut out, 12 + k, x, y, slope);
        }
    }
    out
}
