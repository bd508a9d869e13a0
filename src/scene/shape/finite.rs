//! A check that all shapes make.

use super::Geometry;
use crate::error::Result;
use crate::scene::plugin::Object;

/// A geometry whose transform or numbers leave the range of floats cannot be traced.
pub fn finite(object: &Object, geometry: Geometry) -> Result<Geometry> {
    if geometry.bounds().is_finite() { Ok(geometry) } else { Err(object.loc.invalid("coordinates are not finite")) }
}
