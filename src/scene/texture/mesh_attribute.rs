//! Colours and numbers that a mesh has at its vertices or faces.

use std::sync::{Arc, OnceLock};

use super::unbound::{Shapes, Unbound};
use super::{Point, Texture};
use crate::error::Result;
use crate::math::Rgb;
use crate::scene::plugin::{Loader, Object, Plugin};
use crate::scene::shape::Geometry;

/// `mesh_attribute`: `name` starts with `vertex_` or `face_`.
pub const PLUGIN: Plugin<Arc<dyn Texture>> = Plugin { name: "mesh_attribute", parameters: "name, scale = 1", make };

fn make(object: &Object, loader: &mut dyn Loader) -> Result<Arc<dyn Texture>> {
    let name = object.string("name", "")?;
    if !name.starts_with("vertex_") && !name.starts_with("face_") {
        return Err(object.loc_of("name").invalid(format!("`{name}` is no `vertex_...` or `face_...` attribute")));
    }
    let scale = object.float("scale", 1.0)?;
    let shapes = Arc::new(OnceLock::new());
    loader.bind_later(Unbound { name, loc: object.loc.clone(), shapes: Arc::clone(&shapes) });
    Ok(Arc::new(MeshAttribute { shapes, scale }))
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
