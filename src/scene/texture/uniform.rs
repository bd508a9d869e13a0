//! Textures that are the same everywhere, written as textures.

use std::sync::Arc;

use super::{Constant, Texture};
use crate::error::Result;
use crate::math::Rgb;
use crate::scene::plugin::{Loader, Object, Plugin, Property, Value};

/// `uniform`.
pub const UNIFORM: Plugin<Arc<dyn Texture>> = Plugin { name: "uniform", parameters: "value = 1", make };
/// `rawconstant`: a number or three that are no colour, such as a direction.
pub const RAW: Plugin<Arc<dyn Texture>> = Plugin { name: "rawconstant", parameters: "value = 1", make };

fn make(object: &Object, _loader: &mut dyn Loader) -> Result<Arc<dyn Texture>> {
    let value = match object.get("value") {
        Some(Property { value: Value::Vector(vector), .. }) => *vector,
        _ => object.color("value", Rgb::ONE)?,
    };
    Ok(Arc::new(Constant(value)))
}
