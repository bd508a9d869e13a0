//! Names of scene files up to version 0.6, as version 3 has them.

use super::transform;
use crate::error::SourceLoc;
use crate::math::vec3;
use crate::scene::plugin::{Property, Value};

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

/// An element of an older file.
pub struct Legacy<'a> {
    /// Its tag.
    pub class: &'a str,
    /// Its `type`.
    pub plugin: String,
    /// Location in the file.
    pub loc: &'a SourceLoc,
    /// Its properties, their names in snake case already.
    pub properties: &'a mut Vec<Property>,
}

impl Legacy<'_> {
    /// Gives the element the names and defaults that it would have today; returns its `type`.
    pub fn modernize(mut self) -> String {
        match (self.class, self.plugin.as_str()) {
            ("bsdf", "diffuse") => self.rename("diffuse_reflectance", "reflectance"),
            ("bsdf", "bump") => self.plugin = "bumpmap".into(),
            // Metal is copper unless the file says otherwise.
            ("bsdf", "conductor" | "roughconductor")
                if ["material", "eta", "k"].iter().all(|name| self.find(name).is_none()) =>
            {
                self.push("material", Value::String("Cu".into()));
            }
            ("texture", "bitmap") => self.bitmap(),
            ("emitter", "envmap") => {
                self.remove(&["cache"]);
                self.gamma();
            }
            ("integrator", _) => self.push("keep_emitters", Value::Boolean(true)),
            ("emitter", "sun" | "sky" | "sunsky") => self.push("convention", Value::String("0.6".into())),
            _ => {}
        }
        self.gather_to_uv();
        self.plugin
    }

    fn find(&self, name: &str) -> Option<&Property> {
        self.properties.iter().find(|property| property.name == name)
    }

    fn push(&mut self, name: &str, value: Value) {
        self.properties.push(Property::new(name.into(), value, self.loc.clone()));
    }

    fn rename(&mut self, old: &str, new: &str) {
        if let Some(property) = self.properties.iter_mut().find(|property| property.name == old) {
            property.name = new.into();
        }
    }

    fn remove(&mut self, names: &[&str]) {
        self.properties.retain(|property| !names.contains(&property.name.as_str()));
    }

    fn number(&self, name: &str) -> Option<f32> {
        match self.find(name)?.value {
            Value::Float(value) => Some(value as f32),
            Value::Integer(value) => Some(value as f32),
            _ => None,
        }
    }

    /// Filters are for camera rays that know their footprint, which a pixel's samples average over.
    fn bitmap(&mut self) {
        let smooth =
            |value: &Value| matches!(value, Value::String(name) if ["trilinear", "ewa"].contains(&name.as_str()));
        for property in self.properties.iter_mut().filter(|property| property.name == "filter_type") {
            if smooth(&property.value) {
                property.value = Value::String("bilinear".into());
            }
        }
        self.remove(&["cache", "max_anisotropy"]);
        self.gamma();
    }

    /// Zero and -1 stand for the file's own.
    fn gamma(&mut self) {
        if self.number("gamma").is_some_and(|gamma| gamma <= 0.0) {
            self.remove(&["gamma"]);
        }
    }

    /// Gathers the scale and offset of textures in `to_uv`.
    fn gather_to_uv(&mut self) {
        const PARTS: [&str; 5] = ["uscale", "vscale", "uvscale", "uoffset", "voffset"];
        if PARTS.iter().all(|name| self.find(name).is_none()) {
            return;
        }
        let number = |name: &str, default: f32| self.number(name).unwrap_or(default);
        let both = number("uvscale", 1.0);
        let offset = vec3(number("uoffset", 0.0), number("voffset", 0.0), 0.0);
        let scale = vec3(number("uscale", both), number("vscale", both), 1.0);
        let to_uv = transform::chain(&[transform::translate(offset), transform::scale(scale)]);
        self.remove(&PARTS);
        self.push("to_uv", Value::Transform(to_uv));
    }
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
