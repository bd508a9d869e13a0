//! Developed images.

use super::layer::Layer;
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

    /// The layers that are there.
    pub fn present(&self) -> impl Iterator<Item = (Layer, &Image)> {
        Layer::all().filter_map(|layer| Some((layer, self.get(layer)?)))
    }

    /// The attribute `name`.
    pub fn attribute(&self, name: &str) -> Option<&str> {
        self.attributes.iter().find(|(key, _)| key == name).map(|(_, value)| value.as_str())
    }
}
