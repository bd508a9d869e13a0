//! Indices of refraction as files give them: numbers, or names of materials.

use crate::error::Result;
use crate::scene::plugin::{Object, Property, Value};

/// The default interior of plastics.
pub(super) const POLYPROPYLENE: f32 = 1.49;
/// The default interior of glass.
pub(super) const BK7: f32 = 1.5046;

/// Indices of refraction by name.
const IOR: &[(&str, f32)] = &[
    ("vacuum", 1.0),
    ("helium", 1.000_036),
    ("hydrogen", 1.000_132),
    ("air", 1.000_277),
    ("carbon dioxide", 1.000_45),
    ("water", 1.333),
    ("acetone", 1.36),
    ("ethanol", 1.361),
    ("carbon tetrachloride", 1.461),
    ("glycerol", 1.4729),
    ("benzene", 1.501),
    ("silicone oil", 1.520_45),
    ("bromine", 1.661),
    ("water ice", 1.31),
    ("fused quartz", 1.458),
    ("pyrex", 1.47),
    ("acrylic glass", 1.49),
    ("polypropylene", POLYPROPYLENE),
    ("bk7", BK7),
    ("sodium chloride", 1.544),
    ("amber", 1.55),
    ("pet", 1.575),
    ("diamond", 2.419),
];

/// An index of refraction.
pub(super) fn ior(object: &Object, name: &str, default: f32) -> Result<f32> {
    if let Some(Property { value: Value::String(material), loc, .. }) = object.get(name) {
        let found = IOR.iter().find(|(known, _)| known.eq_ignore_ascii_case(material));
        let names = || IOR.iter().map(|(known, _)| *known).collect::<Vec<_>>().join(", ");
        let unknown = || loc.unsupported(format!("`{material}` is no known material; there are {}", names()));
        return found.map(|(_, ior)| *ior).ok_or_else(unknown);
    }
    let value = object.float(name, default)?;
    if value > 0.0 && value.is_finite() {
        Ok(value)
    } else {
        Err(object.loc_of(name).invalid(format!("`{name}` must be positive")))
    }
}

/// Interior over exterior index of refraction.
pub(super) fn relative_ior(object: &Object, default_interior: f32) -> Result<f32> {
    Ok(ior(object, "int_ior", default_interior)? / ior(object, "ext_ior", 1.000_277)?)
}
