//! Structural similarity over several scales (Wang et al. 2003).

use super::{Measure, Metric};
use crate::image::Image;
use crate::math::srgb_encode;

/// MS-SSIM of the images tone mapped alike: each channel x / (1 + x), then sRGB; the mean of the channels.
pub const METRIC: Metric =
    Metric { id: "ms_ssim", summary: "MS-SSIM after x / (1 + x) and sRGB, one for equal images", measure };

/// Exponents of the scales, the finest first. Images that are too small for all of them do without the coarsest.
const EXPONENTS: [f64; 5] = [0.0448, 0.2856, 0.3001, 0.2363, 0.1333];

/// Radius and deviation of the window.
const RADIUS: usize = 5;
const SIGMA: f64 = 1.5;

/// Limits of luminance and contrast below which nothing is distinguished.
const LIMITS: [f64; 2] = [0.01 * 0.01, 0.03 * 0.03];

/// A channel.
#[derive(Clone)]
struct Plane {
    width: usize,
    height: usize,
    values: Vec<f64>,
}

impl Plane {
    fn shown(image: &Image, channel: usize) -> Self {
        let show = |value: f64| f64::from(srgb_encode((value.max(0.0) / (1.0 + value.max(0.0))) as f32));
        let values = image.channel(channel).into_iter().map(show).collect();
        Self { width: image.width, height: image.height, values }
    }

    fn product(&self, other: &Self) -> Self {
        let values = self.values.iter().zip(&other.values).map(|(a, b)| a * b).collect();
        Self { values, ..*self }
    }

    /// Sums along a row with a window, as far as it is inside, and the result transposed.
    fn along_rows(&self, window: &[f64]) -> Self {
        let width = self.width + 1 - window.len();
        let sum = |x: usize, y: usize| {
            let row = &self.values[y * self.width + x..];
            window.iter().zip(row).map(|(weight, value)| weight * value).sum()
        };
        let values = (0..width).flat_map(|x| (0..self.height).map(move |y| (x, y))).map(|(x, y)| sum(x, y)).collect();
        Self { width: self.height, height: width, values }
    }

    fn blurred(&self, window: &[f64]) -> Self {
        self.along_rows(window).along_rows(window)
    }

    /// Means of 2x2 pixels.
    fn halved(&self) -> Self {
        let (width, height) = (self.width / 2, self.height / 2);
        let at = |x: usize, y: usize| self.values[y * self.width + x];
        let mean = |x: usize, y: usize| (at(x, y) + at(x + 1, y) + at(x, y + 1) + at(x + 1, y + 1)) / 4.0;
        let values = (0..height).flat_map(|y| (0..width).map(move |x| mean(2 * x, 2 * y))).collect();
        Self { width, height, values }
    }
}

/// A Gaussian window, smaller for images that have no room for all of it.
fn window(side: usize) -> Vec<f64> {
    let radius = RADIUS.min((side - 1) / 2) as i32;
    let weights: Vec<_> = (-radius..=radius).map(|k| (-f64::from(k * k) / (2.0 * SIGMA * SIGMA)).exp()).collect();
    let sum: f64 = weights.iter().sum();
    weights.iter().map(|weight| weight / sum).collect()
}

/// Mean similarity of contrast and structure, and of luminance, too.
fn similarity(a: &Plane, b: &Plane) -> [f64; 2] {
    let window = window(a.width.min(a.height));
    let [mean_a, mean_b] = [a, b].map(|plane| plane.blurred(&window).values);
    let [aa, bb, ab] = [(a, a), (b, b), (a, b)].map(|(one, other)| one.product(other).blurred(&window).values);
    let mut sums = [0.0; 2];
    for i in 0..ab.len() {
        let (means, squares) = (mean_a[i] * mean_b[i], mean_a[i] * mean_a[i] + mean_b[i] * mean_b[i]);
        let contrast = (2.0 * (ab[i] - means) + LIMITS[1]) / (aa[i] + bb[i] - squares + LIMITS[1]);
        sums[0] += contrast;
        sums[1] += contrast * (2.0 * means + LIMITS[0]) / (squares + LIMITS[0]);
    }
    sums.map(|sum| sum / ab.len() as f64)
}

fn of_channel(mut a: Plane, mut b: Plane) -> f64 {
    let side = a.width.min(a.height);
    let scales = (1..EXPONENTS.len()).take_while(|&scale| side >> scale > 2 * RADIUS).count() + 1;
    let total: f64 = EXPONENTS[..scales].iter().sum();
    let mut product = 1.0;
    for (scale, exponent) in EXPONENTS[..scales].iter().enumerate() {
        let last = scale + 1 == scales;
        product *= similarity(&a, &b)[usize::from(last)].max(0.0).powf(exponent / total);
        if !last {
            (a, b) = (a.halved(), b.halved());
        }
    }
    product
}

fn measure(image: &Image, reference: &Image) -> Measure {
    let channel = |channel| of_channel(Plane::shown(image, channel), Plane::shown(reference, channel));
    Measure { mean: (0..3).map(channel).sum::<f64>() / 3.0, map: None }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::vec3;

    /// The value of the package pytorch-msssim 1.0.0 for the same pictures, shown alike.
    #[test]
    fn similarity_is_that_of_another_implementation() {
        let wave = |x: usize, y: usize, k: f32| 0.5 + 0.4 * ((x as f32) * 0.11 * k).sin() * ((y as f32) * 0.07).cos();
        let reference = Image::from_rgb(208, 192, |x, y| vec3(wave(x, y, 1.0), wave(x, y, 2.0), wave(y, x, 3.0)));
        let noisy = Image::from_rgb(208, 192, |x, y| {
            reference.rgb(x, y) + vec3(0.1, 0.2, 0.3) * (((x * 7919 + y * 104_729) % 101) as f32 / 101.0 - 0.5)
        });
        let found = measure(&noisy, &reference).mean;
        assert!((found - 0.978_130_4).abs() < 2e-5, "{found}");
    }
}
