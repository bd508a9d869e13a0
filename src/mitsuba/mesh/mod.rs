//! Files of meshes.

mod obj;
mod ply;
mod polygon;
mod serialized;

use std::path::Path;

use crate::error::{Result, SourceLoc};
use crate::scene::plugin::MeshData;

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
