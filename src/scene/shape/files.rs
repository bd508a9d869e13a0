//! Meshes from files: obj, ply and serialized.

use super::Geometry;
use super::mesh::{Mesh, Placement};
use crate::error::Result;
use crate::scene::load::props::Object;
use crate::scene::load::{Loader, Plugin};

/// `obj`: texture coordinates count from the bottom, so they are turned over unless told otherwise.
pub const OBJ: Plugin<Geometry> = Plugin {
    name: "obj",
    parameters: "filename, to_world, face_normals = false, flip_normals = false, flip_tex_coords = true",
    make,
};
/// `ply`.
pub const PLY: Plugin<Geometry> = Plugin {
    name: "ply",
    parameters: "filename, to_world, face_normals = false, flip_normals = false, flip_tex_coords = false",
    make,
};
/// `serialized`.
pub const SERIALIZED: Plugin<Geometry> = Plugin {
    name: "serialized",
    parameters: "filename, shape_index = 0, to_world, face_normals = false, flip_normals = false, flip_tex_coords = false",
    make,
};

fn make(object: &Object, loader: &mut Loader) -> Result<Geometry> {
    let to_world = object.transform("to_world")?;
    let face_normals = object.boolean("face_normals", false)?;
    let flip_normals = object.boolean("flip_normals", false)?;
    let flip_tex_coords = object.boolean("flip_tex_coords", object.plugin == "obj")?;
    let mut data = loader.mesh(object)?;
    if flip_tex_coords {
        data.uvs.iter_mut().for_each(|uv| uv.y = 1.0 - uv.y);
    }
    Ok(Geometry::Mesh(Mesh::new(data, Placement { to_world, face_normals, flip_normals })))
}
