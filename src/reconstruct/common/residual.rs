//! Errors of images by how far they are from the sampled colours.

use crate::image::planes::Planes;

/// Radius of the window that squared residuals are averaged over.
const RADIUS: usize = 7;

/// Largest distance that counts: its square and sums of those are still floats.
const MOST: f32 = 1e15;

/// Squared residuals beyond the noise may be this share of it before an image counts as biased; more where few samples, fewer
/// than this number, say little about the noise.
const TRUST: f32 = 0.5;
const FEW: f32 = 16.0;

/// Least estimated error, over the mean variance of the colours around.
const LEAST_ERROR: f32 = 0.02;

/// Mean over the channels.
pub fn mean(planes: &Planes) -> Planes {
    planes.sum().map(|sum| sum / 3.0)
}

/// Variance of the colours, mean over the channels, no larger than the largest square that counts.
pub fn noise(variance: &Planes) -> Planes {
    mean(variance).map(|variance| variance.min(MOST * MOST))
}

/// Squared error of an image, mean over the channels: its squared distances from the sampled colours less their [`noise`], mean
/// over a window. With the samples' variances it is unbiased as far as the image's errors have nothing to do with the
/// colours' noise. May be negative.
pub fn squared_error(color: &Planes, noise: &Planes, image: &Planes) -> Planes {
    let square = mean(&color.zip(image, |color, image| (color - image).clamp(-MOST, MOST).powi(2)));
    square.zip(noise, |square, noise| square - noise).box_mean(RADIUS)
}

/// Means over the window of [`squared_error`].
pub fn windowed(planes: &Planes) -> Planes {
    planes.box_mean(RADIUS)
}

/// An image's [`squared_error`], bounded below by a small share of the noise around, since residuals cannot resolve less.
pub fn estimated_error(error: &Planes, noise: &Planes) -> Planes {
    error.zip(noise, |error, noise| error.max(LEAST_ERROR * noise))
}

/// An image, pulled back to a safe one where it is not trusted.
pub fn pulled_back(image: &Planes, safe: &Planes, trust: &Planes) -> Planes {
    Planes::from_fn(image.width, image.height, image.channels(), |c, x, y| {
        let (x, y) = (x as isize, y as isize);
        safe.at(c, x, y) + trust.at(0, x, y) * (image.at(c, x, y) - safe.at(c, x, y))
    })
}

/// An image, pulled back to a safe one where it differs from the sampled colours by more than their [`noise`] explains, and to a
/// `share` of the way everywhere.
pub fn pulled_to(image: &Planes, safe: &Planes, (color, noise): (&Planes, &Planes), spp: f32, share: f32) -> Planes {
    let trust = trust(&windowed(noise), &squared_error(color, noise, image), spp);
    pulled_back(image, safe, &trust.map(|trust| share * trust))
}

/// How far an image can be trusted, from 0 to 1, by its [`squared_error`] beyond the noise around, both means over windows. With more
/// samples there is less noise, and what is left of the error is bias; without noise nothing is trusted.
pub fn trust(noise: &Planes, error: &Planes, spp: f32) -> Planes {
    let allowed = TRUST * (1.0 + FEW / spp);
    noise.zip(error, |noise, error| (allowed * noise / error.max(1e-12)).min(1.0))
}
