//! Removal of outliers among the differences, by those around them.

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
pub fn remove(gradient: &Planes, variance: &Planes, edges: [usize; 2], noise_test: bool) -> [Planes; 2] {
    let (width, height) = (gradient.width, gradient.height);
    let luminance = Planes::from_fn(width, height, 1, |_, x, y| {
        (0..3).map(|c| LUMINANCE[c] * gradient.at(c, x as isize, y as isize)).sum()
    });
    let field = Field { gradient, variance, luminance, edges, noise_test };
    let row = |y: usize| -> Vec<_> { (0..width).map(|x| field.replacement(x, y)).collect() };
    let replaced: Vec<Vec<Option<Replacement>>> = (0..height).into_par_iter().map(row).collect();
    let clean = |c: usize, x: usize, y: usize| {
        replaced[y][x].as_ref().map_or_else(|| gradient.at(c, x as isize, y as isize), |new| new.median[c])
    };
    let mean = |x: isize, y: isize| (0..3).map(|c| variance.at(c, x, y)).sum::<f32>() / 3.0;
    let noise = |_: usize, x: usize, y: usize| {
        replaced[y][x].as_ref().map_or_else(|| mean(x as isize, y as isize), |new| new.spread)
    };
    [Planes::from_fn(width, height, 3, clean), Planes::from_fn(width, height, 1, noise)]
}

/// Differences along one axis.
struct Field<'a> {
    gradient: &'a Planes,
    variance: &'a Planes,
    luminance: Planes,
    /// Columns and rows that hold differences.
    edges: [usize; 2],
    noise_test: bool,
}

/// Replacement of an outlier.
struct Replacement {
    median: [f32; 3],
    /// Squared standard deviation of the differences around it.
    spread: f32,
}

impl Field<'_> {
    /// Replacement of a difference, if it is an outlier.
    fn replacement(&self, x: usize, y: usize) -> Option<Replacement> {
        let [columns, rows] = self.edges;
        if x >= columns || y >= rows {
            return None;
        }
        let xs = x.saturating_sub(RADIUS)..(x + RADIUS + 1).min(columns);
        let ys = y.saturating_sub(RADIUS)..(y + RADIUS + 1).min(rows);
        let (mut values, mut count) = ([0.0f32; (2 * RADIUS + 1) * (2 * RADIUS + 1)], 0);
        for j in ys.clone() {
            values[count..count + xs.len()].copy_from_slice(self.luminance.span(
                0,
                xs.start as isize,
                j as isize,
                xs.len(),
            ));
            count += xs.len();
        }
        // The difference itself is not one of those around it.
        values.swap((y - ys.start) * xs.len() + x - xs.start, count - 1);
        let (around, here) = (&values[..count - 1], values[count - 1]);
        if around.len() < 3 {
            return None;
        }
        let mean = around.iter().sum::<f32>() / around.len() as f32;
        let spread =
            around.iter().map(|value| (value - mean) * (value - mean)).sum::<f32>() / (around.len() - 1) as f32;
        if here == mean || (here - mean).powi(2) < LIMIT * LIMIT * spread {
            return None;
        }
        let median = [0, 1, 2].map(|c| {
            let row = |j: usize| self.gradient.span(c, xs.start as isize, j as isize, xs.len());
            let mut values: Vec<f32> = ys.clone().flat_map(row).copied().collect();
            let middle = values.len() / 2;
            *values.select_nth_unstable_by(middle, f32::total_cmp).1
        });
        // Fully correlated channels at worst: deviations add up.
        let deviation = |c: usize| LUMINANCE[c] * self.variance.at(c, x as isize, y as isize).max(0.0).sqrt();
        let away = here - (0..3).map(|c| LUMINANCE[c] * median[c]).sum::<f32>();
        let explained = away.abs() <= LIMIT * (0..3).map(deviation).sum::<f32>();
        (!self.noise_test || explained).then_some(Replacement { median, spread })
    }
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
