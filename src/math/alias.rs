//! Sampling an index in proportion to given weights in constant time (Walker 1977, Vose 1991).

/// A distribution over indices.
#[derive(Clone, Debug)]
pub struct Alias {
    cells: Vec<Cell>,
}

/// One of equally likely cells, shared by its own index and another's.
#[derive(Clone, Copy, Debug)]
struct Cell {
    /// Share of the cell that is its own index's.
    own: f32,
    /// Entry that the rest of the cell belongs to.
    other: u32,
    /// Probability of its own index over all cells.
    probability: f32,
}

impl Alias {
    /// Weights must be finite and not negative. `None` when they sum to zero.
    pub fn new(weights: &[f32]) -> Option<Self> {
        let total: f64 = weights.iter().map(|&weight| f64::from(weight)).sum();
        if !(total > 0.0 && total.is_finite()) {
            return None;
        }
        let n = weights.len() as f64;
        let mut shares: Vec<f64> = weights.iter().map(|&weight| f64::from(weight) / total * n).collect();
        let (mut small, mut large): (Vec<_>, Vec<_>) = (0..weights.len()).partition(|&i| shares[i] < 1.0);
        let cell = |i: usize| Cell { own: 1.0, other: i as u32, probability: (shares[i] / n) as f32 };
        let mut cells: Vec<_> = (0..weights.len()).map(cell).collect();
        while let (Some(&low), Some(&high)) = (small.last(), large.last()) {
            small.pop();
            cells[low] = Cell { own: shares[low] as f32, other: high as u32, ..cells[low] };
            shares[high] -= 1.0 - shares[low];
            if shares[high] < 1.0 {
                large.pop();
                small.push(high);
            }
        }
        // Left over by rounding: without weight it must not be drawn at all.
        let heaviest = (0..weights.len()).max_by(|&a, &b| weights[a].total_cmp(&weights[b]))? as u32;
        for index in small.into_iter().filter(|&index| weights[index] == 0.0) {
            cells[index] = Cell { own: 0.0, other: heaviest, ..cells[index] };
        }
        Some(Self { cells })
    }

    /// The index that `u` in [0, 1) selects, and `u` rescaled to [0, 1) within that entry, for reuse.
    #[inline]
    pub fn sample(&self, u: f32) -> (usize, f32) {
        let at = u * self.cells.len() as f32;
        let index = (at as usize).min(self.cells.len() - 1);
        let (within, Cell { own, other, .. }) = (at - index as f32, self.cells[index]);
        let own_part = within < own;
        let rest = if own_part { within / own } else { (within - own) / (1.0 - own) };
        (if own_part { index } else { other as usize }, rest.clamp(0.0, 1.0 - f32::EPSILON / 2.0))
    }

    /// Probability of an index.
    #[inline]
    pub fn probability(&self, index: usize) -> f32 {
        self.cells[index].probability
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_are_the_weights_and_empty_entries_are_never_drawn() {
        for weights in [&[1.0, 0.0, 3.0, 0.0][..], &[0.0, 0.1, 0.1, 0.1], &[2.0], &[1e-6, 1e6, 7.0]] {
            let table = Alias::new(weights).unwrap();
            let total: f32 = weights.iter().sum();
            let n = 1 << 20;
            let mut counts = vec![0; weights.len()];
            (0..n).for_each(|i| counts[table.sample(i as f32 / n as f32).0] += 1);
            for (i, (&weight, &count)) in weights.iter().zip(&counts).enumerate() {
                let expected = weight / total;
                assert!((table.probability(i) - expected).abs() < 1e-6);
                assert!((count as f32 / n as f32 - expected).abs() < 1e-5, "{weights:?} {i}");
                assert!(weight > 0.0 || count == 0);
            }
        }
        assert!(Alias::new(&[0.0, 0.0]).is_none() && Alias::new(&[]).is_none());
    }

    #[test]
    fn what_is_left_of_a_number_is_uniform() {
        let table = Alias::new(&[0.3, 0.1, 0.6]).unwrap();
        let n = 30_000;
        for index in 0..3 {
            let rests: Vec<f64> = (0..n)
                .map(|i| table.sample(i as f32 / n as f32))
                .filter(|&(drawn, _)| drawn == index)
                .map(|(_, rest)| f64::from(rest))
                .collect();
            assert!(rests.iter().all(|rest| (0.0..1.0).contains(rest)));
            let mean = rests.iter().sum::<f64>() / rests.len() as f64;
            assert!((mean - 0.5).abs() < 1e-3, "{index}: {mean}");
        }
    }
}
