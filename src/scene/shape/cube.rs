//! The cube [-1, 1]³; each face has the texture's whole unit square.

use super::Geometry;
use super::finite::finite;
use super::mesh::{Mesh, Placement};
use crate::error::Result;
use crate::math::{Vec3, vec2, vec3};
use crate::scene::plugin::{Loader, MeshData, Object, Plugin};

/// `cube`.
pub const PLUGIN: Plugin<Geometry> = Plugin { name: "cube", parameters: "to_world, flip_normals = false", make };

/// Outward normal, then the direction from the face's first corner to its second and to its fourth.
const FACES: [[Vec3; 3]; 6] = [
    [Vec3::NEG_Y, Vec3::Z, Vec3::NEG_X],
    [Vec3::Y, Vec3::NEG_X, Vec3::Z],
    [Vec3::X, Vec3::Y, Vec3::Z],
    [Vec3::Z, Vec3::Y, Vec3::NEG_X],
    [Vec3::NEG_X, Vec3::Y, Vec3::NEG_Z],
    [Vec3::NEG_Z, Vec3::NEG_Y, Vec3::NEG_X],
];

fn make(object: &Object, loader: &mut dyn Loader) -> Result<Geometry> {
    let to_world = loader.to_world(object)?;
    let flip_normals = object.boolean("flip_normals", false)?;
    let mut data = MeshData::default();
    for [normal, second, fourth] in FACES {
        let base = data.positions.len() as u32;
        for (a, b) in [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)] {
            data.positions.push(normal + second * a + fourth * b);
            data.normals.push(normal);
            data.uvs.push(vec2(0.5 + 0.5 * a, 0.5 - 0.5 * b));
        }
        let outward = second.cross(fourth).dot(normal) > 0.0;
        let order = if outward { [[0, 1, 2], [0, 2, 3]] } else { [[0, 2, 1], [0, 3, 2]] };
        data.triangles.extend(order.map(|triangle| triangle.map(|corner| base + corner)));
    }
    debug_assert!(data.positions.iter().all(|p| p.abs() == vec3(1.0, 1.0, 1.0)));
    finite(object, Geometry::Mesh(Mesh::new(data, Placement { to_world, face_normals: false, flip_normals })))
}
