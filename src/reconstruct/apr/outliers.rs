//! Outliers: the energy of pixels far brighter than their neighbours is spread over these, since regression would follow
//! them.

use crate::image::planes::Planes;

/// Radius of the window that pixels are compared with.
const RADIUS: isize = 3;

/// Pixels in it.
const PIXELS: usize = ((2 * RADIUS + 1) * (2 * RADIUS + 1)) as usize;

/// Clamps luminances to the median around them plus `limit` times the median distance from it; the excess is
/// added to the pixels around in equal parts, so that the image's sum stays the same.
pub fn spread(color: &Planes, limit: f32) -> Planes {
    let (width, height) = (color.width, color.height);
    let luminance = color.sum();
    let kept = Planes::from_fn(width, height, 1, |_, x, y| {
        let (x, y) = (x as isize, y as isize);
        let mut around: [f32; PIXELS] = std::array::from_fn(|k| {
            let (dx, dy) = (k as isize % (2 * RADIUS + 1) - RADIUS, k as isize / (2 * RADIUS + 1) - RADIUS);
            luminance.at(0, x + dx, y + dy)
        });
        let middle = *around.select_nth_unstable_by(PIXELS / 2, f32::total_cmp).1;
        around.iter_mut().for_each(|value| *value = (*value - middle).abs());
        let spread = *around.select_nth_unstable_by(PIXELS / 2, f32::total_cmp).1;
        let (most, here) = (middle + limit * spread, luminance.at(0, x, y));
        if here > most && most > 0.0 { most / here } else { 1.0 }
    });
    // Each pixel gives to the part of its window that is inside the image.
    let inside = |at: isize, length: usize| (at + RADIUS).min(length as isize - 1) - (at - RADIUS).max(0) + 1;
    let given = Planes::from_fn(width, height, 3, |c, x, y| {
        let (x, y) = (x as isize, y as isize);
        color.at(c, x, y) * (1.0 - kept.at(0, x, y)) / (inside(x, width) * inside(y, height)) as f32
    });
    Planes::from_fn(width, height, 3, |c, x, y| {
        let (x, y) = (x as isize, y as isize);
        let rows = (y - RADIUS).max(0)..=(y + RADIUS).min(height as isize - 1);
        let columns = (x - RADIUS).max(0)..=(x + RADIUS).min(width as isize - 1);
        let received: f32 =
            rows.flat_map(|v| columns.clone().map(move |u| (u, v))).map(|(u, v)| given.at(c, u, v)).sum();
        color.at(c, x, y) * kept.at(0, x, y) + received
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn energy_is_kept_and_only_outliers_are_touched() {
        for at in [(0, 0), (10, 7), (19, 14)] {
            let value = |planes: &Planes| planes.at(0, at.0 as isize, at.1 as isize);
            let noisy = Planes::from_fn(20, 15, 3, |c, x, y| {
                let noise = ((x * 7 + y * 13 + c) % 5) as f32;
                if (x, y) == at { 1e4 } else { 1.0 + 0.1 * noise }
            });
            let clean = spread(&noisy, 20.0);
            let sum = |planes: &Planes| (0..300).map(|i| f64::from(planes.at(1, i % 20, i / 20))).sum::<f64>();
            assert!((sum(&clean) / sum(&noisy) - 1.0).abs() < 1e-5);
            assert!(value(&clean) < 0.1 * value(&noisy));
            let calm = Planes::from_fn(20, 15, 3, |c, x, y| noisy.at(c, x as isize, y as isize).min(1.5));
            assert_eq!(spread(&calm, 20.0), calm);
        }
    }
}
