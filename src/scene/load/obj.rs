//! Wavefront OBJ meshes: the whole file as one mesh, materials and groups left aside.

use std::path::Path;

use super::MeshData;
use crate::error::{Error, Place, Result};
use crate::math::{vec2, vec3};

/// Reads a mesh. Corners with equal position, texture coordinate and normal share a vertex.
pub fn read(path: &Path) -> Result<MeshData> {
    let file = std::fs::File::open(path).map_err(|error| Error::io(path, error))?;
    let mut reader = std::io::BufReader::with_capacity(1 << 20, file);
    let options = tobj::LoadOptions { single_index: true, triangulate: true, ignore_points: true, ignore_lines: true };
    let no_materials = |_: &Path| Ok(Default::default());
    let (models, _) = tobj::load_obj_buf(&mut reader, &options, no_materials)
        .map_err(|error| Place::file(path).invalid(format!("not a readable OBJ file: {error}")))?;
    let mut whole = MeshData::default();
    // A file may have normals or texture coordinates on some groups only.
    let has_normals = models.iter().any(|model| !model.mesh.normals.is_empty());
    let has_uvs = models.iter().any(|model| !model.mesh.texcoords.is_empty());
    for model in models {
        let (mesh, base) = (model.mesh, whole.positions.len() as u32);
        whole.positions.extend(mesh.positions.chunks_exact(3).map(|p| vec3(p[0], p[1], p[2])));
        if has_normals {
            whole.normals.extend(mesh.normals.chunks_exact(3).map(|n| vec3(n[0], n[1], n[2])));
            whole.normals.resize(whole.positions.len(), vec3(0.0, 0.0, 0.0));
        }
        if has_uvs {
            whole.uvs.extend(mesh.texcoords.chunks_exact(2).map(|uv| vec2(uv[0], uv[1])));
            whole.uvs.resize(whole.positions.len(), vec2(0.0, 0.0));
        }
        whole.triangles.extend(mesh.indices.chunks_exact(3).map(|i| [base + i[0], base + i[1], base + i[2]]));
    }
    Ok(whole)
}
