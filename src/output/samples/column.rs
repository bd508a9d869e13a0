//! The table of quantities that every camera sample has.

use crate::film::{Sample, Scattering};
use crate::scene::sensor::Sensor;

/// A quantity of a sample.
pub struct Column {
    /// Name of its file.
    pub name: &'static str,
    pub channels: usize,
    /// Description, with unit and range.
    pub content: &'static str,
    /// Appends its values, as many as there are channels.
    pub append: fn(&Sample, &Sensor, &mut Vec<f32>),
}

/// Every quantity.
pub const COLUMNS: &[Column] = &[
    Column {
        name: "color",
        channels: 3,
        content: "scattered radiance, without `direct`",
        append: |sample, _, to| to.extend(sample.color.to_array()),
    },
    Column {
        name: "direct",
        channels: 3,
        content: "radiance of emitters that the camera sees directly",
        append: |sample, _, to| to.extend(sample.direct.to_array()),
    },
    Column {
        name: "albedo",
        channels: 3,
        content: "albedo of the first surface that is no mirror or clear glass, in [0, 1]",
        append: |sample, _, to| to.extend(sample.features.albedo.to_array()),
    },
    Column {
        name: "normal",
        channels: 3,
        content: "its shading normal in the camera's space: x to the left, y up, z into the picture; zero where nothing is hit",
        append: |sample, sensor, to| to.extend(sensor.to_camera(sample.features.normal).to_array()),
    },
    Column {
        name: "depth",
        channels: 1,
        content: "length of the path to it, in scene units; beyond the scene where nothing is hit",
        append: |sample, _, to| to.push(sample.features.depth),
    },
    Column {
        name: "roughness",
        channels: 1,
        content: "least roughness (alpha) of its lobes: 0 of mirrors, 1 of diffuse surfaces and where nothing is hit",
        append: |sample, _, to| to.push(sample.features.roughness),
    },
    Column {
        name: "scattering",
        channels: Scattering::KINDS.len(),
        content: "0 or 1 each: diffuse and glossy lobes of that surface; it is a mirror or clear, or seen through such; reflection and \
                  transmission at the camera's first surface; emission of that surface",
        append: |sample, _, to| to.extend(sample.features.scattering.indicators()),
    },
];
