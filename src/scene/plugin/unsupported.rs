//! Plugins that are known and not supported, and the errors of those that are not known.

use super::{Object, Plugin};
use crate::error::{Error, Result};

/// Plugins of Mitsuba 3 that are not supported, with the reason or a replacement.
pub const UNSUPPORTED: &[(&str, &str, &str)] = &[
    ("emitter", "timed_sunsky", "use sunsky at one time of the day, or several pictures"),
    ("emitter", "area", "it lights a shape: nest it in one, or give it an id and refer to it in one"),
    ("emitter", "collimated", "paths from the camera never meet its single ray; use a narrow spot"),
    ("emitter", "directionalarea", "paths from the camera never meet its parallel light; use a spot or an area"),
    ("bsdf", "hair", "its scattering is not there; principled comes near"),
    ("bsdf", "measured", "measured materials are not read; principled comes near"),
    ("bsdf", "measured_polarized", "it is measured for polarized light, which is not traced; principled comes near"),
    ("bsdf", "hk", "media are not supported"),
    ("bsdf", "difftrans", "principledthin with diff_trans comes near"),
    ("bsdf", "irawan", "woven cloth is not read; roughdiffuse comes near"),
    ("shape", "hair", "its files are not read; export it as a bsplinecurve or a linearcurve"),
    ("shape", "heightfield", "export it as a mesh"),
    ("shape", "sdfgrid", "distance fields are not traced; export them as a mesh"),
    ("shape", "ellipsoids", "splats are not traced"),
    ("shape", "ellipsoidsmesh", "splats are not traced"),
    (
        "sensor",
        "irradiancemeter",
        "it measures what a surface receives, and makes no picture; use perspective or orthographic",
    ),
    ("sensor", "radiancemeter", "it measures along a single ray; use perspective with a narrow field of view"),
    ("sensor", "fluxmeter", "it measures what a surface receives, and makes no picture"),
    ("sensor", "distant", "it sees from infinitely far away; use orthographic"),
    ("sensor", "batch", "it is several sensors in one: write them one by one and choose by --sensor"),
    ("texture", "gridtexture", "use a checkerboard or an image"),
    ("texture", "vertexcolors", "use mesh_attribute with the name vertex_color"),
    ("texture", "wireframe", "edges of triangles are not drawn; use an image"),
    ("texture", "curvature", "use an image"),
    ("texture", "volume", "volumes are not supported"),
];

/// The table's row for an object, or an error that lists the known ones.
pub fn find<'a, T>(table: &'a [Plugin<T>], object: &Object) -> Result<&'a Plugin<T>> {
    let found = table.iter().find(|plugin| plugin.name == object.plugin);
    found.ok_or_else(|| unknown(object, table.iter().map(|plugin| plugin.name)))
}

/// The error of a plugin that is none of those of a table.
pub fn unknown(object: &Object, known: impl Iterator<Item = &'static str>) -> Error {
    let (class, plugin) = (&object.class, &object.plugin);
    let reason = UNSUPPORTED.iter().find(|(other, name, _)| other == class && name == plugin);
    object.loc.unsupported(match reason {
        Some((.., reason)) => format!("{class} `{plugin}` is not supported: {reason}"),
        None => format!("{class} `{plugin}` is not known; there are {}", known.collect::<Vec<_>>().join(", ")),
    })
}
