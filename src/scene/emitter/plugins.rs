//! The table of emitters.

use super::{Emitter, constant, directional, envmap, point, projector, spot, sunsky};
use crate::scene::plugin::Plugin;

/// Emitters that are elements of their own in scene files; `area` is nested in a shape.
pub const PLUGINS: &[Plugin<Box<dyn Emitter>>] = &[
    envmap::PLUGIN,
    sunsky::SUNSKY,
    sunsky::SKY,
    sunsky::SUN,
    constant::PLUGIN,
    point::PLUGIN,
    spot::PLUGIN,
    projector::PLUGIN,
    directional::PLUGIN,
];
