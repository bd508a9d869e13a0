//! Developed images.

use super::BINS;
use super::layer::Layer;
use super::sample::bin_count;
use crate::error::{Error, Result};
use crate::image::Image;

/// Means and variances of a film, as layers. One from memory and one read from a file are the same.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Frame {
    /// Pixels in a row.
    pub width: usize,
    /// Number of rows.
    pub height: usize,
    layers: Vec<Option<Image>>,
    /// Named strings: scene, seed, samples, version and so on.
    pub attributes: Vec<(String, String)>,
}

impl Frame {
    /// A frame without layers.
    pub fn new(width: usize, height: usize) -> Self {
        Self { width, height, layers: vec![None; Layer::COUNT], attributes: Vec::new() }
    }

    /// A layer, if it is there.
    pub fn get(&self, layer: Layer) -> Option<&Image> {
        self.layers[layer.index()].as_ref()
    }

    /// A layer that must be there; the error says how to get it.
    pub fn require(&self, layer: Layer) -> Result<&Image> {
        self.get(layer).ok_or_else(|| Error::Missing {
            layer: layer.channel_names().join(", "),
            remedy: match layer.info().flag {
                "always" => "every file that `fluxion render --layers` writes has it".into(),
                flag => format!("`fluxion render` records it with {flag}"),
            },
        })
    }

    /// Puts a layer in.
    pub fn set(&mut self, layer: Layer, image: Image) {
        let expected = (self.width, self.height, layer.info().channels.len());
        assert_eq!(image.shape(), expected, "layer {} has the wrong shape", layer.name());
        self.layers[layer.index()] = Some(image);
    }

    /// Sets all differences to zero, as they are known to be in a scene without scattered light.
    pub fn fill_dark_edges(&mut self) {
        let black = Image::new(self.width, self.height, 3);
        for layer in [Layer::Dx, Layer::DxVariance, Layer::Dy, Layer::DyVariance] {
            self.set(layer, black.clone());
        }
        for k in 0..BINS as u8 {
            for (color, edges) in [
                (Layer::BinColor(k), [Layer::BinDx(k), Layer::BinDy(k)]),
                (Layer::BinAmbient(k), [Layer::BinAmbientDx(k), Layer::BinAmbientDy(k)]),
            ] {
                if self.get(color).is_some() {
                    edges.into_iter().for_each(|edge| self.set(edge, black.clone()));
                }
            }
        }
    }

    /// The layers that are there.
    pub fn present(&self) -> impl Iterator<Item = (Layer, &Image)> {
        Layer::all().filter_map(|layer| Some((layer, self.get(layer)?)))
    }

    /// Mean and variance of the mean of the samples in every other bin, from `first` (0 or 1) on. `bin` is one of the
    /// constructors of binned layers. Where these bins are empty, the value is that of the other bins; the variance is
    /// zero where only one of the bins has samples.
    pub fn half(&self, bin: fn(u8) -> Layer, first: usize) -> Result<[Image; 2]> {
        let bins = (0..BINS).map(|k| self.require(bin(k as u8))).collect::<Result<Vec<_>>>()?;
        let samples = self.require(Layer::Samples)?;
        let step = match bin(0) {
            Layer::BinDx(_) => (1, 0),
            Layer::BinDy(_) => (0, 1),
            _ => (0, 0),
        };
        let [mut mean, mut variance] = [(); 2].map(|()| Image::new(self.width, self.height, 3));
        for (x, y) in (0..self.height).flat_map(|y| (0..self.width).map(move |x| (x, y))) {
            // An edge has both ends.
            let far = (self.width.min(x + step.0 + 1) - 1, self.height.min(y + step.1 + 1) - 1);
            let samples = samples.pixel(x, y)[0].min(samples.pixel(far.0, far.1)[0]) as u32;
            let count = |k: usize| f64::from(bin_count(samples, k));
            let half: Vec<usize> = (first..BINS).step_by(2).filter(|&k| count(k) > 0.0).collect();
            let used = if half.is_empty() { (0..BINS).filter(|&k| count(k) > 0.0).collect() } else { half };
            let total: f64 = used.iter().map(|&k| count(k)).sum();
            for c in 0..3 {
                let value = |k: usize| f64::from(bins[k].pixel(x, y)[c]);
                let mean_of = used.iter().map(|&k| count(k) * value(k)).sum::<f64>() / total.max(1.0);
                let squares: f64 = used.iter().map(|&k| count(k) * (value(k) - mean_of).powi(2)).sum();
                mean.pixel_mut(x, y)[c] = mean_of as f32;
                let freedom = (used.len() as f64 - 1.0).max(1.0);
                variance.pixel_mut(x, y)[c] = (squares / freedom / total.max(1.0)) as f32;
            }
        }
        Ok([mean, variance])
    }

    /// The attribute `name`.
    pub fn attribute(&self, name: &str) -> Option<&str> {
        self.attributes.iter().find(|(key, _)| key == name).map(|(_, value)| value.as_str())
    }
}
