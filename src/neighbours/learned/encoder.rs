//! Samples of a pilot, encoded one by one as they are taken, so that they never are in memory together.

use std::sync::Mutex;

use super::SLOPE;
use crate::film::{Frame, Layer, Sample};
use crate::nn::{Activation, Convolution, Tensor, Weights};
use crate::scene::sensor::Sensor;
use crate::sync::lock;

/// Values of a sample: colour 3, albedo 3, normal 3, depth, roughness, kinds of scattering 6.
pub const FEATURES: usize = 17;

/// Values that a sample is encoded to.
pub const CHANNELS: usize = 32;

/// Dense layers.
const LAYERS: usize = 3;

/// Least mean of the colour, whose inverse is still a float.
const DARK: f32 = 1e-18;

/// Sums and largest values of encoded samples, of every pixel.
pub struct Encoder {
    layers: Vec<Convolution>,
    sensor: Option<Sensor>,
    /// Factor of radiance, and depth that is halfway.
    scale: f32,
    middle: f32,
    size: (usize, usize),
    totals: Mutex<Totals>,
}

/// Values of all pixels, [`CHANNELS`] each.
struct Totals {
    sum: Vec<f32>,
    most: Vec<f32>,
    /// Samples of the first pixel.
    counts: Vec<u16>,
}

impl Encoder {
    /// An encoder in units of what a first sample of every pixel has shown.
    pub fn new(weights: &Weights, first: &Frame, sensor: &Sensor) -> Result<Self, String> {
        let mean = first.get(Layer::Color).map_or(0.0, |color| {
            let sum: f64 = color.data.iter().map(|&value| f64::from(value)).sum();
            (sum / color.data.len() as f64) as f32
        });
        let mut depths = first.get(Layer::Depth).map(|depth| depth.data.clone()).unwrap_or_default();
        depths.sort_by(f32::total_cmp);
        let middle = depths.get(depths.len() / 2).copied().unwrap_or(1.0);
        let made = Self::of_features(weights, (first.width, first.height))?;
        let sensor = Some(sensor.clone());
        Ok(Self { scale: 1.0 / mean.max(DARK), middle: middle.max(1e-9), sensor, ..made })
    }

    /// An encoder of features that are given as such.
    pub fn of_features(weights: &Weights, size: (usize, usize)) -> Result<Self, String> {
        let layer = |k: usize| weights.convolution(&format!("encoder.{k}"), 1, Activation::Leaky(SLOPE));
        let layers = (0..LAYERS).map(layer).collect::<Result<Vec<_>, _>>()?;
        let channels = layers.iter().try_fold(FEATURES, |channels, layer| layer.after(channels))?;
        if channels != CHANNELS {
            return Err(format!("encodes samples to {channels} values instead of {CHANNELS}"));
        }
        let (count, pixels) = (size.0 * size.1 * CHANNELS, size.0 * size.1);
        let totals = Totals { sum: vec![0.0; count], most: vec![f32::NEG_INFINITY; count], counts: vec![0; pixels] };
        Ok(Self { layers, sensor: None, scale: 1.0, middle: 1.0, size, totals: Mutex::new(totals) })
    }

    /// Adds one sample of each of some pixels; called by all threads.
    pub fn put(&self, pixels: &[(usize, usize)], samples: &[Sample]) {
        let mut features = Vec::with_capacity(pixels.len() * FEATURES);
        samples.iter().for_each(|sample| self.features(sample, &mut features));
        let pixels: Vec<_> = pixels.iter().map(|(x, y)| y * self.size.0 + x).collect();
        self.add(&pixels, features);
    }

    /// Adds features of one sample of each of some pixels.
    pub(super) fn add(&self, pixels: &[usize], features: Vec<f32>) {
        let mut values = Tensor { width: pixels.len(), height: 1, channels: FEATURES, data: features };
        for layer in &self.layers {
            values = layer.apply(&values);
        }
        let mut totals = lock(&self.totals);
        let Totals { sum, most, counts } = &mut *totals;
        for (&pixel, values) in pixels.iter().zip(values.data.chunks_exact(CHANNELS)) {
            counts[pixel] = counts[pixel].saturating_add(1);
            let range = pixel * CHANNELS..(pixel + 1) * CHANNELS;
            let totals = sum[range.clone()].iter_mut().zip(&mut most[range]);
            for ((sum, most), value) in totals.zip(values) {
                *sum += value;
                *most = most.max(*value);
            }
        }
    }

    /// The features of a sample; what is not finite counts as zero.
    fn features(&self, sample: &Sample, to: &mut Vec<f32>) {
        let (features, start) = (&sample.features, to.len());
        to.extend(sample.color.to_array().map(|value| libm::log1pf((value * self.scale).max(0.0))));
        to.extend(features.albedo.to_array());
        let normal = self.sensor.as_ref().map_or(features.normal, |sensor| sensor.to_camera(features.normal));
        to.extend(normal.to_array());
        to.push(features.depth / (features.depth + self.middle));
        to.push(features.roughness);
        to.extend(features.scattering.indicators());
        to[start..].iter_mut().filter(|value| !value.is_finite()).for_each(|value| *value = 0.0);
    }

    /// Means, largest values and what `positions` says of every pixel, mirrored until both sides are multiples of a number.
    pub(super) fn encoded(&self, multiple: usize, positions: impl Fn(usize, usize, &mut [f32]) + Sync) -> Tensor {
        let totals = lock(&self.totals);
        let (width, height) = self.size;
        let mirrored = |at: usize, side: usize| if at < side { at } else { (2 * side - 1).saturating_sub(at) % side };
        let (columns, rows) = (width.next_multiple_of(multiple), height.next_multiple_of(multiple));
        Tensor::from_fn(columns, rows, 2 * CHANNELS + super::POSITIONS, |x, y, to| {
            let pixel = mirrored(y, height) * width + mirrored(x, width);
            let range = pixel * CHANNELS..(pixel + 1) * CHANNELS;
            let count = f32::from(totals.counts[pixel].max(1));
            to[..CHANNELS].iter_mut().zip(&totals.sum[range.clone()]).for_each(|(to, sum)| *to = sum / count);
            to[CHANNELS..2 * CHANNELS].copy_from_slice(&totals.most[range]);
            positions(x, y, &mut to[2 * CHANNELS..]);
        })
    }
}
