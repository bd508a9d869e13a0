//! Scene files of Mitsuba to a [`Scene`]: `xml` reads the text into objects, which the plugin tables of [`scene`](crate::scene) turn into
//! shapes, materials and emitters. Everything that can fail fails here.

mod contents;
mod document;
mod elements;
mod folders;
pub mod integrator;
mod legacy;
mod loader;
#[doc(hidden)]
pub mod mesh;
mod transform;
mod view;
mod warnings;
mod xml;

use std::path::Path;
use std::rc::Rc;

use glam::DVec3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

pub use self::contents::CONTAINERS;
use self::contents::Contents;
use self::loader::FileLoader;
pub use self::xml::Line;
use self::xml::Source;
use crate::error::{Error, Result, SourceLoc};
use crate::math::rng;
use crate::scene::plugin::{Object, UNSUPPORTED};
use crate::scene::sensor::{self, Crop, FilmOptions, Sensor, SensorInfo};
use crate::scene::{BuildOptions, Integrator, Scene, SceneDescription, bsdf, emitter, shape, texture};

/// Options that override the scene file.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Options {
    /// Values for the file's `$name` parameters, over its `<default>`s.
    pub parameters: Vec<(String, String)>,
    /// The sensor to render with, by its `id` or its number from 0; the first one if it is not given.
    pub sensor: Option<String>,
    /// Whether a scene without a sensor can be looked at all the same, through one of our own.
    pub sensor_optional: bool,
    /// Film size in place of the file's.
    pub size: Option<(usize, usize)>,
    /// Part of the film to render in place of the file's.
    pub crop: Option<Crop>,
    /// Pixels to render around that part, so that images of parts fit together after a reconstruction that looks around.
    pub overscan: usize,
    /// Longest paths in edges in place of the file's; `u32::MAX`: no bound.
    pub max_depth: Option<u32>,
    /// Whether the loader's warnings are errors.
    pub strict: bool,
    /// Groups of emitters whose light is recorded by itself, as [`LightGroups::parse`](crate::scene::LightGroups::parse) reads them.
    pub light_groups: Option<String>,
    /// Whether packets evaluate materials and skip texture coordinates in faster ways where they can. Without them a render has the same bits.
    #[serde(skip)]
    pub fast_paths: bool,
    /// Whether every ray is kept, to measure the time of tracing alone.
    #[serde(skip)]
    pub log_rays: bool,
    /// Threads for building (0: as many as work otherwise).
    #[serde(skip)]
    pub threads: usize,
    /// Bytes of image textures to hold in memory; files beyond them are read tile by tile as they are needed.
    pub texture_memory: u64,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            parameters: Vec::new(),
            sensor: None,
            sensor_optional: false,
            size: None,
            crop: None,
            overscan: 0,
            max_depth: None,
            strict: false,
            light_groups: None,
            fast_paths: true,
            log_rays: false,
            threads: 0,
            texture_memory: 4 << 30,
        }
    }
}

/// Name of a scene file for people: the file's own, or that of the folder around a `scene.xml`.
pub fn name(path: &Path) -> String {
    let stem = path.file_stem().unwrap_or_default();
    let folder = path.canonicalize().ok().and_then(|path| Some(path.parent()?.file_name()?.to_owned()));
    let name = if stem == "scene" { folder.unwrap_or_else(|| stem.to_owned()) } else { stem.to_owned() };
    name.to_string_lossy().into_owned()
}

/// Loads a scene file with everything it refers to.
pub fn load(path: &Path, options: &Options) -> Result<Scene> {
    load_tree(path, &|| xml::parse(path, Source::File, &options.parameters, options.strict), options)
}

/// Loads a scene from the text of a scene file. Files that it names are looked for in the current folder.
pub fn load_text(text: &str, options: &Options) -> Result<Scene> {
    let path = Path::new("scene.xml");
    load_tree(path, &|| xml::parse(path, Source::Text(text), &options.parameters, options.strict), options)
}

/// Loads a scene from the lines of a scene file that was made from something else, whose origins are named in messages. Files
/// that it names are looked for in the current folder.
pub fn load_lines(lines: &[Line], options: &Options) -> Result<Scene> {
    let path = Path::new("scene");
    load_tree(path, &|| xml::parse(path, Source::Lines(lines), &options.parameters, options.strict), options)
}

/// The element that a plugin is written as, if it is known.
pub fn class_of(plugin: &str) -> Option<&'static str> {
    let shapes = shape::PLUGINS.iter().map(|row| row.name).chain(CONTAINERS.iter().map(|(name, _)| *name));
    let classes: [(&str, Vec<&str>); 5] = [
        ("shape", shapes.collect()),
        ("bsdf", bsdf::PLUGINS.iter().map(|row| row.name).collect()),
        ("emitter", emitter::PLUGINS.iter().map(|row| row.name).chain(["area"]).collect()),
        ("texture", texture::PLUGINS.iter().map(|row| row.name).collect()),
        ("sensor", sensor::PLUGINS.iter().map(|(name, _)| *name).collect()),
    ];
    let known = classes.iter().find(|(_, names)| names.contains(&plugin)).map(|(class, _)| *class);
    known.or_else(|| UNSUPPORTED.iter().find(|(_, name, _)| *name == plugin).map(|(class, ..)| *class))
}

/// Loads what is parsed. A scene far from the origin is loaded once more with an origin near its camera: floats there are too
/// coarse for it.
fn load_tree(path: &Path, parse: &dyn Fn() -> Result<xml::Tree>, options: &Options) -> Result<Scene> {
    let mut scene = build(path, parse()?, options, DVec3::ZERO)?;
    if let Some(origin) = view::near_camera(&scene) {
        // Its memory is freed before the second one takes as much.
        drop(scene);
        scene = build(path, parse()?, options, origin)?;
    }
    if let Some(what) = view::clipped(&scene).filter(|_| !scene.sensors().is_empty()) {
        let loc = SourceLoc::file(path);
        if options.strict {
            return Err(loc.unsupported(what));
        }
        scene = scene.with_warning(format!("{loc}: {what}"));
    }
    Ok(scene)
}

fn build(path: &Path, tree: xml::Tree, options: &Options, origin: DVec3) -> Result<Scene> {
    let fingerprint = fingerprint(&tree, options);
    let objects = tree.objects.clone();
    let mut loader = FileLoader::new(tree, options.texture_memory, origin);
    let Gathered { contents, sensors, integrators } = gather(&objects, &mut loader)?;
    let loc = SourceLoc::file(path);
    let sensor = match choose(&sensors, options, &loc)? {
        Some(object) => {
            let Options { size, crop, overscan, .. } = *options;
            sensor::load(object, &loader, FilmOptions { size, crop, overscan })?
        }
        None => Sensor::default(),
    };
    let sensors = sensors.into_iter().map(|object| SensorInfo::new(object)).collect();
    let Contents { shapes, groups, emitters, emitter_names, emitter_weights } = contents;
    let chosen = integrator::choose(&integrators, &mut loader)?;
    let integrator = Integrator { max_depth: options.max_depth.unwrap_or(chosen.max_depth), ..chosen };
    let groups = groups.into_values();
    let grouped = groups.iter().flat_map(|group| &group.shapes);
    let (attributes, files, warnings) = loader.finish();
    texture::bind(attributes, shapes.iter().chain(grouped).map(|shape| &shape.geometry))?;
    let parts = SceneDescription {
        shapes,
        groups,
        emitters,
        emitter_names,
        emitter_weights,
        sensor,
        sensors,
        integrator,
        origin,
        fingerprint,
        files,
        warnings,
    };
    let build = BuildOptions {
        threads: if options.threads == 0 { rayon::current_num_threads() } else { options.threads },
        light_groups: options.light_groups.as_deref(),
        fast_paths: options.fast_paths,
        log_rays: options.log_rays,
    };
    Scene::build(parts, build).map_err(|error| match error {
        Error::BadData(what) => loc.invalid(what),
        other => other,
    })
}

/// Objects of a scene: those that are built at once, and those of which one is chosen.
#[derive(Default)]
struct Gathered<'a> {
    contents: Contents,
    sensors: Vec<&'a Rc<Object>>,
    integrators: Vec<&'a Rc<Object>>,
}

/// Builds shapes and emitters.
fn gather<'a>(objects: &'a [Rc<Object>], loader: &mut FileLoader) -> Result<Gathered<'a>> {
    let mut gathered = Gathered::default();
    for object in objects {
        match object.class.as_str() {
            "shape" => gathered.contents.shape(object, loader)?,
            // A lamp that shapes refer to.
            "emitter" if object.plugin == "area" && object.id.is_some() => {}
            "emitter" => gathered.contents.emitter(object, loader)?,
            "sensor" => gathered.sensors.push(object),
            "integrator" => gathered.integrators.push(object),
            // Named objects that nothing uses are allowed, and need not even be understood.
            "bsdf" | "texture" | "film" | "sampler" | "rfilter" => {}
            "medium" | "volume" | "phase" if object.id.is_some() => {}
            other => {
                let known = "shape, bsdf, texture, emitter, sensor, integrator, film, sampler";
                return Err(object.loc.unsupported(format!("<{other}> in a scene; there are {known}")));
            }
        }
    }
    Ok(gathered)
}

/// The sensor that is to render; `None` if there need not be one.
fn choose<'a>(sensors: &[&'a Rc<Object>], options: &Options, loc: &SourceLoc) -> Result<Option<&'a Rc<Object>>> {
    let Some(wanted) = &options.sensor else {
        return match sensors.first() {
            None if !options.sensor_optional => Err(loc.invalid("the scene has no sensor: add one to render it")),
            first => Ok(first.copied()),
        };
    };
    let by_id = sensors.iter().find(|sensor| sensor.id.as_ref() == Some(wanted));
    let found = by_id.or_else(|| wanted.parse().ok().and_then(|number: usize| sensors.get(number)));
    found.copied().map(Some).ok_or_else(|| {
        let name = |(number, sensor): (usize, &&Rc<Object>)| match &sensor.id {
            Some(id) => format!("{number} (`{id}`)"),
            None => number.to_string(),
        };
        let names: Vec<_> = sensors.iter().enumerate().map(name).collect();
        let names = match names.as_slice() {
            [] => "it has none".to_owned(),
            [only] => format!("it has number {only}"),
            several => format!("it has numbers {}", several.join(", ")),
        };
        Error::Usage(format!("{loc} has no sensor `{wanted}`; {names}"))
    })
}

/// Hash of everything that is read, and of the options that change what is rendered.
fn fingerprint(tree: &xml::Tree, options: &Options) -> u64 {
    let mut given: Vec<_> = options.parameters.iter().collect();
    given.sort();
    let definitions = given.iter().flat_map(|(name, value)| [name, value]);
    let crop = options.crop.map(|crop| crop.to_string());
    let overscan = (options.overscan > 0).then(|| format!("overscan {}", options.overscan));
    let depth = options.max_depth.map(|depth| format!("max_depth {depth}"));
    let texts =
        tree.sources.iter().chain(definitions).chain(&options.sensor).chain(&crop).chain(&overscan).chain(&depth);
    texts.flat_map(|text| text.bytes()).fold(0, |hash, byte| rng::combine(hash, u64::from(byte)))
}
