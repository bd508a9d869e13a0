//! The square [-1, 1]² in the plane z = 0, facing +z.

use super::Geometry;
use super::finite::finite;
use super::mesh::{Mesh, Placement};
use crate::error::Result;
use crate::math::{Vec3, vec2, vec3};
use crate::scene::plugin::{Loader, MeshData, Object, Plugin};

/// `rectangle`.
pub const PLUGIN: Plugin<Geometry> = Plugin { name: "rectangle", parameters: "to_world, flip_normals = false", make };

fn make(object: &Object, loader: &mut dyn Loader) -> Result<Geometry> {
    let to_world = loader.to_world(object)?;
    let flip_normals = object.boolean("flip_normals", false)?;
    let corners = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)];
    let data = MeshData {
        positions: corners.iter().map(|&(x, y)| vec3(x, y, 0.0)).collect(),
        // With normals given, a mirroring transform keeps the side that faces +z.
        normals: vec![Vec3::Z; 4],
        uvs: corners.iter().map(|&(x, y)| vec2(0.5 * x + 0.5, 0.5 * y + 0.5)).collect(),
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        ..MeshData::default()
    };
    finite(object, Geometry::Mesh(Mesh::new(data, Placement { to_world, face_normals: false, flip_normals })))
}
