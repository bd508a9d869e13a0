//! The wall between scenes and the files that they are read from: a plugin is built from an [`Object`] of a file, and asks the file's
//! reader, a [`Loader`], for everything else. Nothing here or in the other rooms of a scene knows which format a file has.

mod mesh_data;
mod object;
mod unsupported;
pub mod values;

use std::path::PathBuf;
use std::rc::Rc;
use std::sync::Arc;

pub use self::mesh_data::MeshData;
pub use self::object::{Object, Property, Value};
pub use self::unsupported::{UNSUPPORTED, find, unknown};
use crate::error::{Result, SourceLoc};
use crate::math::{Mat4, Rgb, Vec3};
use crate::scene::bsdf::Bsdf;
use crate::scene::texture::{Selection, Texels, Texture, Unbound};

/// One row of a plugin table: name, parameters and constructor.
pub struct Plugin<T: 'static> {
    /// The `type` in scene files.
    pub name: &'static str,
    /// Its properties, for messages and documentation.
    pub parameters: &'static str,
    /// Builds it from its object.
    pub make: fn(&Object, &mut dyn Loader) -> Result<T>,
}

/// Reader of a file, as plugins see it. Objects that are shared are built once.
pub trait Loader {
    /// The object that a property holds or refers to.
    fn resolve(&self, property: &Property) -> Result<Rc<Object>>;

    /// The property `to_world`: from the object's own coordinates to those of the world, or of the group that it is in.
    fn to_world(&self, object: &Object) -> Result<Mat4>;

    /// A position in the world.
    fn position(&self, object: &Object, name: &str, default: Vec3) -> Result<Vec3>;

    /// The file that the property `filename` names.
    fn file(&self, object: &Object) -> Result<PathBuf>;

    /// The texels of the image file that an object names, each selection read once.
    fn texels(&mut self, object: &Object, selection: Selection) -> Result<Arc<Texels>>;

    /// The mesh of a shape object whose type is a format of meshes.
    fn mesh(&mut self, object: &Object) -> Result<MeshData>;

    /// Builds a BSDF, or gives the one that was built from the object before.
    fn bsdf(&mut self, object: &Rc<Object>) -> Result<Arc<dyn Bsdf>>;

    /// The BSDFs nested in an object.
    fn nested_bsdfs(&mut self, object: &Object) -> Result<Vec<Arc<dyn Bsdf>>>;

    /// The one BSDF nested in an object.
    fn nested_bsdf(&mut self, object: &Object) -> Result<Arc<dyn Bsdf>>;

    /// The one texture nested in an object, whatever its name.
    fn nested_texture(&mut self, object: &Object) -> Result<Arc<dyn Texture>>;

    /// The property `name` as a texture: a colour, a number, or a nested texture.
    fn texture(&mut self, object: &Object, name: &str, default: Rgb) -> Result<Arc<dyn Texture>>;

    /// The property `name` as emitted light, white when absent.
    fn radiance(&mut self, object: &Object, name: &str) -> Result<Arc<dyn Texture>>;

    /// The property `name` as emitted light where it has to be a single colour.
    fn uniform_radiance(&mut self, object: &Object, name: &str) -> Result<Rgb>;

    /// Keeps a texture that needs to know all shapes, until they are known.
    fn bind_later(&mut self, attribute: Unbound);

    /// Warns that something does not mean what it says; fails where warnings are errors.
    fn warn(&self, loc: &SourceLoc, what: &str) -> Result<()>;

    /// Warns of every property of an object that was never read and might change the image.
    fn warn_unused(&self, object: &Object) -> Result<()>;

    /// Fails on the first property that was never read; `supported` lists the known ones.
    fn all_used(&self, object: &Object, supported: &str) -> Result<()>;
}
