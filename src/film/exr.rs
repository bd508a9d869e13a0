//! Frames as single-part EXR files with a channel per layer component, and back.

use std::path::Path;

use super::{Frame, Layer, LightLayers, Provenance, aovs, edge_layers};
use crate::error::{Error, Result};
use crate::image::Image;
use crate::image::io::{Kind, Pixels, read, write};

/// Writes every layer of a frame, without loss.
pub fn save(path: &Path, frame: &Frame) -> Result<()> {
    let present: Vec<_> = frame.present().collect();
    let own_edges = frame.own_edges().map(edge_layers::channels).transpose().map_err(|why| Error::io(path, why))?;
    let mut others = own_edges.unwrap_or_default();
    others.extend(frame.lights.iter().flat_map(LightLayers::channels));
    let of_layers = present.iter().flat_map(|(layer, _)| layer.channel_names());
    let channels: Vec<String> = of_layers.chain(others.iter().map(|(name, _)| name.clone())).collect();
    let mut data = Vec::with_capacity(frame.width * frame.height * channels.len());
    for pixel in 0..frame.width * frame.height {
        for (_, image) in &present {
            data.extend_from_slice(&image.data[pixel * image.channels..(pixel + 1) * image.channels]);
        }
        data.extend(others.iter().map(|(_, values)| values[pixel]));
    }
    let (width, height, attributes) = (frame.width, frame.height, frame.provenance.attributes());
    write(path, &Pixels { width, height, channels, data, window: frame.window, attributes }, Kind::Float, Some("zips"))
}

/// Reads the layers that a file has. Channels that belong to no layer are ignored.
pub fn load(path: &Path) -> Result<Frame> {
    load_counted(path, None)
}

/// The same of a file that may be another program's: its channels are layers as far as their names are known, and its
/// pixels have `spp` samples where it does not say how many.
pub fn load_counted(path: &Path, spp: Option<u32>) -> Result<Frame> {
    let pixels = read(path, &Provenance::NAMES)?;
    let mut frame = Frame::new(pixels.width, pixels.height);
    for layer in Layer::all() {
        let find = |name: &String| pixels.channels.iter().position(|other| other == name);
        let Some(positions) = layer.channel_names().iter().map(find).collect::<Option<Vec<_>>>() else { continue };
        let samples = pixels.data.chunks_exact(pixels.channels.len());
        let data = samples.flat_map(|pixel| positions.iter().map(|&position| pixel[position])).collect();
        let image = Image { width: pixels.width, height: pixels.height, channels: positions.len(), data };
        frame.set(layer, image);
    }
    frame.provenance = Provenance::from_attributes(&pixels.attributes);
    if frame.provenance.version.is_empty() {
        aovs::complete(&mut frame, &pixels, spp);
    }
    if frame.get(Layer::Color).is_none() {
        return Err(Error::io(path, format!("no channels R, G, B among {}", pixels.channels.join(", "))));
    }
    let channel = |name: &str| {
        let position = pixels.channels.iter().position(|other| other == name)?;
        Some(pixels.data.chunks_exact(pixels.channels.len()).map(|pixel| pixel[position]).collect())
    };
    if let Some(edges) = edge_layers::edges(&frame, channel) {
        frame.set_edges(edges);
    }
    frame.lights = LightLayers::of_file((frame.width, frame.height), &pixels.channels, channel);
    frame.window = pixels.window;
    Ok(frame)
}
