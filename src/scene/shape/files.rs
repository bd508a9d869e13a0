//! Meshes from files: obj, ply and serialized.

use super::Geometry;
use super::mesh::{Mesh, Placement};
use super::smooth;
use crate::error::{Result, SourceLoc};
use crate::scene::plugin::{Loader, Object, Plugin};

/// `obj`: texture coordinates count from the bottom, so they are turned over by default.
pub const OBJ: Plugin<Geometry> = Plugin {
    name: "obj",
    parameters: "filename, to_world, face_normals = false, flip_normals = false, flip_tex_coords = true, \
        max_smooth_angle",
    make,
};
/// `ply`.
pub const PLY: Plugin<Geometry> = Plugin {
    name: "ply",
    parameters: "filename, to_world, face_normals = false, flip_normals = false, flip_tex_coords = false, \
        max_smooth_angle",
    make,
};
/// `serialized`.
pub const SERIALIZED: Plugin<Geometry> = Plugin {
    name: "serialized",
    parameters: "filename, shape_index = 0, to_world, face_normals = false, flip_normals = false, \
        flip_tex_coords = false, max_smooth_angle",
    make,
};

fn make(object: &Object, loader: &mut dyn Loader) -> Result<Geometry> {
    let to_world = loader.to_world(object)?;
    let face_normals = object.boolean("face_normals", false)?;
    let flip_normals = object.boolean("flip_normals", false)?;
    let flip_tex_coords = object.boolean("flip_tex_coords", object.plugin == "obj")?;
    let smooth_up_to = object.get("max_smooth_angle").map(|_| object.float("max_smooth_angle", 180.0)).transpose()?;
    if smooth_up_to.is_some() && face_normals {
        return Err(object.loc_of("max_smooth_angle").invalid("give either `max_smooth_angle` or `face_normals`"));
    }
    // Older files say how a mesh is cut into several, each with the materials of the file.
    object.ignore(&["collapse", "load_materials", "srgb"]);
    let mut data = loader.mesh(object)?;
    if data.triangles.is_empty() {
        let what = format!("the {} file has no faces that can be read: nothing is shown of it", object.plugin);
        loader.warn(&object.loc_of("filename"), &what)?;
    }
    let lost = |triangle: &[u32; 3]| {
        triangle.iter().any(|&i| !to_world.transform_point3(data.positions[i as usize]).is_finite())
    };
    if let Some(first) = data.triangles.iter().position(lost) {
        let (count, all) = (data.triangles.iter().filter(|&triangle| lost(triangle)).count(), data.triangles.len());
        let what = format!("{count} of {all} triangles have a corner that is not finite, the first is number {first}");
        loader.warn(&SourceLoc::file(&loader.file(object)?), &format!("{what} (counted from 0): they are left out"))?;
    }
    if let Some(degrees) = smooth_up_to {
        data = smooth::split(data, degrees);
    }
    if flip_tex_coords {
        data.uvs.iter_mut().for_each(|uv| uv.y = 1.0 - uv.y);
    }
    Ok(Geometry::Mesh(Mesh::new(data, Placement { to_world, face_normals, flip_normals })))
}
