//! The table of BSDFs.

use std::sync::Arc;

use super::{
    Bsdf, blendbsdf, bumpmap, coating, conductor, dielectric, diffuse, mask, normalmap, null, phong, plastic,
    polarizer, pplastic, principled, roughconductor, roughdielectric, roughdiffuse, roughplastic, thindielectric,
    twosided, ward,
};
use crate::scene::plugin::Plugin;

/// The BSDFs of scene files.
pub const PLUGINS: &[Plugin<Arc<dyn Bsdf>>] = &[
    diffuse::PLUGIN,
    roughdiffuse::PLUGIN,
    conductor::PLUGIN,
    roughconductor::PLUGIN,
    dielectric::PLUGIN,
    roughdielectric::PLUGIN,
    thindielectric::PLUGIN,
    plastic::PLUGIN,
    roughplastic::PLUGIN,
    pplastic::PLUGIN,
    phong::PLUGIN,
    ward::PLUGIN,
    principled::PLUGIN,
    principled::thin::PLUGIN,
    twosided::PLUGIN,
    mask::PLUGIN,
    blendbsdf::PLUGIN,
    blendbsdf::MIXTURE,
    coating::SMOOTH,
    coating::ROUGH,
    bumpmap::PLUGIN,
    normalmap::PLUGIN,
    null::PLUGIN,
    polarizer::LINEAR,
    polarizer::CIRCULAR,
    polarizer::RETARDER,
];

/// The material of a shape that names none: half-grey, but black for a shape that emits.
pub fn default(emits: bool) -> Arc<dyn Bsdf> {
    diffuse::uniform(if emits { 0.0 } else { 0.5 })
}
