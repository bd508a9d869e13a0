//! Meshes as files give them.

use crate::math::{Rgb, Vec2, Vec3};

/// A mesh as files give it, before it is placed in the world. Normals and texture coordinates are empty or
/// there for every vertex; triangles only name vertices that exist.
#[derive(Clone, Debug, Default)]
pub struct MeshData {
    /// Vertex positions.
    pub positions: Vec<Vec3>,
    /// Vertex normals, of any length.
    pub normals: Vec<Vec3>,
    /// Texture coordinates.
    pub uvs: Vec<Vec2>,
    /// Vertex numbers, counter-clockwise seen from outside.
    pub triangles: Vec<[u32; 3]>,
    /// Values by name: one a vertex under `vertex_...`, one a triangle under `face_...`.
    pub attributes: Vec<(String, Vec<Rgb>)>,
}
