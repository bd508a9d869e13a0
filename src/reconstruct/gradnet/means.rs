//! Correction of means over large windows (Eq. 13 of Guo et al. 2019).

use crate::image::planes::Planes;

/// Radius and deviation of the Gaussian window, in pixels.
const RADIUS: usize = 45;
const DEVIATION: f32 = 15.0;

/// Least mean that another is divided by, over the mean of the image.
const DARK: f64 = 1e-3;

/// Largest factor, and one over the least.
const MOST: f32 = 2.0;

/// The image, multiplied so that its means over windows are those of the colours.
pub fn with_means(image: &Planes, color: &Planes) -> Planes {
    let [own, wanted] = [image, color].map(window_means);
    let least = (DARK * mean(color).max(0.0)) as f32 + 1e-9;
    let ratio = wanted.zip(&own, |wanted, own| ((wanted + least) / (own + least)).clamp(1.0 / MOST, MOST));
    image.zip(&ratio, |value, ratio| value * ratio)
}

fn mean(planes: &Planes) -> f64 {
    let mut sum = 0.0;
    for c in 0..planes.channels() {
        for (x, y) in (0..planes.height).flat_map(|y| (0..planes.width).map(move |x| (x, y))) {
            sum += f64::from(planes.at(c, x as isize, y as isize));
        }
    }
    sum / (planes.channels() * planes.width * planes.height) as f64
}

/// Weighted means over windows, of the pixels that are inside the image.
fn window_means(planes: &Planes) -> Planes {
    let weights: Vec<f32> = (0..=RADIUS).map(|at| libm::expf(-0.5 * (at as f32 / DEVIATION).powi(2))).collect();
    let along = |planes: &Planes, (dx, dy): (isize, isize)| {
        let length = if dx == 1 { planes.width } else { planes.height };
        Planes::from_fn(planes.width, planes.height, planes.channels(), |c, x, y| {
            let at = if dx == 1 { x } else { y };
            let (first, last) = (at.saturating_sub(RADIUS), (at + RADIUS).min(length - 1));
            let (mut sum, mut total) = (0.0, 0.0);
            for other in first..=last {
                let (weight, step) = (weights[other.abs_diff(at)], other as isize - at as isize);
                sum += weight * planes.at(c, x as isize + step * dx, y as isize + step * dy);
                total += weight;
            }
            sum / total
        })
    };
    along(&along(planes, (1, 0)), (0, 1))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn constant_factors_are_taken_back_and_details_stay() {
        let color = Planes::from_fn(60, 40, 3, |c, x, y| (1 + c) as f32 + ((x * 7 + y * 3) % 5) as f32);
        for factor in [0.6, 1.0, 1.7] {
            let image = color.map(|value| factor * value);
            let made = with_means(&image, &color);
            for (x, y) in (0..40).flat_map(|y| (0..60).map(move |x| (x, y))) {
                let (made, expected) = (made.at(1, x, y), color.at(1, x, y));
                assert!((made - expected).abs() < 1e-3 * expected, "{made} instead of {expected} at {x},{y}");
            }
        }
        // What is ten times too bright is halved only.
        let made = with_means(&color.map(|value| 10.0 * value), &color);
        assert!((made.at(0, 5, 5) - 5.0 * color.at(0, 5, 5)).abs() < 1e-3);
    }
}
