//! Structure-adaptive kernels (Manzi et al. 2014): the neighbours that are most similar in albedo, normal and depth,
//!
//! s = min over features of exp(-max(0, |g_i - g_j|² - d) / b²),
//!
//! with a bandwidth b of each feature, and d twice the noise of both pixels and a part of b². Pixels that differ by no more have a
//! similarity of one, and of equally similar ones the nearest are taken, so that the kernel is a cross where nothing distinguishes pixels
//! apart. Bandwidths and d are ours: the paper leaves them to its users.

use rayon::prelude::*;

use super::{Choice, FEATURES, KernelKind, Parameter, Pilot, Selector};
use crate::film::{Frame, Layer, STEPS, beside};
use crate::image::Image;

/// `structure`.
pub const KERNEL: KernelKind = KernelKind {
    id: "structure",
    summary: "the k pixels of a window of 5x5 that are most similar in albedo, normal and depth (Manzi et al. 2014)",
    k: 4,
    parameters: &[Parameter::K, Parameter::Threshold],
    pilot: Some(FEATURES),
    select,
};

/// Least similarity of a neighbour by default.
pub const THRESHOLD: f32 = 0.3;

/// Squared difference, of the squared bandwidth, that counts as none: slopes would choose the kernel otherwise.
const TOLERANCE: f32 = 0.25;

/// A feature of the pilot with its variance.
struct Feature<'a> {
    mean: &'a Image,
    variance: &'a Image,
    /// Difference at which similarity falls to 1/e.
    bandwidth: f32,
    /// Whether the bandwidth is a share of the value.
    relative: bool,
}

fn select(pilot: &Pilot, selector: &Selector) -> Choice {
    let frame = pilot.frame;
    let features: Vec<_> = [
        (Layer::Albedo, Layer::AlbedoVariance, 0.1, false),
        (Layer::Normal, Layer::NormalVariance, 0.2, false),
        (Layer::Depth, Layer::DepthVariance, 0.05, true),
    ]
    .into_iter()
    .filter_map(|(mean, variance, bandwidth, relative)| {
        Some(Feature { mean: frame.get(mean)?, variance: frame.get(variance)?, bandwidth, relative })
    })
    .collect();
    let pixels = 0..pilot.pixels();
    Choice::unweighted(pixels.into_par_iter().map(|pixel| choose(frame, selector, &features, pixel)).collect())
}

/// The most similar neighbours of a pixel.
fn choose(frame: &Frame, selector: &Selector, features: &[Feature], pixel: usize) -> u32 {
    let mut similar = Vec::with_capacity(STEPS.len());
    for step in 0..STEPS.len() {
        let Some(there) = beside((frame.width, frame.height), pixel, step) else { continue };
        let similarity = features.iter().map(|feature| feature.similarity(pixel, there)).fold(1.0, f32::min);
        if similarity >= selector.threshold {
            similar.push((similarity, step));
        }
    }
    // Stable, so that of equally similar ones the nearest come first.
    similar.sort_by(|a, b| b.0.total_cmp(&a.0));
    similar.iter().take(selector.k as usize).fold(0, |mask, (_, step)| mask | 1 << step)
}

impl Feature<'_> {
    fn similarity(&self, here: usize, there: usize) -> f32 {
        let values = |image: &Image, pixel: usize| -> [f32; 3] {
            std::array::from_fn(|c| {
                image.data.get(pixel * image.channels + c).copied().filter(|_| c < image.channels).unwrap_or(0.0)
            })
        };
        let (a, b) = (values(self.mean, here), values(self.mean, there));
        let noise: f32 = [here, there].into_iter().flat_map(|pixel| values(self.variance, pixel)).sum();
        let distance: f32 = (0..3).map(|c| (a[c] - b[c]).powi(2)).sum();
        let scale = if self.relative { a[0].abs().max(1e-20) } else { 1.0 };
        let bandwidth = self.bandwidth * scale;
        let squared = bandwidth * bandwidth;
        libm::expf(-(distance - 2.0 * noise - TOLERANCE * squared).max(0.0) / squared)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::film::{CROSS, Neighbours};

    /// A frame of two albedos with a border at column 3 and the given variance of all features.
    fn frame(variance: f32) -> Frame {
        let mut frame = Frame::new(6, 5);
        for (layer, channels) in [(Layer::AlbedoVariance, 3), (Layer::NormalVariance, 3), (Layer::DepthVariance, 1)] {
            let data = vec![variance; 30 * channels];
            frame.set(layer, Image { width: 6, height: 5, channels, data });
        }
        let albedo = (0..90).map(|i| if i / 3 % 6 < 3 { 0.2 } else { 0.7 }).collect();
        frame.set(Layer::Albedo, Image { width: 6, height: 5, channels: 3, data: albedo });
        frame.set(Layer::Normal, Image::new(6, 5, 3));
        frame.set(Layer::Depth, Image { width: 6, height: 5, channels: 1, data: vec![7.0; 30] });
        frame
    }

    fn select_by(kernel: &str, frame: &Frame) -> Neighbours {
        Selector::parse(kernel, None).unwrap().select(&Pilot { frame, encoder: None }, true)
    }

    #[test]
    fn neighbours_are_those_of_the_same_surface() {
        let chosen = select_by("structure", &frame(0.0));
        for pixel in 0..30 {
            for step in chosen.steps(pixel) {
                let to = chosen.to(pixel, step).unwrap();
                assert_eq!(pixel % 6 < 3, to % 6 < 3, "{pixel} to {to}");
            }
        }
        assert_eq!(chosen.masks()[13], CROSS);
        // Beside the border the direct neighbour across it is replaced by one along it.
        assert_eq!(chosen.masks()[14], CROSS & !1 | 1 << 5);
        let strict = select_by("structure:k=24,threshold=0.9", &frame(0.0));
        assert_eq!(strict.degree(14), 14);
    }

    #[test]
    fn what_lies_within_the_noise_makes_no_difference() {
        let chosen = select_by("structure", &frame(0.2));
        assert_eq!(chosen.masks()[14], CROSS);
    }
}
