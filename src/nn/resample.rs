//! Halving and doubling of sizes.

use super::tensor::Tensor;

/// The largest of 2x2 values; both sides must be even.
pub fn max_pool(input: &Tensor) -> Tensor {
    assert!(input.width.is_multiple_of(2) && input.height.is_multiple_of(2), "sides are even");
    Tensor::from_fn(input.width / 2, input.height / 2, input.channels, |x, y, pixel| {
        let four = [(0, 0), (1, 0), (0, 1), (1, 1)].map(|(dx, dy)| input.pixel(2 * x + dx, 2 * y + dy));
        for (c, value) in pixel.iter_mut().enumerate() {
            *value = four[0][c].max(four[1][c]).max(four[2][c].max(four[3][c]));
        }
    })
}

/// Every pixel four times, before the channels of a tensor of that size.
pub fn nearest_beside(input: &Tensor, other: &Tensor) -> Tensor {
    assert_eq!((2 * input.width, 2 * input.height), (other.width, other.height), "twice the size");
    Tensor::from_fn(other.width, other.height, input.channels + other.channels, |x, y, pixel| {
        let (own, beside) = pixel.split_at_mut(input.channels);
        own.copy_from_slice(input.pixel(x / 2, y / 2));
        beside.copy_from_slice(other.pixel(x, y));
    })
}

/// Twice the size, interpolated between the centres of pixels; beyond the last ones they are repeated.
pub fn bilinear(input: &Tensor) -> Tensor {
    // An odd pixel lies a quarter behind its own, an even one before it.
    let around = |at: usize, length: usize| {
        let own = at / 2;
        let other = if at.is_multiple_of(2) { own.saturating_sub(1) } else { (own + 1).min(length - 1) };
        (own, other)
    };
    Tensor::from_fn(2 * input.width, 2 * input.height, input.channels, |x, y, pixel| {
        let ((x0, x1), (y0, y1)) = (around(x, input.width), around(y, input.height));
        let four = [(x0, y0), (x1, y0), (x0, y1), (x1, y1)].map(|(x, y)| input.pixel(x, y));
        for (c, value) in pixel.iter_mut().enumerate() {
            let along = |a: f32, b: f32| 0.75 * a + 0.25 * b;
            *value = along(along(four[0][c], four[1][c]), along(four[2][c], four[3][c]));
        }
    })
}
