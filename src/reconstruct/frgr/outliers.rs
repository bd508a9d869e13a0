//! Differences that stand out from those around them.

use rayon::prelude::*;

use crate::image::planes::Planes;

/// Radius of the window that a difference is compared with.
const RADIUS: usize = 2;

/// Standard deviations that it may be away.
const LIMIT: f32 = 3.0;

const LUMINANCE: [f32; 3] = [0.2126, 0.7152, 0.0722];

/// Replaces the differences among the first `columns` and `rows` that are more than three standard deviations from
/// the mean of those around them by their median, and their variance by the spread around them. With a `noise_test`
/// this is done only to those that are no more than three of their own standard deviations from the median: what
/// noise does not explain is in the scene, and noise vanishes as samples are added. Returns three planes of
/// differences and one of their mean variance.
pub fn remove(gradient: &Planes, variance: &Planes, [columns, rows]: [usize; 2], noise_test: bool) -> [Planes; 2] {
    let (width, height) = (gradient.width, gradient.height);
    let mean = |x: isize, y: isize| (0..3).map(|c| variance.at(c, x, y)).sum::<f32>() / 3.0;
    let replaced: Vec<Vec<Option<Replacement>>> = (0..height)
        .into_par_iter()
        .map(|y| {
            let inside = |x: usize| x < columns && y < rows;
            (0..width)
                .map(|x| if inside(x) { judge(gradient, variance, [columns, rows], [x, y], noise_test) } else { None })
                .collect()
        })
        .collect();
    let clean = |c: usize, x: usize, y: usize| {
        replaced[y][x].as_ref().map_or_else(|| gradient.at(c, x as isize, y as isize), |new| new.median[c])
    };
    let noise = |_: usize, x: usize, y: usize| {
        replaced[y][x].as_ref().map_or_else(|| mean(x as isize, y as isize), |new| new.spread)
    };
    [Planes::from_fn(width, height, 3, clean), Planes::from_fn(width, height, 1, noise)]
}

/// What an outlier becomes.
struct Replacement {
    median: [f32; 3],
    /// Squared standard deviation of the differences around it.
    spread: f32,
}

/// What a difference is to be replaced by, if it is an outlier.
fn judge(
    gradient: &Planes,
    variance: &Planes,
    [columns, rows]: [usize; 2],
    [x, y]: [usize; 2],
    noise_test: bool,
) -> Option<Replacement> {
    let xs = x.saturating_sub(RADIUS)..(x + RADIUS + 1).min(columns);
    let ys = y.saturating_sub(RADIUS)..(y + RADIUS + 1).min(rows);
    let at = |c: usize, x: usize, y: usize| gradient.at(c, x as isize, y as isize);
    let luminance = |x: usize, y: usize| (0..3).map(|c| LUMINANCE[c] * at(c, x, y)).sum::<f32>();
    let (mut values, mut count) = ([0.0f32; (2 * RADIUS + 1) * (2 * RADIUS + 1)], 0);
    for (i, j) in ys.clone().flat_map(|j| xs.clone().map(move |i| (i, j))).filter(|&at| at != (x, y)) {
        values[count] = luminance(i, j);
        count += 1;
    }
    if count < 3 {
        return None;
    }
    let mean = values[..count].iter().sum::<f32>() / count as f32;
    let spread = values[..count].iter().map(|value| (value - mean).powi(2)).sum::<f32>() / (count - 1) as f32;
    let here = luminance(x, y);
    if here == mean || (here - mean).powi(2) < LIMIT * LIMIT * spread {
        return None;
    }
    let median = [0, 1, 2].map(|c| {
        let window = ys.clone().flat_map(|j| xs.clone().map(move |i| (i, j)));
        let mut values: Vec<f32> = window.map(|(i, j)| at(c, i, j)).collect();
        let middle = values.len() / 2;
        *values.select_nth_unstable_by(middle, f32::total_cmp).1
    });
    // Fully correlated channels at worst: deviations add up.
    let deviation: f32 = (0..3).map(|c| LUMINANCE[c] * variance.at(c, x as isize, y as isize).max(0.0).sqrt()).sum();
    let away = here - (0..3).map(|c| LUMINANCE[c] * median[c]).sum::<f32>();
    (!noise_test || away.abs() <= LIMIT * deviation).then_some(Replacement { median, spread })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn run(value: impl Fn(usize, usize) -> f32 + Sync, variance: f32, noise_test: bool) -> [Planes; 2] {
        let gradient = Planes::from_fn(20, 12, 3, |_, x, y| value(x, y));
        let variance = Planes::from_fn(20, 12, 3, |_, _, _| variance);
        remove(&gradient, &variance, [19, 12], noise_test)
    }

    #[test]
    fn spikes_go_and_edges_stay() {
        let spike = |x: usize, y: usize| if (x, y) == (7, 6) { 9.0 } else { 0.1 };
        let [clean, noise] = run(spike, 10.0, true);
        assert!((0..12).all(|y| (0..19).all(|x| clean.at(0, x, y) == 0.1)));
        assert!(noise.at(0, 7, 6) < 1e-9);
        assert_eq!(noise.at(0, 3, 3), 10.0);
        let edge = |x: usize, _: usize| if x == 7 { 9.0 } else { 0.0 };
        assert!((0..12).all(|y| run(edge, 100.0, false)[0].at(0, 7, y) == 9.0));
    }

    #[test]
    fn what_noise_does_not_explain_stays_only_under_the_noise_test() {
        let dot = |x: usize, y: usize| if (x, y) == (7, 6) { 9.0 } else { 0.0 };
        assert_eq!(run(dot, 0.0, true)[0].at(0, 7, 6), 9.0);
        assert_eq!(run(dot, 0.0, false)[0].at(0, 7, 6), 0.0);
    }

    #[test]
    fn what_is_beyond_the_last_edge_is_not_looked_at() {
        let [clean, _] = run(|x, _| if x == 19 { 1e9 } else { 0.0 }, 0.0, false);
        assert!((0..19).all(|x| clean.at(0, x, 5) == 0.0));
    }
}
