//! Elements of scene files as objects and their properties.

use std::collections::HashMap;
use std::rc::Rc;

use glam::DMat4;

use super::legacy::{self, Legacy};
use super::transform;
use super::xml::{At, Parser};
use crate::error::{Error, Result, SourceLoc};
use crate::math::Vec3;
use crate::scene::plugin::values;
use crate::scene::plugin::{Object, Property, Value};
use crate::scene::spectrum::Spectrum;

impl Parser {
    /// An element as a property of the one that it is in.
    pub fn property(&mut self, at: At) -> Result<Property> {
        let name = self.optional(at, "name")?.unwrap_or_default();
        let name = if self.legacy { legacy::snake_case(&name) } else { name };
        let value = self.value(at)?;
        // Objects see to their own, and those of references are others'.
        let is_value = !matches!(value, Value::Object(_)) && at.tag() != "ref";
        if let (true, Some(id)) = (is_value, self.optional(at, "id")?) {
            if self.tree.ids.contains_key(&id) || self.values.insert(id.clone(), value.clone()).is_some() {
                return Err(at.loc().invalid(format!("the id `{id}` is given twice")));
            }
        }
        Ok(Property::new(name, value, at.loc()))
    }

    fn value(&mut self, at: At) -> Result<Value> {
        let loc = at.loc();
        let text = |parser: &mut Self| parser.attribute(at, "value");
        Ok(match at.tag() {
            "float" => Value::Float(values::number(&text(self)?, &loc)?),
            "integer" => Value::Integer(values::integer(&text(self)?, &loc)?),
            "boolean" => Value::Boolean(values::boolean(&text(self)?, &loc)?),
            "string" => Value::String(text(self)?),
            "rgb" => Value::Color(values::rgb(&text(self)?, &loc)?),
            "srgb" => Value::Color(values::srgb(&text(self)?, &loc)?),
            "spectrum" if at.element.attribute("type").is_none() => self.spectrum(at)?,
            "blackbody" => self.blackbody(at)?,
            "point" | "vector" => Value::Vector(self.vector(at, 0.0)?),
            "transform" => Value::Transform(self.transform(at)?),
            "animation" => {
                let first = at.children().find(|child| child.tag() == "transform");
                let first = first.ok_or_else(|| loc.invalid("an <animation> needs at least one <transform>"))?;
                self.tree.warnings.add(&loc, "nothing moves here: an <animation> stays at its first keyframe")?;
                Value::Transform(self.transform(first)?)
            }
            "ref" => {
                let id = self.attribute(at, "id")?;
                self.values.get(&id).cloned().unwrap_or(Value::Reference(id))
            }
            _ => Value::Object(self.object(at)?),
        })
    }

    fn spectrum(&mut self, at: At) -> Result<Value> {
        let loc = at.loc();
        if let Some(name) = self.optional(at, "filename")? {
            return Ok(Value::Spectrum(self.spectrum_file(&name, &loc)?));
        }
        let text = self.attribute(at, "value")?;
        // Version 0.6 had red, green and blue as spectra, too.
        let is_color = !text.contains(':') && (self.legacy || values::split(&text).count() == 3);
        if is_color || text.trim_start().starts_with('#') {
            return Ok(Value::Color(values::rgb(&text, &loc)?));
        }
        Ok(Value::Spectrum(Spectrum::parse(&text, &loc)?))
    }

    /// `<blackbody temperature="5000K" scale="1"/>` of version 0.6.
    fn blackbody(&mut self, at: At) -> Result<Value> {
        let loc = at.loc();
        let temperature = self.attribute(at, "temperature")?;
        let kelvin = values::number(temperature.trim().trim_end_matches(['K', 'k']), &loc)?;
        let scale = self.optional(at, "scale")?.map_or(Ok(1.0), |text| values::number(&text, &loc))?;
        Ok(Value::Spectrum(Spectrum::blackbody(kelvin, scale, &loc)?))
    }

    fn object(&mut self, at: At) -> Result<Rc<Object>> {
        let mut plugin = match self.optional(at, "type")? {
            // Types are names of files, which have no capitals, and not every system distinguishes case.
            Some(plugin) => plugin.to_lowercase(),
            None => {
                return Err(at
                    .loc()
                    .invalid(format!("<{}> is no element that is known, nor has it a `type`", at.tag())));
            }
        };
        let mut properties = Vec::new();
        for child in at.children() {
            let mut take = |parser: &mut Self, at: At| {
                properties.push(parser.property(at)?);
                Ok(())
            };
            match child.tag() {
                "include" => self.include(child, &mut take)?,
                _ => take(self, child)?,
            }
        }
        if self.legacy {
            let (class, loc) = (at.tag(), &at.loc());
            plugin = Legacy { class, plugin, loc, properties: &mut properties }.modernize();
        }
        check_names(&properties)?;
        let id = self.optional(at, "id")?;
        // Mitsuba's own files write textures either way.
        let class = if at.tag() == "spectrum" { "texture" } else { at.tag() }.to_owned();
        let object = Rc::new(Object { class, plugin, id: id.clone(), loc: at.loc(), legacy: self.legacy, properties });
        if let Some(id) = id {
            if self.values.contains_key(&id) || self.tree.ids.insert(id.clone(), Rc::clone(&object)).is_some() {
                return Err(at.loc().invalid(format!("the id `{id}` is given twice")));
            }
        }
        Ok(object)
    }

    /// x, y, z attributes, or three numbers in `value`.
    fn vector(&mut self, at: At, missing: f32) -> Result<Vec3> {
        if let Some(text) = self.optional(at, "value")? {
            return values::triple(&text, &at.loc());
        }
        let mut result = [missing; 3];
        for (slot, name) in result.iter_mut().zip(["x", "y", "z"]) {
            if let Some(text) = self.optional(at, name)? {
                *slot = values::number(&text, &at.loc())? as f32;
            }
        }
        Ok(Vec3::from_array(result))
    }

    fn transform(&mut self, at: At) -> Result<DMat4> {
        let mut steps = Vec::new();
        for child in at.children() {
            let loc = child.loc();
            steps.push(match child.tag() {
                "translate" => transform::translate(self.vector(child, 0.0)?),
                "scale" => {
                    let uniform = self.optional(child, "value")?.filter(|text| values::split(text).count() == 1);
                    match uniform {
                        Some(text) => transform::scale(Vec3::splat(values::number(&text, &loc)? as f32)),
                        None => transform::scale(self.vector(child, 1.0)?),
                    }
                }
                "rotate" => {
                    let angle = values::number(&self.attribute(child, "angle")?, &loc)?;
                    transform::rotate(self.vector(child, 0.0)?, angle, &loc)?
                }
                "lookat" | "lookAt" | "look_at" => {
                    let [origin, target] = ["origin", "target"].map(|name| self.attribute(child, name));
                    let up = self.optional(child, "up")?;
                    let up = up.map_or(Ok(Vec3::ZERO), |text| values::triple(&text, &loc))?;
                    transform::look_at(values::triple(&origin?, &loc)?, values::triple(&target?, &loc)?, up, &loc)?
                }
                "matrix" => transform::matrix(&values::numbers(&self.attribute(child, "value")?, &loc)?, &loc)?,
                other => {
                    let known = "translate, scale, rotate, lookat, matrix";
                    return Err(loc.invalid(format!("unknown transform <{other}>; there are {known}")));
                }
            });
        }
        Ok(transform::chain(&steps))
    }

    fn spectrum_file(&self, name: &str, loc: &SourceLoc) -> Result<Spectrum> {
        let folders = &self.tree.folders;
        let path = folders.find_file(name).ok_or_else(|| loc.invalid(folders.missing(name)))?;
        let text = std::fs::read_to_string(&path).map_err(|error| Error::io(&path, error))?;
        Spectrum::parse_file(&text, &SourceLoc::file(&path))
    }
}

/// A property that is given twice has no value.
fn check_names(properties: &[Property]) -> Result<()> {
    let mut lines = HashMap::new();
    for property in properties.iter().filter(|property| !property.name.is_empty()) {
        if let Some(line) = lines.insert(&property.name, property.loc.line) {
            let what = format!("`{}` is given twice, before in line {line}: remove one", property.name);
            return Err(property.loc.invalid(what));
        }
    }
    Ok(())
}
