//! Frames made by hand, and what methods make of them.

use crate::error::Result;
use crate::film::{BINS, Frame, Layer};
use crate::image::Image;
use crate::math::{Rgb, rng, vec3};
use crate::reconstruct::{Context, METHODS, Method, Solution, parse, solve};

/// Methods that report to nobody.
pub const QUIET: Context = Context { progress: &|_, _| {}, memory: None, notes: false };

/// Standard deviations of colours and of differences in [`noisy`].
pub const COLOR: f32 = 0.3;
pub const EDGE: f32 = 0.06;

/// Size of frames whose size does not matter: primes, larger than a tile.
pub const SIZE: (usize, usize) = (61, 47);

/// All methods but trained ones, for which there are no closed answers.
pub fn methods() -> impl Iterator<Item = &'static Method> {
    METHODS.iter().filter(|method| method.id != "oidn")
}

/// Solves with a method's default parameters.
pub fn run(method: &Method, frame: &Frame) -> Result<Solution> {
    solve(parse(method.id)?.as_ref(), frame, &QUIET)
}

/// A hash as a number in [0, 1).
pub fn random(seed: u64, i: usize) -> f32 {
    rng::unit(rng::combine(rng::mix(seed), i as u64))
}

/// A picture with steps, slopes and flat parts, between 0.3 and 3.
pub fn picture((width, height): (usize, usize)) -> Image {
    Image::from_rgb(width, height, |x, y| {
        let step = f32::from(u8::from(x > width / 3)) + f32::from(u8::from(y > height / 2));
        let (x, y) = (x as f32, y as f32);
        vec3(1.5 + (0.1 * x).sin(), 1.2 + 0.5 * (0.07 * y).cos(), 0.3 + step)
    })
}

/// A picture of one colour.
pub fn flat((width, height): (usize, usize), value: f32) -> Image {
    Image::from_rgb(width, height, |_, _| Rgb::splat(value))
}

/// Differences of a picture along `step`.
pub fn differences(image: &Image, step: (usize, usize)) -> Image {
    Image::from_rgb(image.width, image.height, |x, y| {
        let (a, b) = (x + step.0, y + step.1);
        if a < image.width && b < image.height { image.rgb(a, b) - image.rgb(x, y) } else { Rgb::ZERO }
    })
}

/// Where a layer's values stand in the picture: the colour itself, or its differences.
fn truth_of(layer: Layer, image: &Image) -> Option<Image> {
    match layer {
        Layer::Color | Layer::BinColor(_) => Some(image.clone()),
        Layer::Dx | Layer::BinDx(_) => Some(differences(image, (1, 0))),
        Layer::Dy | Layer::BinDy(_) => Some(differences(image, (0, 1))),
        _ => None,
    }
}

/// A frame with all layers, whose colours and differences are those of a picture, without noise.
pub fn exact(image: &Image) -> Frame {
    let (width, height) = (image.width, image.height);
    let mut frame = Frame::new(width, height);
    for layer in Layer::all() {
        let value = match layer {
            Layer::Samples => 64.0,
            Layer::Albedo | Layer::Normal => 0.5,
            Layer::Depth | Layer::Occlusion => 1.0,
            _ => 0.0,
        };
        let channels = layer.info().channels.len();
        let plain = || Image { data: vec![value; width * height * channels], ..Image::new(width, height, channels) };
        frame.set(layer, truth_of(layer, image).unwrap_or_else(plain));
    }
    frame
}

/// What is sampled: the layer of the mean, that of its variance, and those of the bins.
pub const KINDS: [Kind; 3] = [
    (Layer::Color, Layer::ColorVariance, Layer::BinColor),
    (Layer::Dx, Layer::DxVariance, Layer::BinDx),
    (Layer::Dy, Layer::DyVariance, Layer::BinDy),
];
type Kind = (Layer, Layer, fn(u8) -> Layer);

/// The same with noise of [`COLOR`] and [`EDGE`] times `noise`, even between two bounds, and its variances.
pub fn noisy(image: &Image, noise: f32, seed: u64) -> Frame {
    let mut frame = exact(image);
    // An even distribution of this width has variance one.
    let width = 12f32.sqrt();
    for (kind, (whole, variance, bin)) in KINDS.into_iter().enumerate() {
        let deviation = if whole == Layer::Color { COLOR } else { EDGE } * noise;
        let of_bin = deviation * (BINS as f32).sqrt();
        change(&mut frame, whole, |_, _| 0.0);
        for k in 0..BINS as u8 {
            let seed = rng::combine(seed, (kind * BINS) as u64 + u64::from(k));
            change(&mut frame, bin(k), |i, value| value + of_bin * width * (random(seed, i) - 0.5));
            let mean = frame.get(bin(k)).map(|image| image.data.clone()).unwrap_or_default();
            change(&mut frame, whole, |i, value| value + mean[i] / BINS as f32);
        }
        change(&mut frame, variance, |_, _| deviation * deviation);
    }
    frame
}

/// Replaces every value of a layer by a function of its position in the data and itself.
pub fn change(frame: &mut Frame, layer: Layer, new: impl Fn(usize, f32) -> f32) {
    if let Some(mut image) = frame.get(layer).cloned() {
        image.data.iter_mut().enumerate().for_each(|(i, value)| *value = new(i, *value));
        frame.set(layer, image);
    }
}

/// A frame times a factor: radiance by it, variances of radiance by its square.
pub fn expose(frame: &mut Frame, factor: f32) {
    for layer in Layer::all() {
        let factor = match layer.info().unit {
            "radiance" => factor,
            "radiance²" => factor * factor,
            _ => continue,
        };
        change(frame, layer, |_, value| value * factor);
    }
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
    // Not a maximum of floats, which would pass over what is no number.
    let apart = a.data.iter().zip(&b.data).map(|(&a, &b)| (f64::from(a) - f64::from(b)).abs() / largest);
    apart.fold(0.0, |most, apart| if apart <= most { most } else { apart })
}
