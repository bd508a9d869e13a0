//! Typed properties of an element, as plugins read them: one that is never read is an error.

use std::cell::Cell;
use std::rc::Rc;

use glam::DMat4;

use crate::error::{Error, Result, SourceLoc};
use crate::math::{Mat4, Rgb, Vec3};
use crate::scene::spectrum::Spectrum;

/// A property's value.
#[derive(Clone, Debug)]
pub enum Value {
    /// `<float>`.
    Float(f64),
    /// `<integer>`.
    Integer(i64),
    /// `<boolean>`.
    Boolean(bool),
    /// `<string>`.
    String(String),
    /// `<point>` or `<vector>`.
    Vector(Vec3),
    /// `<rgb>`.
    Color(Rgb),
    /// `<spectrum>`.
    Spectrum(Spectrum),
    /// `<transform>`.
    Transform(DMat4),
    /// `<ref>` to an object by its id.
    Reference(String),
    /// A nested element with a `type`.
    Object(Rc<Object>),
}

/// A named value and its location.
#[derive(Debug)]
pub struct Property {
    /// The `name` attribute; nested objects may have none.
    pub name: String,
    /// The value.
    pub value: Value,
    /// Location in the file.
    pub loc: SourceLoc,
    used: Cell<bool>,
}

impl Property {
    /// A property that has not been read yet.
    pub fn new(name: String, value: Value, loc: SourceLoc) -> Self {
        Self { name, value, loc, used: Cell::new(false) }
    }

    /// Marks a nested object as used.
    pub fn take(&self) {
        self.used.set(true);
    }

    fn mistyped(&self, expected: &str) -> Error {
        self.loc.invalid(format!("`{}` must be {expected}", self.name))
    }
}

/// An element such as `<bsdf type="diffuse">` with its properties.
#[derive(Debug)]
pub struct Object {
    /// The element's tag: shape, bsdf, emitter and so on.
    pub class: String,
    /// Its `type`.
    pub plugin: String,
    /// Its `id`, if it has one.
    pub id: Option<String>,
    /// Location in the file.
    pub loc: SourceLoc,
    /// Whether the file is of version 0.6 or before.
    pub legacy: bool,
    /// Everything in it, in order.
    pub properties: Vec<Property>,
}

impl Object {
    /// The property `name`, marked as used.
    pub fn get(&self, name: &str) -> Option<&Property> {
        let found = self.properties.iter().find(|property| property.name == name)?;
        found.used.set(true);
        Some(found)
    }

    /// A number; whole numbers are taken too.
    pub fn float(&self, name: &str, default: f32) -> Result<f32> {
        match self.get(name) {
            None => Ok(default),
            Some(property) => match property.value {
                Value::Float(value) => Ok(value as f32),
                Value::Integer(value) => Ok(value as f32),
                _ => Err(property.mistyped("a number (<float>)")),
            },
        }
    }

    /// A whole number.
    pub fn integer(&self, name: &str, default: i64) -> Result<i64> {
        match self.get(name) {
            None => Ok(default),
            Some(Property { value: Value::Integer(value), .. }) => Ok(*value),
            Some(property) => Err(property.mistyped("a whole number (<integer>)")),
        }
    }

    /// True or false.
    pub fn boolean(&self, name: &str, default: bool) -> Result<bool> {
        match self.get(name) {
            None => Ok(default),
            Some(Property { value: Value::Boolean(value), .. }) => Ok(*value),
            Some(property) => Err(property.mistyped("true or false (<boolean>)")),
        }
    }

    /// A string.
    pub fn string(&self, name: &str, default: &str) -> Result<String> {
        match self.get(name) {
            None => Ok(default.to_owned()),
            Some(Property { value: Value::String(value), .. }) => Ok(value.clone()),
            Some(property) => Err(property.mistyped("a string (<string>)")),
        }
    }

    /// A string out of a few, by its position among them.
    pub fn choice(&self, name: &str, choices: &[&str], default: usize) -> Result<usize> {
        let value = self.string(name, choices[default])?;
        choices.iter().position(|choice| choice.eq_ignore_ascii_case(&value)).ok_or_else(|| {
            self.loc_of(name).unsupported(format!("`{name}` is `{value}`; it may be {}", choices.join(", ")))
        })
    }

    /// A linear colour; a plain number is taken as grey.
    pub fn color(&self, name: &str, default: Rgb) -> Result<Rgb> {
        match self.get(name) {
            None => Ok(default),
            Some(property) => match property.value {
                Value::Color(color) => Ok(color),
                Value::Float(value) => Ok(Rgb::splat(value as f32)),
                Value::Integer(value) => Ok(Rgb::splat(value as f32)),
                Value::Spectrum(ref spectrum) => Ok(spectrum.reflectance()),
                _ => Err(property.mistyped("a colour (<rgb>)")),
            },
        }
    }

    /// A complex index of refraction's part for red, green and blue.
    pub fn index(&self, name: &str, default: Rgb) -> Result<Rgb> {
        match self.get(name) {
            Some(Property { value: Value::Spectrum(spectrum), .. }) => Ok(spectrum.in_daylight()),
            _ => self.color(name, default),
        }
    }

    /// A linear colour of light.
    pub fn emission(&self, name: &str, default: Rgb) -> Result<Rgb> {
        match self.get(name) {
            Some(Property { value: Value::Spectrum(spectrum), .. }) => Ok(spectrum.emission()),
            _ => self.color(name, default),
        }
    }

    /// A point or a vector.
    pub fn vector(&self, name: &str, default: Vec3) -> Result<Vec3> {
        match self.get(name) {
            None => Ok(default),
            Some(Property { value: Value::Vector(value), .. }) => Ok(*value),
            Some(property) => Err(property.mistyped("a point (<point>)")),
        }
    }

    /// A transform of directions or of texture coordinates, which must be invertible. [`to_world`](super::Loader::to_world) has those
    /// of positions in the world.
    pub fn transform(&self, name: &str) -> Result<Mat4> {
        Ok(self.exact_transform(name)?.as_mat4())
    }

    /// The same in double precision.
    pub fn exact_transform(&self, name: &str) -> Result<DMat4> {
        match self.get(name) {
            None => Ok(DMat4::IDENTITY),
            Some(Property { value: Value::Transform(matrix), loc, .. }) => {
                let determinant = matrix.as_mat4().as_dmat4().determinant();
                if determinant == 0.0 || !determinant.is_finite() {
                    return Err(loc.invalid(format!("the transform `{name}` cannot be inverted")));
                }
                Ok(*matrix)
            }
            Some(property) => Err(property.mistyped("a transform (<transform>)")),
        }
    }

    /// Location of the property `name`, or of the object if it is absent.
    pub fn loc_of(&self, name: &str) -> SourceLoc {
        self.properties.iter().find(|property| property.name == name).map_or(&self.loc, |p| &p.loc).clone()
    }

    /// Nested objects and references. Whoever takes one marks it with [`Property::take`].
    pub fn nested(&self) -> impl Iterator<Item = &Property> {
        self.properties.iter().filter(|property| matches!(property.value, Value::Object(_) | Value::Reference(_)))
    }

    /// Marks properties that are known and have no meaning here.
    pub fn ignore(&self, names: &[&str]) {
        for name in names {
            self.get(name);
        }
    }

    /// Properties that were never read.
    pub fn unused(&self) -> impl Iterator<Item = &Property> {
        self.properties.iter().filter(|property| !property.used.get())
    }
}
