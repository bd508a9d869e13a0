//! Textures that need to know all shapes.

use std::collections::HashMap;
use std::sync::{Arc, OnceLock};

use crate::error::{Result, SourceLoc};
use crate::scene::shape::Geometry;

/// For every shape, its geometry and the number of the attribute there.
pub(super) type Shapes = Vec<Option<(Arc<Geometry>, usize)>>;

/// An attribute that waits for all shapes to be known.
pub struct Unbound {
    pub(super) name: String,
    pub(super) loc: SourceLoc,
    pub(super) shapes: Arc<OnceLock<Arc<Shapes>>>,
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
