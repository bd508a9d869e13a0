//! OpenEXR files, at their full resolution.

use std::collections::HashMap;
use std::fs::File;
use std::io::Read;
use std::path::Path;

use exr::image::write::WritableImage;
use exr::image::{AnyChannel, AnyChannels, Encoding, FlatSamples, Image, Layer};
use exr::meta::MetaData;

use exr::meta::attribute::{AttributeValue, IntegerBounds, SampleType};
use exr::meta::header::LayerAttributes;
use exr::prelude::{Blocks, Compression, LineOrder, ReadChannels, ReadLayers, f16, read};

use super::{Format, Samples};
use crate::error::{Error, Result};
use crate::pixels::parts::{self, Merged, Part};
use crate::pixels::{DataWindow, Header, Kind, Pixels, Storage};

/// Number that exr files begin with.
const MAGIC: [u8; 4] = [0x76, 0x2f, 0x31, 0x01];

/// Whether a file says that it is one.
pub fn is_exr(path: &Path) -> bool {
    let mut magic = [0; 4];
    File::open(path).and_then(|mut file| file.read_exact(&mut magic)).is_ok() && magic == MAGIC
}

/// Strings of the headers, and numbers of the parts that are read.
struct Exr {
    strings: HashMap<String, String>,
    parts: Vec<usize>,
}

/// Reads the headers of all parts.
pub fn open(path: &Path) -> Result<(Header, Box<dyn Format>)> {
    let found = MetaData::read_from_file(path, false).map_err(|error| Error::io(path, error))?;
    let parts: Vec<_> = found.headers.iter().map(part).collect();
    if parts.iter().any(|part| part.deep) {
        return Err(Error::io(path, "files with deep parts take a build with OpenImageIO"));
    }
    // All of them are decoded, also those of other sizes.
    let bytes = std::fs::metadata(path).map_err(|error| Error::io(path, error))?.len() as usize;
    parts.iter().try_for_each(|part| part.header.check(path, bytes))?;
    let merged = parts::merge(&parts);
    let Merged { header, parts } = merged.ok_or_else(|| Error::io(path, "deep images are not supported"))?;
    let mut strings = HashMap::new();
    for part in parts.iter().map(|&i| &found.headers[i]) {
        let all = part.own_attributes.other.iter().chain(&part.shared_attributes.other);
        for (name, value) in all {
            if let AttributeValue::Text(text) = value {
                strings.entry(name.to_string()).or_insert_with(|| text.to_string());
            }
        }
        if let Some(primaries) = part.shared_attributes.chromaticities {
            let points = [primaries.red, primaries.green, primaries.blue, primaries.white];
            let numbers: Vec<_> = points.iter().flat_map(|point| [point.0.to_string(), point.1.to_string()]).collect();
            strings.insert("chromaticities".into(), numbers.join(", "));
        }
    }
    Ok((header, Box::new(Exr { strings, parts })))
}

fn part(found: &exr::meta::header::Header) -> Part {
    let (size, origin) = (found.layer_size, found.own_attributes.layer_position);
    let full = found.shared_attributes.display_window;
    let unsigned = |n: i32| usize::try_from(n).ok();
    let window = match [origin.0 - full.position.0, origin.1 - full.position.1].map(unsigned) {
        [Some(x), Some(y)] if (origin, size) != (full.position, full.size) => {
            Some(DataWindow { origin: (x, y), full: (full.size.0, full.size.1) })
        }
        _ => None,
    };
    let storage = |kind| if kind == SampleType::U32 { Storage::Unsigned(32) } else { Storage::Float };
    let channels = &found.channels.list;
    let header = Header {
        width: size.0,
        height: size.1,
        origin: (origin.0, origin.1),
        channels: channels.iter().map(|channel| channel.name.to_string()).collect(),
        storage: channels.iter().map(|channel| storage(channel.sample_type)).collect(),
        window,
        format: "openexr".into(),
        ..Header::default()
    };
    let name = found.own_attributes.layer_name.as_ref().map(ToString::to_string).unwrap_or_default();
    Part { name, header, deep: found.deep }
}

impl Format for Exr {
    fn attribute(&self, name: &str) -> Option<String> {
        self.strings.get(name).cloned()
    }

    fn samples(&self, path: &Path) -> Result<Samples> {
        let image = read().no_deep_data().largest_resolution_level().all_channels().all_layers().all_attributes();
        let image = image.from_file(path).map_err(|error| Error::io(path, error))?;
        let wanted = image.layer_data.into_iter().enumerate().filter(|(i, _)| self.parts.contains(i));
        let layers: Vec<_> = wanted.map(|(_, layer)| layer).collect();
        let count: usize = layers.iter().map(|layer| layer.channel_data.list.len()).sum();
        let pixels = layers.first().map_or(0, |layer| layer.size.area());
        let mut data = vec![0.0; count * pixels];
        for (k, channel) in layers.into_iter().flat_map(|layer| layer.channel_data.list).enumerate() {
            let slots = data.iter_mut().skip(k).step_by(count);
            match channel.sample_data {
                FlatSamples::F16(values) => slots.zip(values).for_each(|(slot, value)| *slot = value.to_f32()),
                FlatSamples::F32(values) => slots.zip(values).for_each(|(slot, value)| *slot = value),
                FlatSamples::U32(values) => {
                    let share = |value: u32| (f64::from(value) / f64::from(u32::MAX)) as f32;
                    slots.zip(values).for_each(|(slot, value)| *slot = share(value));
                }
            }
        }
        Ok(Samples::Floats(data))
    }
}

/// Writes all channels, in floats of the given kind.
pub fn write(path: &Path, pixels: &Pixels, kind: Kind, compression: Option<&str>) -> Result<()> {
    let size = (pixels.width, pixels.height);
    let channel = |(k, name): (usize, &String)| {
        let values = pixels.data.iter().skip(k).step_by(pixels.channels.len());
        let samples = match kind {
            Kind::Half => FlatSamples::F16(values.map(|&value| f16::from_f32(value)).collect()),
            Kind::Float | Kind::Uint8 => FlatSamples::F32(values.copied().collect()),
        };
        AnyChannel::new(name.as_str(), samples)
    };
    let channels = AnyChannels::sort(pixels.channels.iter().enumerate().map(channel).collect());
    let window = pixels.window.unwrap_or(DataWindow { origin: (0, 0), full: size });
    let layer_position = (window.origin.0 as i32, window.origin.1 as i32).into();
    let mut attributes = LayerAttributes { layer_position, ..LayerAttributes::default() };
    let texts =
        pixels.attributes.iter().map(|(name, text)| (name.as_str().into(), AttributeValue::Text(text.as_str().into())));
    attributes.other.extend(texts);
    let compression = if compression == Some("zips") { Compression::ZIP1 } else { Compression::Uncompressed };
    let encoding = Encoding { compression, blocks: Blocks::ScanLines, line_order: LineOrder::Increasing };
    let mut image = Image::from_layer(Layer::new(size, attributes, encoding, channels));
    image.attributes.display_window = IntegerBounds::from_dimensions(window.full);
    image.write().to_file(path).map_err(|error| Error::io(path, error))
}

#[cfg(test)]
mod tests {
    use exr::meta::attribute::Text;

    use super::*;
    use crate::image::pure::ImageFile;
    use crate::pixels::OpenImage;

    #[test]
    fn parts_of_one_size_are_read_as_one_image() {
        let part = |name: &str, width: usize, channel: &str, value: f32| {
            let samples = FlatSamples::F32(vec![value; 2 * width]);
            let channels = AnyChannels::sort([AnyChannel::new(channel, samples)].into_iter().collect());
            Layer::new((width, 2), LayerAttributes::named(Text::from(name)), Encoding::UNCOMPRESSED, channels)
        };
        let parts = vec![part("depth", 3, "Z", 7.0), part("small", 1, "Y", 5.0), part("mask", 3, "Y", 2.0)];
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.exr");
        let attributes = exr::meta::header::ImageAttributes::new(IntegerBounds::from_dimensions((3, 2)));
        Image::from_layers(attributes, parts).write().to_file(&path).unwrap();
        let file = ImageFile::open(&path).unwrap();
        assert_eq!((file.channels.join(" ").as_str(), file.parts), ("depth.Z mask.Y", 3));
        assert_eq!(file.floats().unwrap(), [7.0, 2.0].repeat(6));
    }
}
