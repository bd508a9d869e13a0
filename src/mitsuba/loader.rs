//! Builds objects of scene files, each shared one once.

use std::cell::RefCell;
use std::collections::{BTreeSet, HashMap};
use std::path::{Path, PathBuf};
use std::rc::Rc;
use std::sync::Arc;

use glam::{DMat4, DVec3};

use super::mesh;
use super::xml;
use crate::error::{Error, Result, SourceLoc};
use crate::image::io::DataWindow;
use crate::math::{Mat4, Rgb, Vec3};
use crate::scene::bsdf::{self, Bsdf};
use crate::scene::plugin::{Loader, MeshData, Object, Property, Value, find};
use crate::scene::texture::{self, Texture};

/// Nesting deeper than this (a BSDF in a BSDF in ...) is taken for a loop of references.
const MAX_NESTING: usize = 32;
/// Materials and textures built from more objects than this are taken for a mistake.
const MAX_COST: usize = 1000;

/// Builds objects, each shared one once.
pub struct FileLoader {
    tree: xml::Tree,
    /// The file's position of the world's origin, or that of the group whose shapes are being built.
    origin: DVec3,
    /// Objects that have been built, with the number of objects that each is made of.
    bsdfs: HashMap<*const Object, (Arc<dyn Bsdf>, usize)>,
    textures: HashMap<*const Object, (Arc<dyn Texture>, usize)>,
    bitmaps: HashMap<PathBuf, Vec<(texture::Selection, Arc<texture::Texels>)>>,
    texture_memory: texture::Memory,
    meshes: HashMap<PathBuf, Vec<u8>>,
    /// Every file that a property names.
    files: RefCell<BTreeSet<PathBuf>>,
    nesting: usize,
    /// Objects that the current one is nested in.
    cost: usize,
    /// Textures that need to know all shapes.
    attributes: Vec<texture::Unbound>,
}

impl FileLoader {
    /// A loader of the objects of a file, with so many bytes of memory for textures. Positions are those of the file less
    /// `origin`.
    pub fn new(tree: xml::Tree, texture_memory: u64, origin: DVec3) -> Self {
        Self {
            tree,
            origin,
            bsdfs: HashMap::new(),
            textures: HashMap::new(),
            bitmaps: HashMap::new(),
            texture_memory: texture::Memory::new(texture_memory),
            meshes: HashMap::new(),
            files: RefCell::default(),
            nesting: 0,
            cost: 0,
            attributes: Vec::new(),
        }
    }

    /// Textures that wait for all shapes, the files that were read, and the warnings.
    pub fn finish(self) -> (Vec<texture::Unbound>, Vec<PathBuf>, Vec<String>) {
        (self.attributes, self.files.into_inner().into_iter().collect(), self.tree.warnings.into_list())
    }

    /// Builds the shapes of a group, whose coordinates are its own.
    pub fn in_group<T>(&mut self, make: impl FnOnce(&mut Self) -> Result<T>) -> Result<T> {
        let origin = std::mem::take(&mut self.origin);
        let made = make(self);
        self.origin = origin;
        made
    }

    /// Builds something nested, unless it is nested in itself.
    pub fn guarded<T>(&mut self, object: &Object, make: impl FnOnce(&mut Self) -> Result<T>) -> Result<T> {
        if self.nesting >= MAX_NESTING {
            return Err(object.loc.invalid("nested too deeply: does it refer to itself?"));
        }
        self.nesting += 1;
        let made = make(self);
        self.nesting -= 1;
        made
    }

    /// Builds something with the number of objects that looking it up goes through: references can double it at every
    /// level of nesting.
    fn counted<T>(&mut self, object: &Object, make: impl FnOnce(&mut Self) -> Result<T>) -> Result<(T, usize)> {
        let outer = std::mem::take(&mut self.cost);
        let made = self.guarded(object, make)?;
        let cost = self.cost + 1;
        if cost > MAX_COST {
            return Err(object.loc.invalid(format!("built from more than {MAX_COST} other objects")));
        }
        self.cost = outer + cost;
        Ok((made, cost))
    }

    /// The property `name` as a colour. A reflectance is none below zero, and above one is made so with a warning.
    fn color(&self, object: &Object, name: &str, default: Rgb) -> Result<Rgb> {
        let color = object.color(name, default)?;
        let is_share = name.ends_with("reflectance") || name.ends_with("transmittance") || name == "base_color";
        if object.class != "bsdf" || !is_share {
            return Ok(color);
        }
        if color.min_element() < 0.0 {
            return Err(object.loc_of(name).invalid(format!("`{name}` is {color}: light cannot be less than none")));
        }
        let largest = color.max_element();
        if largest <= 1.0 {
            return Ok(color);
        }
        self.warn(&object.loc_of(name), &format!("`{name}` is more than one: it is scaled by {:.3}", 0.99 / largest))?;
        Ok(color * (0.99 / largest))
    }

    /// Builds a texture, or gives the one already built from this object.
    pub fn texture_object(&mut self, object: &Rc<Object>) -> Result<Arc<dyn Texture>> {
        if let Some((texture, cost)) = self.textures.get(&Rc::as_ptr(object)) {
            self.cost += cost;
            return Ok(Arc::clone(texture));
        }
        if object.class != "texture" {
            return Err(object.loc.invalid(format!("a texture is needed here, not <{}>", object.class)));
        }
        let plugin = find(texture::PLUGINS, object)?;
        let (made, cost) = self.counted(object, |loader| (plugin.make)(object, loader))?;
        self.all_used(object, plugin.parameters)?;
        self.textures.insert(Rc::as_ptr(object), (Arc::clone(&made), cost));
        Ok(made)
    }
}

impl Loader for FileLoader {
    fn to_world(&self, object: &Object) -> Result<Mat4> {
        Ok((DMat4::from_translation(-self.origin) * object.exact_transform("to_world")?).as_mat4())
    }

    fn position(&self, object: &Object, name: &str, default: Vec3) -> Result<Vec3> {
        if object.get(name).is_none() {
            return Ok(default);
        }
        Ok((object.vector(name, default)?.as_dvec3() - self.origin).as_vec3())
    }

    fn warn(&self, loc: &SourceLoc, what: &str) -> Result<()> {
        self.tree.warnings.add(loc, what)
    }

    fn warn_unused(&self, object: &Object) -> Result<()> {
        object.unused().try_for_each(|property| {
            let (class, plugin) = (&object.class, &object.plugin);
            let name = match &property.value {
                Value::Object(nested) => format!("the nested {} `{}`", nested.class, nested.plugin),
                _ => format!("`{}`", property.name),
            };
            self.warn(&property.loc, &format!("{name} of {class} `{plugin}` has no meaning here and is ignored"))
        })
    }

    fn all_used(&self, object: &Object, supported: &str) -> Result<()> {
        for property in object.unused() {
            let (class, plugin) = (&object.class, &object.plugin);
            let (what, is_value) = match &property.value {
                Value::Object(nested) => {
                    (format!("{class} `{plugin}` has no use for the {} here", nested.class), false)
                }
                Value::Reference(id) => (format!("{class} `{plugin}` has no use for `{id}` here"), false),
                _ => (format!("{class} `{plugin}` has no property `{}`", property.name), true),
            };
            if object.legacy && is_value {
                self.warn(&property.loc, &format!("{what}: it is ignored; it takes: {supported}"))?;
            } else {
                return Err(property.loc.unsupported(format!("{what}; it takes: {supported}")));
            }
        }
        Ok(())
    }

    fn resolve(&self, property: &Property) -> Result<Rc<Object>> {
        match &property.value {
            Value::Object(object) => Ok(Rc::clone(object)),
            Value::Reference(id) => {
                let found = self.tree.ids.get(id).cloned();
                found.ok_or_else(|| property.loc.invalid(format!("nothing has the id `{id}`")))
            }
            _ => Err(property.loc.invalid(format!("`{}` must be a nested object", property.name))),
        }
    }

    fn bsdf(&mut self, object: &Rc<Object>) -> Result<Arc<dyn Bsdf>> {
        if let Some((bsdf, cost)) = self.bsdfs.get(&Rc::as_ptr(object)) {
            self.cost += cost;
            return Ok(Arc::clone(bsdf));
        }
        let plugin = find(bsdf::PLUGINS, object)?;
        // Reflectances above one are the file's to avoid.
        object.ignore(&["ensure_energy_conservation"]);
        let (made, cost) = self.counted(object, |loader| (plugin.make)(object, loader))?;
        self.all_used(object, plugin.parameters)?;
        self.bsdfs.insert(Rc::as_ptr(object), (Arc::clone(&made), cost));
        Ok(made)
    }

    fn nested_bsdfs(&mut self, object: &Object) -> Result<Vec<Arc<dyn Bsdf>>> {
        let mut found = Vec::new();
        for property in object.nested() {
            let nested = self.resolve(property)?;
            if nested.class == "bsdf" {
                property.take();
                found.push(self.bsdf(&nested)?);
            }
        }
        Ok(found)
    }

    fn nested_bsdf(&mut self, object: &Object) -> Result<Arc<dyn Bsdf>> {
        let mut found = self.nested_bsdfs(object)?;
        match (found.pop(), found.is_empty()) {
            (Some(bsdf), true) => Ok(bsdf),
            _ => Err(object.loc.invalid(format!("bsdf `{}` needs exactly one nested bsdf", object.plugin))),
        }
    }

    fn nested_texture(&mut self, object: &Object) -> Result<Arc<dyn Texture>> {
        let mut found = None;
        for property in object.nested() {
            let nested = self.resolve(property)?;
            if nested.class == "texture" && found.is_none() {
                property.take();
                found = Some(self.texture_object(&nested)?);
            }
        }
        found.ok_or_else(|| object.loc.invalid(format!("`{}` needs a nested texture", object.plugin)))
    }

    fn texture(&mut self, object: &Object, name: &str, default: Rgb) -> Result<Arc<dyn Texture>> {
        match object.get(name) {
            Some(property) if matches!(property.value, Value::Object(_) | Value::Reference(_)) => {
                let nested = self.resolve(property)?;
                self.texture_object(&nested)
            }
            _ => Ok(Arc::new(texture::Constant(self.color(object, name, default)?))),
        }
    }

    fn radiance(&mut self, object: &Object, name: &str) -> Result<Arc<dyn Texture>> {
        match object.get(name) {
            Some(property @ Property { value: Value::Object(_) | Value::Reference(_), .. }) => {
                let nested = self.resolve(property)?;
                match texture::spectra::curve(&nested)? {
                    Some(spectrum) => Ok(Arc::new(texture::Constant(spectrum.emission()))),
                    None => self.texture_object(&nested),
                }
            }
            _ => Ok(Arc::new(texture::Constant(object.emission(name, Rgb::ONE)?))),
        }
    }

    fn uniform_radiance(&mut self, object: &Object, name: &str) -> Result<Rgb> {
        let radiance = self.radiance(object, name)?;
        let what = format!("a texture as the `{name}` of `{}`; it is one colour", object.plugin);
        radiance.constant().ok_or_else(|| object.loc_of(name).unsupported(what))
    }

    fn file(&self, object: &Object) -> Result<PathBuf> {
        let name = object.string("filename", "")?;
        if name.is_empty() {
            return Err(object.loc.invalid(format!("{} `{}` needs a `filename`", object.class, object.plugin)));
        }
        let folders = &self.tree.folders;
        let found = folders.find_file(&name);
        let found = found.ok_or_else(|| object.loc_of("filename").invalid(folders.missing(&name)))?;
        self.files.borrow_mut().insert(found.clone());
        Ok(found)
    }

    fn texels(&mut self, object: &Object, selection: texture::Selection) -> Result<Arc<texture::Texels>> {
        let path = self.file(object)?;
        let read = self.bitmaps.entry(path.clone()).or_default();
        if let Some((_, texels)) = read.iter().find(|(known, _)| *known == selection) {
            return Ok(Arc::clone(texels));
        }
        let (texels, odd) = texture::Texels::read(&path, &selection, &mut self.texture_memory)?;
        if let Some(DataWindow { origin: (x, y), full: (width, height) }) = odd.window {
            let (w, h) = (texels.width, texels.height);
            let what = format!("the file has {w}x{h} pixels at {x},{y} of a picture of {width}x{height}");
            self.warn(
                &SourceLoc::file(&path),
                &format!("{what}: they are stretched over the whole texture, as by Mitsuba"),
            )?;
        }
        let infinite = odd.infinite;
        if infinite > 0 {
            let what = format!("{infinite} texels are not finite: infinity counts as 65504, NaN as zero");
            self.warn(&SourceLoc::file(&path), &what)?;
        }
        let texels = Arc::new(texels);
        self.bitmaps.entry(path).or_default().push((selection, Arc::clone(&texels)));
        Ok(texels)
    }

    fn mesh(&mut self, object: &Object) -> Result<MeshData> {
        let path = self.file(object)?;
        let bytes = |path: &Path| std::fs::read(path).map_err(|error| Error::io(path, error));
        if object.plugin != "serialized" {
            return mesh::read(&object.plugin, &bytes(&path)?, 0, &path);
        }
        let index = usize::try_from(object.integer("shape_index", 0)?)
            .map_err(|_| object.loc_of("shape_index").invalid("`shape_index` cannot be negative"))?;
        // One such file holds many meshes.
        if !self.meshes.contains_key(&path) {
            self.meshes.insert(path.clone(), bytes(&path)?);
        }
        mesh::read(&object.plugin, &self.meshes[&path], index, &path)
    }

    fn bind_later(&mut self, attribute: texture::Unbound) {
        self.attributes.push(attribute);
    }
}
