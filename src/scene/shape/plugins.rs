//! The table of shapes.

use super::{Geometry, cube, curves, cylinder, disk, files, rectangle, sphere};
use crate::scene::plugin::Plugin;

/// The shapes of scene files.
pub const PLUGINS: &[Plugin<Geometry>] = &[
    files::OBJ,
    files::PLY,
    files::SERIALIZED,
    rectangle::PLUGIN,
    cube::PLUGIN,
    sphere::PLUGIN,
    disk::PLUGIN,
    cylinder::PLUGIN,
    curves::BSPLINE,
    curves::LINEAR,
];
