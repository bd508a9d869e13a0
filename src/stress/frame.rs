//! Methods on synthetic frames, and measures of their images.

use crate::error::Result;
use crate::film::{Frame, Layer};
use crate::image::Image;
use crate::reconstruct::{Context, METHODS, Method, Solution, parse, solve};
use crate::synthetic::{self, Distribution, Noise};

/// Standard deviations of colours and of differences in [`noisy`], before the factor.
pub const COLOR: f32 = 0.3;
pub const EDGE: f32 = 0.06;

/// Size of frames whose size does not matter: primes, larger than a tile.
pub const SIZE: (usize, usize) = (61, 47);

/// All methods with closed answers, which trained networks have not.
pub fn methods() -> impl Iterator<Item = &'static Method> {
    METHODS.iter().filter(|method| method.traits.exact)
}

/// All of these that remove noise.
pub fn denoisers() -> impl Iterator<Item = &'static Method> {
    methods().filter(|method| method.traits.denoises)
}

/// Solves with a method's default parameters.
pub fn run(method: &Method, frame: &Frame) -> Result<Solution> {
    solve(parse(method.id)?.as_ref(), frame, &Context::QUIET)
}

/// [`synthetic::noisy`] with uniform noise of [`COLOR`] and [`EDGE`] times a factor.
pub fn noisy(image: &Image, factor: f32, seed: u64) -> Frame {
    let (color, edge) = (COLOR * factor, EDGE * factor);
    synthetic::noisy(image, Noise { color, edge, distribution: Distribution::Uniform }, seed)
}

/// Whether a message names a layer.
pub fn names(text: &str, layer: Layer) -> bool {
    layer.channel_names().iter().any(|name| text.contains(name))
}

/// Values of a solution that are not finite.
pub fn not_finite(solution: &Solution) -> f64 {
    let values = solution.image.data.iter().chain(solution.error.iter().flat_map(|error| &error.data));
    values.filter(|value| !value.is_finite()).count() as f64
}

/// Mean of all values.
pub fn average(image: &Image) -> f64 {
    image.data.iter().map(|&value| f64::from(value)).sum::<f64>() / image.data.len() as f64
}

/// Mean squared difference of two pictures.
pub fn mse(a: &Image, b: &Image) -> f64 {
    let squares = a.data.iter().zip(&b.data).map(|(&a, &b)| (f64::from(a) - f64::from(b)).powi(2));
    squares.sum::<f64>() / a.data.len() as f64
}

/// Largest difference of two pictures, as a share of the largest value of the second.
pub fn farthest(a: &Image, b: &Image) -> f64 {
    let largest = b.data.iter().map(|&value| f64::from(value).abs()).fold(f64::MIN_POSITIVE, f64::max);
    // Not a maximum of floats, which would pass over NaN.
    let apart = a.data.iter().zip(&b.data).map(|(&a, &b)| (f64::from(a) - f64::from(b)).abs() / largest);
    apart.fold(0.0, |most, apart| if apart <= most { most } else { apart })
}
