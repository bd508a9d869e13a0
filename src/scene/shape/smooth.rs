//! Smooth shading up to an angle: edges that are sharper than it stay sharp.

use std::collections::HashMap;

use crate::math::{Vec2, Vec3};
use crate::scene::plugin::MeshData;

/// Drops a mesh's normals and splits its vertices where faces meet at more than `degrees`, so that the normals averaged
/// over the faces of a vertex are those of a smooth part. Faces at one place are gathered around the first that is left.
pub fn split(data: MeshData, degrees: f32) -> MeshData {
    let limit = degrees.to_radians().cos();
    let normal = |triangle: &[u32; 3]| {
        let [a, b, c] = triangle.map(|index| data.positions[index as usize]);
        (b - a).cross(c - a).normalize_or_zero()
    };
    let normals: Vec<Vec3> = data.triangles.iter().map(normal).collect();
    // The vertices made at a place, each with the face that it was made for.
    let mut made: HashMap<[u32; 5], Vec<(usize, u32)>> = HashMap::new();
    let mut origins: Vec<u32> = Vec::new();
    let mut triangles = data.triangles.clone();
    for (face, triangle) in triangles.iter_mut().enumerate() {
        for corner in triangle {
            let here = made.entry(place(&data, *corner)).or_default();
            let fits = |(seed, _): &&(usize, u32)| normals[*seed].dot(normals[face]) > limit;
            let vertex = here.iter().find(fits).map(|&(_, vertex)| vertex);
            let vertex = vertex.unwrap_or_else(|| {
                here.push((face, origins.len() as u32));
                origins.push(*corner);
                origins.len() as u32 - 1
            });
            *corner = vertex;
        }
    }
    let pick = |index: &u32| *index as usize;
    let of_faces = |name: &str| name.starts_with("face_");
    let attributes = data.attributes.into_iter().map(|(name, values)| match of_faces(&name) {
        true => (name, values),
        false => (name, origins.iter().map(|index| values[pick(index)]).collect()),
    });
    MeshData {
        attributes: attributes.collect(),
        positions: origins.iter().map(|index| data.positions[pick(index)]).collect(),
        normals: Vec::new(),
        uvs: match data.uvs.is_empty() {
            true => Vec::new(),
            false => origins.iter().map(|index| data.uvs[pick(index)]).collect(),
        },
        triangles,
    }
}

/// Bits of a vertex's position and texture coordinates.
fn place(data: &MeshData, vertex: u32) -> [u32; 5] {
    let (p, uv) = (data.positions[vertex as usize], data.uvs.get(vertex as usize).copied().unwrap_or(Vec2::ZERO));
    // Adding zero makes one of both zeros.
    [p.x, p.y, p.z, uv.x, uv.y].map(|value| (value + 0.0).to_bits())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::vec3;

    /// Two squares that meet at a right angle, with shared vertices.
    fn corner() -> MeshData {
        let positions = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [1, 0, -1], [1, 1, -1]]
            .map(|[x, y, z]| vec3(x as f32, y as f32, z as f32));
        MeshData {
            positions: positions.to_vec(),
            normals: vec![Vec3::X; 6],
            triangles: vec![[0, 1, 2], [0, 2, 3], [1, 4, 5], [1, 5, 2]],
            ..MeshData::default()
        }
    }

    #[test]
    fn edges_sharper_than_the_angle_are_split() {
        for (degrees, vertices) in [(30.0, 8), (89.0, 8), (91.0, 6)] {
            let split = split(corner(), degrees);
            assert_eq!(split.positions.len(), vertices, "{degrees}");
            assert!(split.normals.is_empty());
            let at = |data: &MeshData, k: usize| data.triangles[k].map(|index| data.positions[index as usize]);
            assert!((0..4).all(|k| at(&split, k) == at(&corner(), k)));
        }
    }
}
