//! Frames as single-part EXR files with a channel per layer component, and back.

use std::path::Path;

use super::{Frame, Layer, LightLayers, Provenance, aovs, edge_layers, views};
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

/// How files of other programs are read.
#[derive(Clone, Copy, Debug, Default)]
pub struct Reading<'a> {
    /// Samples of every pixel, where the file does not say.
    pub spp: Option<u32>,
    /// The view layer to take, of a file of several; the first one if it is not given.
    pub view_layer: Option<&'a str>,
}

/// Reads the layers that a file has. Channels that belong to no layer are ignored.
pub fn load(path: &Path) -> Result<Frame> {
    Ok(load_other(path, Reading::default())?.0)
}

/// The same of a file that may be another program's: its channels are layers as far as their names are known. Also gives a
/// warning, if the file leaves a choice.
pub fn load_other(path: &Path, reading: Reading) -> Result<(Frame, Option<String>)> {
    let (pixels, warning) = one_view(path, read(path, &Provenance::NAMES)?, reading.view_layer)?;
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
        aovs::complete(&mut frame, &pixels, reading.spp);
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
    Ok((frame, warning))
}

/// The channels of one view layer, with a warning where there are others and none is asked for.
fn one_view(path: &Path, pixels: Pixels, wanted: Option<&str>) -> Result<(Pixels, Option<String>)> {
    let views = views::names(&pixels.channels);
    let names = || views.join(", ");
    let chosen = match (wanted, views.as_slice()) {
        (None, [] | [_]) => return Ok((pixels, None)),
        (None, [first, ..]) => first.clone(),
        (Some(wanted), views) if views.iter().any(|view| view == wanted) => wanted.to_owned(),
        (Some(wanted), []) => {
            return Err(Error::Usage(format!("{} has no view layers, so none is `{wanted}`", path.display())));
        }
        (Some(wanted), _) => {
            let what = format!("{} has no view layer `{wanted}`; it has {}", path.display(), names());
            return Err(Error::Usage(what));
        }
    };
    let is_choice = wanted.is_none() && views[1..].iter().any(|view| !views::is_composite(view));
    let warning = is_choice.then(|| {
        format!("{} has the view layers {}: `{chosen}` is taken; choose with --view-layer", path.display(), names())
    });
    Ok((views::only(pixels, &views, &chosen), warning))
}
