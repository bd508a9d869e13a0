//! Scene files to a [`Scene`]: `xml` reads the text into objects, the plugin tables of the sibling folders turn
//! objects into shapes, materials and emitters. Everything that can fail fails here.

mod contents;
pub mod integrator;
mod legacy;
pub mod mesh;
pub mod props;
mod spectrum;
mod transform;
mod xml;

use std::cell::RefCell;
use std::collections::{BTreeSet, HashMap};
use std::path::{Path, PathBuf};
use std::rc::Rc;
use std::sync::Arc;

pub use self::contents::CONTAINERS;
use self::contents::Contents;
pub use self::mesh::MeshData;
use self::props::{Object, Property, Value};
use super::bsdf::{self, Bsdf};
use super::shape::Geometry;
use super::texture::{self, Texture};
use super::{Scene, SceneDescription, sensor};
use crate::error::{Error, Result, SourceLoc};
use crate::math::{Rgb, rng};

/// Nesting deeper than this (a BSDF in a BSDF in ...) is taken for a loop of references.
const MAX_NESTING: usize = 32;
/// Materials and textures built from more objects than this are taken for a mistake.
const MAX_COST: usize = 1000;
/// Films with more pixels than this are taken for a mistake.
const MAX_PIXELS: u64 = 1 << 28;

/// Options that override the scene file.
#[derive(Clone, Debug)]
pub struct Options {
    /// Values for the file's `$name` parameters, over its `<default>`s.
    pub parameters: Vec<(String, String)>,
    /// Film size in place of the file's.
    pub size: Option<(usize, usize)>,
    /// Threads for building (0: all).
    pub threads: usize,
    /// Bytes of image textures to hold in memory; files beyond them are read tile by tile as they are needed.
    pub texture_memory: u64,
}

impl Default for Options {
    fn default() -> Self {
        Self { parameters: Vec::new(), size: None, threads: 0, texture_memory: 4 << 30 }
    }
}

/// One row of a plugin table: name, parameters and constructor.
pub struct Plugin<T: 'static> {
    /// The `type` in scene files.
    pub name: &'static str,
    /// Its properties, for messages and documentation.
    pub parameters: &'static str,
    /// Builds it from its object.
    pub make: fn(&Object, &mut Loader) -> Result<T>,
}

/// Builds objects, each shared one once.
pub struct Loader {
    tree: xml::Tree,
    /// Objects that have been built, with the number of objects that each is made of.
    bsdfs: HashMap<*const Object, (Arc<dyn Bsdf>, usize)>,
    textures: HashMap<*const Object, (Arc<dyn Texture>, usize)>,
    bitmaps: HashMap<PathBuf, Arc<texture::Texels>>,
    texture_memory: texture::Memory,
    meshes: HashMap<PathBuf, Vec<u8>>,
    /// Every file that a property names.
    files: RefCell<BTreeSet<PathBuf>>,
    nesting: usize,
    /// Objects that the current one is nested in.
    cost: usize,
    /// Textures that need to know all shapes.
    pub attributes: Vec<texture::Unbound>,
}

/// Loads a scene file with everything it refers to.
pub fn load(path: &Path, options: &Options) -> Result<Scene> {
    build(path, xml::parse(path, None, &options.parameters)?, options)
}

/// Loads a scene from the text of a scene file. Files that it names are looked for in the current folder.
pub fn load_text(text: &str, options: &Options) -> Result<Scene> {
    let path = Path::new("scene.xml");
    build(path, xml::parse(path, Some(text), &options.parameters)?, options)
}

fn build(path: &Path, tree: xml::Tree, options: &Options) -> Result<Scene> {
    let objects = tree.objects.clone();
    // Definitions that the text uses belong to it.
    let used = |name: &str| tree.sources.iter().any(|source| source.contains(&format!("${name}")));
    let mut given: Vec<_> = options.parameters.iter().filter(|(name, _)| used(name)).collect();
    given.sort();
    let definitions = given.iter().flat_map(|(name, value)| [name, value]);
    let text = tree.sources.iter().chain(definitions).flat_map(|text| text.bytes());
    let fingerprint = text.fold(0, |h, b| rng::combine(h, u64::from(b)));
    let mut loader = Loader {
        tree,
        bsdfs: HashMap::new(),
        textures: HashMap::new(),
        bitmaps: HashMap::new(),
        texture_memory: texture::Memory::new(options.texture_memory),
        meshes: HashMap::new(),
        files: RefCell::default(),
        nesting: 0,
        cost: 0,
        attributes: Vec::new(),
    };
    let mut contents = Contents::default();
    let (mut sensor, mut integrator) = (None, None);
    for object in &objects {
        match object.class.as_str() {
            "shape" => contents.shape(object, &mut loader)?,
            "emitter" => contents.emitter(object, &mut loader)?,
            // Of several cameras the first one renders.
            "sensor" if sensor.is_some() => {}
            "sensor" => sensor = Some(sensor::load(object, &mut loader, options.size, MAX_PIXELS)?),
            "integrator" => integrator = Some(integrator::load(object, &loader)?),
            // Named materials that no shape uses are allowed, and need not even be understood.
            "bsdf" | "texture" => {}
            other => {
                let known = "shape, bsdf, texture, emitter, sensor, integrator";
                return Err(object.loc.unsupported(format!("<{other}> in a scene; there are {known}")));
            }
        }
    }
    let loc = SourceLoc::file(path);
    let sensor = sensor.ok_or_else(|| loc.invalid("the scene has no sensor"))?;
    let Contents { shapes, groups, emitters } = contents;
    let integrator = integrator.unwrap_or_default();
    let groups = groups.into_values();
    let grouped = groups.iter().flat_map(|group| &group.shapes);
    texture::bind(loader.attributes, shapes.iter().chain(grouped).map(|shape| &shape.geometry))?;
    let files = loader.files.into_inner().into_iter().collect();
    let parts = SceneDescription { shapes, groups, emitters, sensor, integrator, fingerprint, files };
    Scene::build(parts, options.threads).map_err(|error| match error {
        Error::BadData(what) => loc.invalid(what),
        other => other,
    })
}

/// Plugins of Mitsuba 3 that are not supported, with the reason or a replacement.
pub const UNSUPPORTED: &[(&str, &str, &str)] = &[
    ("emitter", "sunsky", "bake it into an envmap; its tables of measured skies are not at hand"),
    ("emitter", "directionalarea", "paths from the camera never meet its parallel light; use a spot or an area"),
    ("emitter", "projector", "use a spot with a texture"),
    ("bsdf", "hair", "curves are not traced"),
    ("bsdf", "measured", "measured materials are not read; principled comes near"),
    ("bsdf", "polarizer", "light is not polarised here"),
    ("bsdf", "retarder", "light is not polarised here"),
    ("bsdf", "circular", "light is not polarised here"),
    ("bsdf", "pplastic", "light is not polarised here; use roughplastic"),
    ("shape", "bsplinecurve", "curves are not traced; export them as a mesh"),
    ("shape", "linearcurve", "curves are not traced; export them as a mesh"),
    ("shape", "sdfgrid", "distance fields are not traced; export them as a mesh"),
    ("shape", "ellipsoids", "splats are not traced"),
    ("shape", "ellipsoidsmesh", "splats are not traced"),
    ("texture", "volume", "volumes are not supported"),
];

/// The table's row for an object, or an error that lists the known ones.
pub fn find<'a, T>(table: &'a [Plugin<T>], object: &Object) -> Result<&'a Plugin<T>> {
    table.iter().find(|plugin| plugin.name == object.plugin).ok_or_else(|| {
        let (class, plugin) = (&object.class, &object.plugin);
        let reason = UNSUPPORTED.iter().find(|(other, name, _)| other == class && name == plugin);
        let what = match reason {
            Some((.., reason)) => format!("{class} `{plugin}` is not supported: {reason}"),
            None => {
                let names: Vec<_> = table.iter().map(|plugin| plugin.name).collect();
                format!("{class} `{plugin}` is not known; there are {}", names.join(", "))
            }
        };
        object.loc.unsupported(what)
    })
}

impl Loader {
    /// The object a property holds or refers to.
    pub fn resolve(&self, property: &Property) -> Result<Rc<Object>> {
        match &property.value {
            Value::Object(object) => Ok(Rc::clone(object)),
            Value::Reference(id) => {
                let found = self.tree.ids.get(id).cloned();
                found.ok_or_else(|| property.loc.invalid(format!("nothing has the id `{id}`")))
            }
            _ => Err(property.loc.invalid(format!("`{}` must be a nested object", property.name))),
        }
    }

    fn guarded<T>(&mut self, object: &Object, make: impl FnOnce(&mut Self) -> Result<T>) -> Result<T> {
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

    /// Builds a BSDF, or gives the one already built from this object.
    pub fn bsdf(&mut self, object: &Rc<Object>) -> Result<Arc<dyn Bsdf>> {
        if let Some((bsdf, cost)) = self.bsdfs.get(&Rc::as_ptr(object)) {
            self.cost += cost;
            return Ok(Arc::clone(bsdf));
        }
        let plugin = find(bsdf::PLUGINS, object)?;
        let (made, cost) = self.counted(object, |loader| (plugin.make)(object, loader))?;
        object.all_used(plugin.parameters)?;
        self.bsdfs.insert(Rc::as_ptr(object), (Arc::clone(&made), cost));
        Ok(made)
    }

    /// The BSDFs nested in an object.
    pub fn nested_bsdfs(&mut self, object: &Object) -> Result<Vec<Arc<dyn Bsdf>>> {
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

    /// The one BSDF nested in an object.
    pub fn nested_bsdf(&mut self, object: &Object) -> Result<Arc<dyn Bsdf>> {
        let mut found = self.nested_bsdfs(object)?;
        match (found.pop(), found.is_empty()) {
            (Some(bsdf), true) => Ok(bsdf),
            _ => Err(object.loc.invalid(format!("bsdf `{}` needs exactly one nested bsdf", object.plugin))),
        }
    }

    /// The one texture nested in an object, whatever its name.
    pub fn nested_texture(&mut self, object: &Object) -> Result<Arc<dyn Texture>> {
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

    /// The property `name` as a texture: a colour, a number, or a nested texture.
    pub fn texture(&mut self, object: &Object, name: &str, default: Rgb) -> Result<Arc<dyn Texture>> {
        match object.get(name) {
            Some(property) if matches!(property.value, Value::Object(_) | Value::Reference(_)) => {
                let nested = self.resolve(property)?;
                self.texture_object(&nested)
            }
            _ => Ok(Arc::new(texture::Constant(object.color(name, default)?))),
        }
    }

    /// The property `name` as emitted light, white when absent.
    pub fn radiance(&mut self, object: &Object, name: &str) -> Result<Arc<dyn Texture>> {
        match object.get(name) {
            Some(Property { value: Value::Object(_) | Value::Reference(_), .. }) => {
                self.texture(object, name, Rgb::ONE)
            }
            _ => Ok(Arc::new(texture::Constant(object.emission(name, Rgb::ONE)?))),
        }
    }

    /// The same where it has to be a single colour.
    pub fn uniform_radiance(&mut self, object: &Object, name: &str) -> Result<Rgb> {
        let radiance = self.radiance(object, name)?;
        let what = format!("a texture as the `{name}` of `{}`; it is one colour", object.plugin);
        radiance.constant().ok_or_else(|| object.loc_of(name).unsupported(what))
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
        object.all_used(plugin.parameters)?;
        self.textures.insert(Rc::as_ptr(object), (Arc::clone(&made), cost));
        Ok(made)
    }

    /// The file that the property `filename` names, looked for in the scene's folders.
    pub fn file(&self, object: &Object) -> Result<PathBuf> {
        let name = object.string("filename", "")?;
        if name.is_empty() {
            return Err(object.loc.invalid(format!("{} `{}` needs a `filename`", object.class, object.plugin)));
        }
        let mut candidates = self.tree.folders.iter().map(|folder| folder.join(&name));
        let found = candidates.find(|path| path.is_file()).ok_or_else(|| {
            let folders: Vec<_> = self.tree.folders.iter().map(|folder| folder.display().to_string()).collect();
            let what = format!("no file `{name}` in {}", folders.join(" or "));
            object.loc_of("filename").invalid(what)
        })?;
        self.files.borrow_mut().insert(found.clone());
        Ok(found)
    }

    /// The texels of an image file, read once.
    pub fn texels(&mut self, path: PathBuf) -> Result<Arc<texture::Texels>> {
        if let Some(texels) = self.bitmaps.get(&path) {
            return Ok(Arc::clone(texels));
        }
        let texels = Arc::new(texture::Texels::read(&path, &mut self.texture_memory)?);
        self.bitmaps.insert(path, Arc::clone(&texels));
        Ok(texels)
    }

    /// The mesh of a shape object whose type is a format of meshes.
    pub fn mesh(&mut self, object: &Object) -> Result<MeshData> {
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

    /// A geometry whose transform or numbers leave the range of floats cannot be traced.
    pub fn finite(&self, object: &Object, geometry: Geometry) -> Result<Geometry> {
        if geometry.bounds().is_finite() { Ok(geometry) } else { Err(object.loc.invalid("coordinates are not finite")) }
    }
}
