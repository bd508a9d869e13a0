//! Names of scene files up to version 0.6, as version 3 has them.

use super::props::{Property, Value};
use super::transform;
use crate::math::vec3;

/// `toWorld` as `to_world`, `intIOR` as `int_ior`.
pub fn snake_case(name: &str) -> String {
    let mut result = String::new();
    let mut after_lower = false;
    for c in name.chars() {
        if c.is_uppercase() && after_lower {
            result.push('_');
        }
        after_lower = c.is_lowercase() || c.is_ascii_digit();
        result.extend(c.to_lowercase());
    }
    result
}

/// Renames what one plugin called differently, and gathers the scale and offset of textures in `to_uv`.
pub fn rename(plugin: &str, properties: &mut Vec<Property>) {
    let old = properties.iter_mut().find(|property| plugin == "diffuse" && property.name == "diffuse_reflectance");
    if let Some(property) = old {
        property.name = "reflectance".into();
    }
    let number = |name: &str, default: f32| {
        let found = properties.iter().find(|property| property.name == name);
        match found.map(|property| &property.value) {
            Some(Value::Float(value)) => *value as f32,
            Some(Value::Integer(value)) => *value as f32,
            _ => default,
        }
    };
    const PARTS: [&str; 4] = ["uscale", "vscale", "uoffset", "voffset"];
    let Some(loc) = properties.iter().find(|property| PARTS.contains(&property.name.as_str())) else { return };
    let loc = loc.loc.clone();
    let offset = vec3(number("uoffset", 0.0), number("voffset", 0.0), 0.0);
    let scale = vec3(number("uscale", 1.0), number("vscale", 1.0), 1.0);
    let to_uv = transform::chain(&[transform::translate(offset), transform::scale(scale)]);
    properties.retain(|property| !PARTS.contains(&property.name.as_str()));
    properties.push(Property::new("to_uv".into(), Value::Transform(to_uv), loc));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn camel_case_becomes_snake_case() {
        for (old, new) in [("toWorld", "to_world"), ("intIOR", "int_ior"), ("maxDepth", "max_depth"), ("fov", "fov")] {
            assert_eq!(snake_case(old), new);
        }
    }
}
