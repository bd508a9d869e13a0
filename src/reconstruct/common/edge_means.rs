//! Means of edges' values over edges of the same step around them.

use crate::film::Edges;
use crate::image::planes::Planes;

/// Values that stand for edges which do not exist.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Missing {
    /// Zero.
    Zero,
    /// The nearest edge's value at the image's border; elsewhere missing edges are left out of the mean.
    Nearest,
}

/// Replaces a value of every edge by its mean over the edges of the same step whose lower ends lie in the square of the
/// given radius around its own.
pub fn box_mean(
    edges: &Edges,
    (width, height): (usize, usize),
    values: &[f32],
    radius: usize,
    missing: Missing,
) -> Vec<f32> {
    let mut means = vec![0.0; values.len()];
    for (kind, &(dx, dy)) in edges.offsets().iter().enumerate() {
        let mut of_pixel = vec![None; width * height];
        let of_kind: Vec<usize> = (0..edges.len()).filter(|&edge| edges.kind(edge) == kind).collect();
        of_kind.iter().for_each(|&edge| of_pixel[edges.ends(edge)[0]] = Some(values[edge]));
        // Lower ends of edges that fit into the image: columns, and rows from the top.
        let columns = (0.max(-dx) as usize, width.saturating_sub(dx.max(0) as usize + 1));
        let last_row = height.saturating_sub(dy.max(0) as usize + 1);
        let at = |x: usize, y: usize| match missing {
            Missing::Zero => of_pixel[y * width + x],
            Missing::Nearest => of_pixel[y.min(last_row) * width + x.clamp(columns.0.min(columns.1), columns.1)],
        };
        let sums = Planes::from_fn(width, height, 1, |_, x, y| at(x, y).unwrap_or(0.0)).box_mean(radius);
        let complete = missing == Missing::Zero || (0..width * height).all(|i| at(i % width, i / width).is_some());
        let present = |_, x, y| f32::from(u8::from(at(x, y).is_some()));
        let shares = (!complete).then(|| Planes::from_fn(width, height, 1, present).box_mean(radius));
        for edge in of_kind {
            let lower = edges.ends(edge)[0];
            let (x, y) = ((lower % width) as isize, (lower / width) as isize);
            let share = shares.as_ref().map_or(1.0, |shares| shares.at(0, x, y));
            means[edge] = sums.at(0, x, y) / share;
        }
    }
    means
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn constants_stay_whatever_edges_are_missing() {
        let size = (9, 7);
        let all = Edges::cross(size);
        let sparse = Edges::new(size, (0..all.len()).filter(|edge| edge % 3 != 0).map(|edge| all.ends(edge)));
        for edges in [all, sparse, Edges::new(size, [[3, 50], [4, 12], [5, 13]])] {
            let means = box_mean(&edges, size, &vec![2.5; edges.len()], 2, Missing::Nearest);
            means.iter().for_each(|mean| assert!((mean - 2.5).abs() < 1e-5, "{mean}"));
        }
    }

    #[test]
    fn missing_edges_may_count_as_zero() {
        let edges = Edges::new((3, 3), [[4, 5]]);
        assert!((box_mean(&edges, (3, 3), &[9.0], 1, Missing::Zero)[0] - 1.0).abs() < 1e-6);
    }
}
