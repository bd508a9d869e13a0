//! Cryptomatte (Friedman and Jones 2015): shares of pixels by named objects, materials and instances, from which compositors pick mattes, and plain
//! numbers of what a pixel shows most of.

use std::collections::{BTreeMap, BTreeSet};
use std::io::Cursor;
use std::path::Path;
use std::sync::Arc;

use crate::error::Result;
use crate::image::io::{Kind, Pixels, write};
use crate::render::{Shown, ShownShapes, shown_shapes};
use crate::scene::Scene;
use crate::scene::sensor::{Crop, Sensor};

/// Names that a pixel can have, in layers of two.
const RANKS: usize = 6;

/// Samples beyond which shares are no longer made more exact.
pub const MOST_SAMPLES: u32 = 64;

/// Shares of pixels by the names of one kind.
pub struct Matte {
    /// Name of the layers.
    pub name: &'static str,
    /// Identifiers by name.
    pub ids: BTreeMap<Arc<str>, Id>,
    /// Names of every pixel with their shares, the largest first; pixels are row by row.
    pub pixels: Vec<Vec<(Arc<str>, f32)>>,
}

/// Identifiers of a name.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Id {
    /// Identifier of Cryptomatte.
    pub hashed: f32,
    /// Number among all names in their order, from 1 on.
    pub number: u32,
}

/// A kind of names, and the name of a shape, that of an instance where it is in one.
type Naming = (&'static str, for<'a> fn(&'a Scene, Shown) -> &'a Arc<str>);

/// All kinds of names. The last is for scenes with instances: what is in none has its own name there.
const NAMINGS: [Naming; 3] = [
    ("CryptoObject", |scene, shown| &scene.shapes()[shown.shape as usize].name),
    ("CryptoMaterial", |scene, shown| &scene.shapes()[shown.shape as usize].material),
    ("CryptoInstance", |scene, shown| {
        let instance = scene.instance_names().get(shown.instance as usize);
        instance.unwrap_or(&scene.shapes()[shown.shape as usize].name)
    }),
];

/// Shares by objects, by materials and, where there are any, by instances, from the camera rays of `spp` samples of a seed.
pub fn mattes(scene: &Scene, seed: u64, spp: u32) -> Vec<Matte> {
    let shown = shown_shapes(scene, seed, spp);
    let kinds = if scene.instance_names().is_empty() { 2 } else { 3 };
    let of_kind = |&(name, of): &Naming| {
        let shapes = (0..scene.shapes().len() as u32).map(|shape| Shown { shape, instance: u32::MAX });
        // Shapes of groups are seen in instances only.
        let instances = (0..scene.instance_names().len() as u32).map(|instance| Shown { shape: 0, instance });
        let names: BTreeSet<_> = shapes.chain(instances).map(|shown| of(scene, shown)).collect();
        let id = |(number, name): (u32, &&Arc<str>)| (Arc::clone(name), Id { hashed: hashed(name), number });
        let ids = (1..).zip(&names).map(id).collect();
        let pixel = |shapes: &ShownShapes| {
            let mut counts = BTreeMap::new();
            for &(shown, count) in shapes {
                *counts.entry(Arc::clone(of(scene, shown))).or_insert(0) += count;
            }
            let mut shares: Vec<_> =
                counts.into_iter().map(|(name, count)| (name, count as f32 / spp as f32)).collect();
            // Stable, so that of equal shares the name decides.
            shares.sort_by(|a, b| b.1.total_cmp(&a.1));
            shares
        };
        Matte { name, ids, pixels: shown.iter().map(pixel).collect() }
    };
    NAMINGS[..kinds].iter().map(of_kind).collect()
}

/// The identifier of a name: its hash as a float, made neither infinite nor denormal nor not a number.
fn hashed(name: &str) -> f32 {
    let hash = hash(name);
    f32::from_bits(if matches!(hash >> 23 & 255, 0 | 255) { hash ^ 1 << 23 } else { hash })
}

fn hash(name: &str) -> u32 {
    murmur3::murmur3_32(&mut Cursor::new(name), 0).expect("memory can be read")
}

impl Matte {
    /// Pairs of identifier and share of every rank, then the number of the first name in the order of all, from 1 on.
    fn put(&self, pixel: usize, to: &mut Vec<f32>) {
        let shares = &self.pixels[pixel];
        for rank in 0..RANKS {
            let found = shares.get(rank).map(|(name, share)| [self.ids[name].hashed, *share]);
            to.extend(found.unwrap_or_default());
        }
        to.push(shares.first().map_or(0.0, |(name, _)| self.ids[name].number as f32));
    }

    fn channels(&self) -> Vec<String> {
        let of_layer = |layer: usize| ["R", "G", "B", "A"].map(|channel| format!("{}{layer:02}.{channel}", self.name));
        (0..RANKS / 2).flat_map(of_layer).chain([self.number_channel()]).collect()
    }

    /// The channel of numbers: `object.id`, `material.id` or `instance.id`.
    fn number_channel(&self) -> String {
        format!("{}.id", self.name.trim_start_matches("Crypto").to_lowercase())
    }

    /// The names as the format has them, and those of the numbers.
    fn attributes(&self) -> Vec<(String, String)> {
        let key = &format!("{:08x}", hash(self.name))[..7];
        let manifest: serde_json::Map<_, _> = self
            .ids
            .iter()
            .map(|(name, id)| (name.to_string(), format!("{:08x}", id.hashed.to_bits()).into()))
            .collect();
        let names: Vec<_> = self.ids.keys().map(|name| &**name).collect();
        let values = [
            ("name", self.name.to_owned()),
            ("hash", "MurmurHash3_32".to_owned()),
            ("conversion", "uint32_to_float32".to_owned()),
            ("manifest", serde_json::Value::from(manifest).to_string()),
        ];
        let of_format = values.map(|(what, value)| (format!("cryptomatte/{key}/{what}"), value));
        let numbers = (format!("fluxion:{}", self.number_channel()), serde_json::json!(names).to_string());
        of_format.into_iter().chain([numbers]).collect()
    }
}

/// Writes the mattes of a sensor's picture as an EXR file, with more attributes.
pub fn save(path: &Path, sensor: &Sensor, mattes: &[Matte], mut attributes: Vec<(String, String)>) -> Result<()> {
    let whole = Crop { x: 0, y: 0, width: sensor.width, height: sensor.height };
    let (inner, mut data) = (sensor.inner().unwrap_or(whole), Vec::new());
    for pixel in inner.pixels().map(|(x, y)| y * sensor.width + x) {
        mattes.iter().for_each(|matte| matte.put(pixel, &mut data));
    }
    let within = sensor.inner().map(|inner| inner.within(sensor.window(), (sensor.width, sensor.height)));
    let (width, height, window) = (inner.width, inner.height, within.or(sensor.window()));
    attributes.extend(mattes.iter().flat_map(Matte::attributes));
    let channels = mattes.iter().flat_map(Matte::channels).collect();
    write(path, &Pixels { width, height, channels, data, window, attributes }, Kind::Float, Some("zip"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn identifiers_are_those_of_the_hash_and_always_numbers() {
        // Known values of MurmurHash3 for 32 bits with a seed of 0.
        assert_eq!((hash(""), hash("hello"), hash("hello, world")), (0, 0x248b_fa47, 0x149b_bb7f));
        // An exponent of zeros, which would make a number that is flushed to zero.
        assert_eq!(hashed("").to_bits(), 1 << 23);
        assert!((0..100_000).all(|k| hashed(&format!("object {k}")).is_normal()));
    }
}
