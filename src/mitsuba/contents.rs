//! The shapes and emitters of a scene, as they are gathered.

use std::collections::HashMap;
use std::rc::Rc;
use std::sync::Arc;

use super::loader::FileLoader;
use crate::error::Result;
use crate::math::{Vec2, Vec3};
use crate::scene::emitter::{self, Emitter};
use crate::scene::plugin::Object;
use crate::scene::plugin::{Loader, find, unknown};
use crate::scene::shape::Geometry;
use crate::scene::{Bounds, Group, Shape, bsdf};
use crate::scene::{sensor, shape};

/// More shapes than this are taken for a mistake, such as merges of merges of merges.
const MAX_SHAPES: usize = 1 << 20;

/// Shapes, groups and emitters found so far.
#[derive(Default)]
pub struct Contents {
    /// Shapes in world space.
    pub shapes: Vec<Shape>,
    /// Groups with their instances.
    pub groups: Groups,
    /// Emitters, numbered as the shapes name them.
    pub emitters: Vec<Box<dyn Emitter>>,
    /// Their ids, or those of their shapes.
    pub emitter_names: Vec<Arc<str>>,
    /// Their weights when one is chosen.
    pub emitter_weights: Vec<f32>,
}

/// Shapes that are instanced together, with their bounding box.
#[derive(Default)]
pub struct Groups {
    list: Vec<(Bounds, Group)>,
    by_origin: HashMap<*const Object, usize>,
}

impl Groups {
    /// The groups alone.
    pub fn into_values(self) -> Vec<Group> {
        self.list.into_iter().map(|(_, group)| group).collect()
    }
}

/// Shapes that hold other shapes, for the list of plugins.
pub const CONTAINERS: &[(&str, &str)] = &[
    ("shapegroup", "nested shapes without emitters; drawn where an instance refers to it"),
    ("instance", "to_world, one nested or referenced shapegroup"),
    ("merge", "nested shapes"),
];

impl Contents {
    /// Adds an emitter that belongs to no shape.
    pub fn emitter(&mut self, object: &Object, loader: &mut FileLoader) -> Result<()> {
        let plugin = find(emitter::PLUGINS, object)?;
        let emitter = (plugin.make)(object, loader)?;
        let weight =
            sampling_weight(object, loader, emitter.sample(Vec3::ONE, Vec2::ZERO).is_some_and(|point| point.delta))?;
        loader.all_used(object, plugin.parameters)?;
        self.emitters.push(emitter);
        self.emitter_names.push(name(object));
        self.emitter_weights.push(weight);
        Ok(())
    }

    /// Adds a shape, or the shapes that it consists of.
    pub fn shape(&mut self, object: &Rc<Object>, loader: &mut FileLoader) -> Result<()> {
        match object.plugin.as_str() {
            "instance" => self.instance(object, loader),
            // Drawn by its instances only.
            "shapegroup" => Ok(()),
            "merge" => loader.guarded(object, |loader| {
                let children = children(object, loader)?;
                loader.all_used(object, "nested shapes")?;
                children.iter().try_for_each(|child| self.shape(child, loader))
            }),
            _ if self.shapes.len() >= MAX_SHAPES => {
                Err(object.loc.invalid(format!("more than {MAX_SHAPES} shapes: use instances, or larger meshes")))
            }
            _ => {
                let number = (self.shapes.len() as u32, self.emitters.len() as u32);
                if let Some((shape, emitter)) = single(object, loader, number)? {
                    self.shapes.push(shape);
                    if let Some((emitter, name, weight)) = emitter {
                        self.emitters.push(emitter);
                        self.emitter_names.push(name);
                        self.emitter_weights.push(weight);
                    }
                }
                Ok(())
            }
        }
    }

    fn instance(&mut self, object: &Rc<Object>, loader: &mut FileLoader) -> Result<()> {
        let to_world = loader.to_world(object)?;
        let groups = children(object, loader)?;
        let [group] = groups.as_slice() else {
            return Err(object.loc.invalid("an instance needs exactly one shapegroup"));
        };
        if group.plugin != "shapegroup" {
            return Err(group.loc.invalid(format!("an instance of `{}`; it takes a shapegroup", group.plugin)));
        }
        loader.all_used(object, "to_world, one shapegroup")?;
        let (bounds, group) = self.group(group, loader)?;
        if !bounds.transformed(to_world).is_finite() {
            return Err(object.loc.invalid("coordinates are not finite"));
        }
        group.placements.push(to_world);
        group.names.push(name(object));
        Ok(())
    }

    /// A group; its shapes are built when it is first instanced.
    fn group(&mut self, object: &Rc<Object>, loader: &mut FileLoader) -> Result<&mut (Bounds, Group)> {
        let Groups { list, by_origin } = &mut self.groups;
        if let Some(&index) = by_origin.get(&Rc::as_ptr(object)) {
            return Ok(&mut list[index]);
        }
        let mut shapes = Vec::new();
        for child in children(object, loader)? {
            if CONTAINERS.iter().any(|(name, _)| *name == child.plugin) {
                return Err(child.loc.unsupported(format!("`{}` in a shapegroup", child.plugin)));
            }
            if let Some((shape, emitter)) = loader.in_group(|loader| single(&child, loader, (0, 0)))? {
                if emitter.is_some() {
                    return Err(child.loc.unsupported("an emitter in a shapegroup"));
                }
                shapes.push(shape);
            }
        }
        loader.all_used(object, "nested shapes")?;
        let bounds = shapes.iter().fold(Bounds::EMPTY, |all, shape| all.union(shape.geometry.bounds()));
        let index = list.len();
        by_origin.insert(Rc::as_ptr(object), index);
        list.push((bounds, Group { shapes, placements: Vec::new(), names: Vec::new() }));
        Ok(&mut list[index])
    }
}

/// The shapes nested in an object.
fn children(object: &Object, loader: &FileLoader) -> Result<Vec<Rc<Object>>> {
    let mut found = Vec::new();
    for property in object.nested() {
        let nested = loader.resolve(property)?;
        if nested.class != "shape" {
            return Err(nested.loc.unsupported(format!("a {} in a `{}`", nested.class, object.plugin)));
        }
        property.take();
        found.push(nested);
    }
    Ok(found)
}

/// A shape with its emitter, if it is emissive, that emitter's name and weight.
type Lit = (Shape, Option<(Box<dyn Emitter>, Arc<str>, f32)>);

/// A shape with its emitter, which will have the numbers given; none when it has no area.
fn single(object: &Object, loader: &mut FileLoader, (shape_number, emitter_number): (u32, u32)) -> Result<Option<Lit>> {
    let plugin = find(shape::PLUGINS, object)?;
    let geometry = Arc::new((plugin.make)(object, loader)?);
    let (mut bsdf, mut radiance) = (None, None);
    let mut material = "default".into();
    for property in object.nested() {
        let nested = loader.resolve(property)?;
        property.take();
        match nested.class.as_str() {
            "bsdf" if bsdf.is_some() => return Err(nested.loc.invalid("a second bsdf; a shape has one")),
            "bsdf" => (bsdf, material) = (Some(loader.bsdf(&nested)?), name(&nested)),
            "emitter" if radiance.is_some() => {
                return Err(nested.loc.invalid("a second emitter; a shape has one"));
            }
            "emitter" if nested.plugin == "area" => {
                // An id of its own goes before that of the shape.
                let weight = sampling_weight(&nested, loader, false)?;
                radiance = Some((loader.radiance(&nested, "radiance")?, nested.id.clone(), weight));
                loader.all_used(&nested, "radiance")?;
            }
            "sensor" => return Err(unknown(&nested, sensor::PLUGINS.iter().map(|(name, _)| *name))),
            other => {
                let what = format!("{other} `{}` in a shape; it takes a bsdf and an area emitter", nested.plugin);
                return Err(nested.loc.unsupported(what));
            }
        }
    }
    if let (Geometry::Curves(_), Some(_)) = (&*geometry, &radiance) {
        return Err(object.loc.unsupported("an emitter on curves, whose points cannot be sampled"));
    }
    // How derivatives are estimated.
    object.ignore(&["silhouette_sampling_weight"]);
    loader.all_used(object, plugin.parameters)?;
    // A shape without area (degenerate triangles only) is invisible, and as an emitter it emits nothing.
    if geometry.area() <= 0.0 {
        return Ok(None);
    }
    let emitter = radiance.map(|(radiance, id, weight)| {
        let area = emitter::Area::new(Arc::clone(&geometry), radiance, shape_number);
        (Box::new(area) as Box<dyn Emitter>, id.map_or_else(|| name(object), |id| id.as_str().into()), weight)
    });
    let bsdf = bsdf.unwrap_or_else(|| bsdf::default(emitter.is_some()));
    let (name, number) = (name(object), emitter.as_ref().map(|_| emitter_number));
    Ok(Some((Shape { name, material, geometry, bsdf, emitter: number }, emitter)))
}

/// The factor of an emitter's chance to be sampled; `only_sampled`: no path meets it otherwise.
fn sampling_weight(object: &Object, loader: &FileLoader, only_sampled: bool) -> Result<f32> {
    let weight = object.float("sampling_weight", 1.0)?;
    let loc = object.loc_of("sampling_weight");
    if !(weight >= 0.0 && weight.is_finite()) {
        return Err(loc.invalid(format!("a `sampling_weight` of {weight}; it cannot be negative")));
    }
    if weight == 0.0 && only_sampled {
        loader.warn(&loc, &format!("`{}` with a `sampling_weight` of 0 gives no light", object.plugin))?;
    }
    Ok(weight)
}

/// The id of an object, or its type and line in the file.
fn name(object: &Object) -> Arc<str> {
    match &object.id {
        Some(id) => id.as_str().into(),
        // Of what was made from something else the place there.
        None if object.loc.line == 0 => object.loc.to_string().into(),
        None => format!("{}_line_{}", object.plugin, object.loc.line).into(),
    }
}
