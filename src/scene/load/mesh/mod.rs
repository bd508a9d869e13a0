//! Files of meshes.

mod obj;
mod ply;
mod polygon;
mod serialized;
pub mod smooth;

use std::path::Path;

use crate::error::{Result, SourceLoc};
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

/// The mesh in the bytes of a file; `index` chooses among those of a serialized file. `path` is for messages.
pub fn read(format: &str, bytes: &[u8], index: usize, path: &Path) -> Result<MeshData> {
    let mesh = match format {
        "obj" => obj::read(bytes, path),
        "ply" => ply::read(bytes, path),
        "serialized" => serialized::read(bytes, index, path),
        other => Err(SourceLoc::file(path).unsupported(format!("meshes of format `{other}`"))),
    }?;
    if mesh.positions.len() >= u32::MAX as usize {
        return Err(SourceLoc::file(path).unsupported("a mesh of more than four billion vertices"));
    }
    Ok(mesh)
}
