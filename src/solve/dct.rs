//! Two-dimensional cosine transforms of any size, rows and columns in parallel.

use rayon::prelude::*;
use rustdct::DctPlanner;

/// DCT-II and its inverse over an image of fixed size, in place.
pub struct Dct2 {
    width: usize,
    height: usize,
    rows: std::sync::Arc<dyn rustdct::TransformType2And3<f64>>,
    columns: std::sync::Arc<dyn rustdct::TransformType2And3<f64>>,
}

/// Columns that are transformed together: a cache line of doubles each.
const BLOCK: usize = 8;

impl Dct2 {
    /// Plans transforms of `width` x `height`.
    pub fn new(width: usize, height: usize) -> Self {
        let mut planner = DctPlanner::new();
        Self { width, height, rows: planner.plan_dct2(width), columns: planner.plan_dct2(height) }
    }

    /// Values to coefficients (unnormalised DCT-II in both directions).
    pub fn forward(&self, data: &mut [f64]) {
        data.par_chunks_exact_mut(self.width).for_each(|row| self.rows.process_dct2(row));
        self.each_column(data, |column| self.columns.process_dct2(column));
    }

    /// The inverse of [`Dct2::forward`].
    pub fn inverse(&self, data: &mut [f64]) {
        self.each_column(data, |column| self.columns.process_dct3(column));
        let scale = 4.0 / (self.width * self.height) as f64;
        data.par_chunks_exact_mut(self.width).for_each(|row| {
            self.rows.process_dct3(row);
            row.iter_mut().for_each(|value| *value *= scale);
        });
    }

    /// Copies the columns out in blocks, transforms them and writes the blocks back.
    fn each_column(&self, data: &mut [f64], transform: impl Fn(&mut [f64]) + Sync) {
        let (width, height) = (self.width, self.height);
        let source = &*data;
        let blocks: Vec<Vec<f64>> = (0..width.div_ceil(BLOCK))
            .into_par_iter()
            .map(|block| {
                let left = block * BLOCK;
                let count = BLOCK.min(width - left);
                let mut columns = vec![0.0; count * height];
                for (y, row) in source.chunks_exact(width).enumerate() {
                    (0..count).for_each(|k| columns[k * height + y] = row[left + k]);
                }
                columns.chunks_exact_mut(height).for_each(&transform);
                columns
            })
            .collect();
        data.par_chunks_exact_mut(width).enumerate().for_each(|(y, row)| {
            for (block, columns) in blocks.iter().enumerate() {
                let slots = row[block * BLOCK..].iter_mut().take(BLOCK);
                slots.enumerate().for_each(|(k, slot)| *slot = columns[k * height + y]);
            }
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn inverse_undoes_forward_at_any_size_and_a_cosine_is_one_coefficient() {
        for (width, height) in [(1, 1), (7, 1), (1, 13), (17, 19), (16, 24)] {
            let dct = Dct2::new(width, height);
            let original: Vec<f64> = (0..width * height).map(|i| ((i * i) as f64 * 0.37).sin()).collect();
            let mut data = original.clone();
            dct.forward(&mut data);
            dct.inverse(&mut data);
            data.iter().zip(&original).for_each(|(a, b)| assert!((a - b).abs() < 1e-12, "{width}x{height}"));
        }
        let (width, height) = (12, 5);
        let cosine = |i: usize| (std::f64::consts::PI * 3.0 * ((i % width) as f64 + 0.5) / width as f64).cos();
        let mut data: Vec<f64> = (0..width * height).map(cosine).collect();
        Dct2::new(width, height).forward(&mut data);
        data.iter().enumerate().for_each(|(i, value)| assert_eq!(value.abs() > 1e-9, i == 3));
    }
}
