//! Mitsuba's compressed `.serialized` meshes, versions 3 and 4.
//!
//! A file is a row of meshes, each a four-byte header (identifier, version) and a zlib stream; at its end stand
//! the meshes' offsets (u64, in version 3 u32) and their number (u32). Little endian throughout.

use std::io::Read;
use std::path::Path;

use flate2::read::ZlibDecoder;

use crate::error::{Result, SourceLoc};
use crate::math::{Vec2, Vec3};
use crate::scene::plugin::MeshData;

const IDENTIFIER: u16 = 0x041c;
const HAS_NORMALS: u32 = 0x0001;
const HAS_UVS: u32 = 0x0002;
const HAS_COLORS: u32 = 0x0008;
const DOUBLE_PRECISION: u32 = 0x2000;
/// zlib packs at most about 1030 to 1, so a larger claim is a damaged count.
const MAX_EXPANSION: u64 = 1100;

/// Reads mesh number `index` from the bytes of a file.
pub fn read(bytes: &[u8], index: usize, path: &Path) -> Result<MeshData> {
    let loc = SourceLoc::file(path);
    let damaged = |what: &str| loc.invalid(format!("not a readable serialized mesh: {what}"));
    let at = |offset: usize, n: usize| {
        let end = offset.checked_add(n).ok_or_else(|| damaged("an offset is out of range"))?;
        bytes.get(offset..end).ok_or_else(|| damaged("the file ends too early"))
    };
    let u16_at = |offset: usize| at(offset, 2).map(|b| u16::from_le_bytes([b[0], b[1]]));
    let u32_at = |offset: usize| at(offset, 4).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]));
    if u16_at(0)? != IDENTIFIER {
        return Err(damaged("it does not start with 1c 04"));
    }
    let version = u16_at(2)?;
    let word = match version {
        3 => 4,
        4 => 8,
        other => return Err(loc.unsupported(format!("serialized mesh version {other}; 3 and 4 are supported"))),
    };
    let count = u32_at(bytes.len().saturating_sub(4))? as usize;
    if index >= count {
        return Err(loc.invalid(format!("there is no mesh {index}: the file holds {count}")));
    }
    let entry = (bytes.len() - 4).checked_sub(word * (count - index)).ok_or_else(|| damaged("its table is cut off"))?;
    let offset = match word {
        4 => u64::from(u32_at(entry)?),
        _ => u64::from(u32_at(entry)?) | u64::from(u32_at(entry + 4)?) << 32,
    };
    let offset = usize::try_from(offset).map_err(|_| damaged("an offset is out of range"))?;
    if u16_at(offset)? != IDENTIFIER {
        return Err(damaged("a mesh's offset points elsewhere"));
    }
    let stream = bytes.get(offset.saturating_add(4)..).ok_or_else(|| damaged("the file ends too early"))?;
    decode(stream, version).map_err(|what| damaged(&what))
}

fn decode(stream: &[u8], version: u16) -> Result<MeshData, String> {
    let limit = stream.len() as u64 * MAX_EXPANSION;
    let mut reader = Reader(std::io::BufReader::with_capacity(1 << 16, ZlibDecoder::new(stream)));
    let flags = reader.u32()?;
    if version >= 4 {
        while reader.bytes::<1>()? != [0] {}
    }
    let (vertices, triangles) = (reader.u64()?, reader.u64()?);
    if vertices.max(triangles).saturating_mul(12) > limit || vertices > u64::from(u32::MAX) {
        return Err(format!("{vertices} vertices and {triangles} triangles do not fit in the file"));
    }
    let (vertices, triangles) = (vertices as usize, triangles as usize);
    let double = flags & DOUBLE_PRECISION != 0;
    let triples = |floats: Vec<f32>| floats.chunks_exact(3).map(Vec3::from_slice).collect::<Vec<_>>();
    let mut mesh = MeshData { positions: triples(reader.floats(vertices * 3, double)?), ..MeshData::default() };
    if flags & HAS_NORMALS != 0 {
        mesh.normals = triples(reader.floats(vertices * 3, double)?);
    }
    if flags & HAS_UVS != 0 {
        mesh.uvs = reader.floats(vertices * 2, double)?.chunks_exact(2).map(Vec2::from_slice).collect();
    }
    if flags & HAS_COLORS != 0 {
        reader.floats(vertices * 3, double)?;
    }
    mesh.triangles.reserve(triangles);
    for _ in 0..triangles {
        let triangle = [reader.u32()?, reader.u32()?, reader.u32()?];
        if let Some(index) = triangle.iter().find(|&&index| index as usize >= vertices) {
            return Err(format!("a triangle names vertex {index} of {vertices}"));
        }
        mesh.triangles.push(triangle);
    }
    Ok(mesh)
}

struct Reader<R>(R);

impl<R: Read> Reader<R> {
    fn bytes<const N: usize>(&mut self) -> Result<[u8; N], String> {
        let mut buffer = [0; N];
        self.0.read_exact(&mut buffer).map_err(|error| error.to_string())?;
        Ok(buffer)
    }

    fn u32(&mut self) -> Result<u32, String> {
        self.bytes().map(u32::from_le_bytes)
    }

    fn u64(&mut self) -> Result<u64, String> {
        self.bytes().map(u64::from_le_bytes)
    }

    fn floats(&mut self, count: usize, double: bool) -> Result<Vec<f32>, String> {
        let one = |reader: &mut Self| {
            if double {
                reader.bytes().map(|b| f64::from_le_bytes(b) as f32)
            } else {
                reader.bytes().map(f32::from_le_bytes)
            }
        };
        (0..count).map(|_| one(self)).collect()
    }
}

#[cfg(test)]
mod tests {
    use std::io::Write;

    use flate2::write::ZlibEncoder;

    use super::*;

    /// A file of two one-triangle meshes.
    fn file(version: u16) -> Vec<u8> {
        let mut bytes = Vec::new();
        let mut offsets = Vec::new();
        for z in [0.0f32, 1.0] {
            offsets.push(bytes.len());
            bytes.extend(IDENTIFIER.to_le_bytes());
            bytes.extend(version.to_le_bytes());
            let mut body = (0x1000u32 | HAS_UVS).to_le_bytes().to_vec();
            if version == 4 {
                body.extend(b"name\0");
            }
            body.extend(3u64.to_le_bytes());
            body.extend(1u64.to_le_bytes());
            let positions = [0.0, 0.0, z, 1.0, 0.0, z, 0.0, 1.0, z];
            let uvs = [0.0f32, 0.0, 1.0, 0.0, 0.0, 1.0];
            positions.iter().chain(&uvs).for_each(|value| body.extend(value.to_le_bytes()));
            [0u32, 1, 2].iter().for_each(|index| body.extend(index.to_le_bytes()));
            let mut encoder = ZlibEncoder::new(Vec::new(), flate2::Compression::default());
            encoder.write_all(&body).unwrap();
            bytes.extend(encoder.finish().unwrap());
        }
        for offset in &offsets {
            let offset = (*offset as u64).to_le_bytes();
            bytes.extend(&offset[..if version == 4 { 8 } else { 4 }]);
        }
        bytes.extend(2u32.to_le_bytes());
        bytes
    }

    #[test]
    fn both_versions_give_back_their_meshes() {
        for version in [3, 4] {
            let bytes = file(version);
            let mesh = read(&bytes, 1, Path::new("m")).unwrap();
            assert_eq!((mesh.positions[1].z, mesh.uvs.len(), mesh.triangles[0]), (1.0, 3, [0, 1, 2]));
            assert!(read(&bytes, 2, Path::new("m")).unwrap_err().to_string().contains("holds 2"));
        }
    }

    #[test]
    fn any_truncation_is_an_error_and_no_panic() {
        let bytes = file(4);
        for end in 0..bytes.len() {
            assert!(read(&bytes[..end], 1, Path::new("m")).is_err());
        }
    }
}
