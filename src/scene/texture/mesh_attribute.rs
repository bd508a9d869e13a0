//! Colours and numbers that a mesh has at its vertices or faces.

use std::collections::HashMap;
use std::sync::{Arc, OnceLock};

use super::{Point, Texture};
use crate::error::{Result, SourceLoc};
use crate::math::Rgb;
use crate::scene::load::props::Object;
use crate::scene::load::{Loader, Plugin};
use crate::scene::shape::Geometry;

/// `mesh_attribute`: `name` starts with `vertex_` or `face_`.
pub const PLUGIN: Plugin<Arc<dyn Texture>> = Plugin { name: "mesh_attribute", parameters: "name, scale = 1", make };

fn make(object: &Object, loader: &mut Loader) -> Result<Arc<dyn Texture>> {
    let name = object.string("name", "")?;
    if !name.starts_with("vertex_") && !name.starts_with("face_") {
        return Err(object.loc_of("name").invalid(format!("`{name}` is no `vertex_...` or `face_...` attribute")));
    }
    let scale = object.float("scale", 1.0)?;
    let shapes = Arc::new(OnceLock::new());
    loader.attributes.push(Unbound { name, loc: object.loc.clone(), shapes: Arc::clone(&shapes) });
    Ok(Arc::new(MeshAttribute { shapes, scale }))
}

/// For every shape, its geometry and the number of the attribute there.
type Shapes = Vec<Option<(Arc<Geometry>, usize)>>;

/// An attribute that waits for all shapes to be known.
pub struct Unbound {
    name: String,
    loc: SourceLoc,
    shapes: Arc<OnceLock<Arc<Shapes>>>,
}

/// Looks the attributes up in every shape; one at least must have each.
pub fn bind<'a>(attributes: Vec<Unbound>, geometries: impl Iterator<Item = &'a Arc<Geometry>> + Clone) -> Result<()> {
    let mut tables: HashMap<String, Arc<Shapes>> = HashMap::new();
    for Unbound { name, loc, shapes } in attributes {
        let find = |geometry: &'a Arc<Geometry>| match &**geometry {
            Geometry::Mesh(mesh) => Some((Arc::clone(geometry), mesh.attribute(&name)?)),
            _ => None,
        };
        let table = tables.entry(name.clone()).or_insert_with(|| Arc::new(geometries.clone().map(find).collect()));
        if table.iter().all(Option::is_none) {
            return Err(loc.invalid(format!("no mesh has the attribute `{name}`")));
        }
        shapes.get_or_init(|| Arc::clone(table));
    }
    Ok(())
}

struct MeshAttribute {
    shapes: Arc<OnceLock<Arc<Shapes>>>,
    scale: f32,
}

impl Texture for MeshAttribute {
    /// Black on shapes without the attribute.
    fn color(&self, at: &Point) -> Rgb {
        let found = self.shapes.get().and_then(|shapes| shapes.get(at.shape as usize)?.as_ref());
        match found.map(|(geometry, attribute)| (&**geometry, *attribute)) {
            Some((Geometry::Mesh(mesh), attribute)) => mesh.attribute_at(attribute, at) * self.scale,
            _ => Rgb::ZERO,
        }
    }

    /// Unknown before all shapes are; a middling guess.
    fn mean(&self) -> f32 {
        0.5
    }
}
