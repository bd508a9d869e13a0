//! Neighbours: which pixels the paths of every pixel are shifted to.

use half::f16;

/// Steps in x and y to the pixels of a 5x5 window: those of the cross first, else nearest ones first, and opposite steps side by
/// side. A set of neighbours is a mask over this list.
pub const STEPS: [(i32, i32); 24] = [
    (1, 0),
    (-1, 0),
    (0, 1),
    (0, -1),
    (1, 1),
    (-1, -1),
    (1, -1),
    (-1, 1),
    (2, 0),
    (-2, 0),
    (0, 2),
    (0, -2),
    (2, 1),
    (-2, -1),
    (1, 2),
    (-1, -2),
    (2, -1),
    (-2, 1),
    (1, -2),
    (-1, 2),
    (2, 2),
    (-2, -2),
    (2, -2),
    (-2, 2),
];

/// Mask of the four direct neighbours.
pub const CROSS: u32 = 0b1111;

/// Mask of the whole window.
const WINDOW: u32 = (1 << STEPS.len()) - 1;

/// Position in [`STEPS`] of the step back.
pub const fn opposite(step: usize) -> usize {
    step ^ 1
}

/// The neighbours of every pixel, its *kernel*, row by row.
#[derive(Clone, Debug, PartialEq)]
pub struct Neighbours {
    /// Columns and rows.
    size: (usize, usize),
    /// Masks over [`STEPS`].
    masks: Vec<u32>,
    /// Whether an edge may be sampled from one of its ends alone. Random replay covers all paths of the other end from there;
    /// other shifts fail for some of them, and are biased without the other end.
    directed: bool,
    /// Weights across all steps of every pixel, relative to its own; empty if neighbours come without weights.
    weights: Vec<StepWeights>,
}

/// Weights across the steps of [`STEPS`].
pub type StepWeights = [f16; STEPS.len()];

impl Neighbours {
    /// Neighbours by masks over [`STEPS`]; steps out of the film are dropped. Unless edges may be `directed`, every neighbour has
    /// the pixel as a neighbour, too.
    pub fn new(size: (usize, usize), masks: Vec<u32>, directed: bool) -> Self {
        assert_eq!(masks.len(), size.0 * size.1, "one mask a pixel");
        let mut made = Self { size, masks, directed, weights: Vec::new() };
        for pixel in 0..made.masks.len() {
            made.masks[pixel] &= made.window(pixel);
        }
        if !directed {
            let chosen = made.masks.clone();
            for (pixel, &mask) in chosen.iter().enumerate() {
                for step in bits(mask) {
                    if let Some(to) = made.to(pixel, step) {
                        made.masks[to] |= 1 << opposite(step);
                    }
                }
            }
        }
        made
    }

    /// The same with weights of the neighbours, relative to the pixels' own; none of any if there are none.
    #[must_use]
    pub fn weighted(self, weights: Vec<StepWeights>) -> Self {
        assert!(weights.is_empty() || weights.len() == self.masks.len(), "weights of every pixel");
        Self { weights, ..self }
    }

    /// Mask of the steps that lead from a pixel to one of the film.
    fn window(&self, pixel: usize) -> u32 {
        let inside = |step: &usize| self.to(pixel, *step).is_some();
        (0..STEPS.len()).filter(inside).fold(0, |mask, step| mask | 1 << step) & WINDOW
    }

    /// Columns and rows.
    pub fn size(&self) -> (usize, usize) {
        self.size
    }

    /// Masks of all pixels, row by row.
    pub fn masks(&self) -> &[u32] {
        &self.masks
    }

    /// Weights of all pixels across all steps, relative to their own; empty if there are none.
    pub fn weights(&self) -> &[StepWeights] {
        &self.weights
    }

    /// Whether edges may be sampled from one end alone.
    pub fn is_directed(&self) -> bool {
        self.directed
    }

    /// Number of a pixel's neighbours.
    pub fn degree(&self, pixel: usize) -> usize {
        self.masks[pixel].count_ones() as usize
    }

    /// Most neighbours of a pixel.
    pub fn most(&self) -> usize {
        self.masks.iter().map(|mask| mask.count_ones()).max().unwrap_or(0) as usize
    }

    /// Mean number of neighbours.
    pub fn mean_degree(&self) -> f64 {
        let total: u64 = self.masks.iter().map(|mask| u64::from(mask.count_ones())).sum();
        total as f64 / self.masks.len().max(1) as f64
    }

    /// Positions in [`STEPS`] of the steps to a pixel's neighbours, in ascending order.
    pub fn steps(&self, pixel: usize) -> impl Iterator<Item = usize> + use<> {
        bits(self.masks[pixel])
    }

    /// Number of a step among those of the pixel, if it is one of them.
    pub fn slot(&self, pixel: usize, step: usize) -> Option<usize> {
        let mask = self.masks[pixel];
        (mask & 1 << step != 0).then(|| (mask & ((1 << step) - 1)).count_ones() as usize)
    }

    /// The pixel that a step leads to, if it belongs to the film.
    pub fn to(&self, pixel: usize, step: usize) -> Option<usize> {
        beside(self.size, pixel, step)
    }

    /// All pixels with each of their neighbours.
    pub fn pairs(&self) -> impl Iterator<Item = [usize; 2]> {
        let of_pixel = move |pixel| self.steps(pixel).filter_map(move |step| Some([pixel, self.to(pixel, step)?]));
        (0..self.masks.len()).flat_map(of_pixel)
    }
}

/// The pixel that a step leads to from another one, if it belongs to a film of this size.
pub fn beside((width, height): (usize, usize), pixel: usize, step: usize) -> Option<usize> {
    let (dx, dy) = STEPS[step];
    let x = (pixel % width).checked_add_signed(dx as isize).filter(|&x| x < width)?;
    let y = (pixel / width).checked_add_signed(dy as isize).filter(|&y| y < height)?;
    Some(y * width + x)
}

/// Positions of a mask's bits, in ascending order.
fn bits(mask: u32) -> impl Iterator<Item = usize> {
    (0..STEPS.len()).filter(move |step| mask & 1 << step != 0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_are_the_window_nearest_first_with_their_opposites() {
        let mut all: Vec<_> = STEPS.to_vec();
        all.sort_unstable();
        all.dedup();
        assert_eq!(all.len(), 24);
        for (k, (x, y)) in STEPS.into_iter().enumerate() {
            assert_eq!(STEPS[opposite(k)], (-x, -y));
            assert!((x, y) != (0, 0) && x.abs().max(y.abs()) <= 2);
        }
        assert!(STEPS.map(|(x, y)| x * x + y * y).is_sorted());
    }

    #[test]
    fn kernels_end_at_the_border_and_are_closed_unless_directed() {
        let mut masks = vec![0; 12];
        (masks[5], masks[0]) = (1 << 0 | 1 << 4, WINDOW);
        let closed = Neighbours::new((4, 3), masks.clone(), false);
        assert_eq!(closed.steps(5).collect::<Vec<_>>(), [0, 4, 5]);
        assert_eq!((closed.slot(5, 4), closed.slot(5, 1), closed.to(5, 4)), (Some(1), None, Some(10)));
        assert_eq!((closed.masks()[6], closed.masks()[10]), (1 << 1 | 1 << 13, 1 << 5 | 1 << 21));
        for pixel in 0..12 {
            for step in closed.steps(pixel) {
                let to = closed.to(pixel, step).unwrap();
                assert!(closed.slot(to, opposite(step)).is_some());
            }
        }
        let directed = Neighbours::new((4, 3), masks, true);
        assert_eq!((directed.degree(5), directed.degree(6), directed.degree(0)), (2, 0, 8));
        assert!((directed.mean_degree() - 10.0 / 12.0).abs() < 1e-9);
    }
}
