//! Stanford PLY meshes, ascii and binary.

use std::path::Path;

use ply_rs_bw::parser::{ParseError, Parser, Reader};
use ply_rs_bw::ply::{Property, PropertyAccess, PropertyAccessResult};

use super::MeshData;
use crate::error::{Error, Place, Result};
use crate::math::{Vec2, Vec3};

/// A vertex as the file has it; what it does not have stays zero.
#[derive(Default)]
struct Vertex {
    position: Vec3,
    normal: Vec3,
    uv: Vec2,
}

fn number(property: Property) -> Option<f32> {
    Some(match property {
        Property::Float(value) => value,
        Property::Double(value) => value as f32,
        Property::Int(value) => value as f32,
        Property::UInt(value) => value as f32,
        Property::Short(value) => f32::from(value),
        Property::UShort(value) => f32::from(value),
        Property::Char(value) => f32::from(value),
        Property::UChar(value) => f32::from(value),
        _ => return None,
    })
}

impl PropertyAccess for Vertex {
    fn new() -> Self {
        Self::default()
    }

    fn set_property(&mut self, key: &str, property: Property) -> PropertyAccessResult {
        let slot = match key {
            "x" => &mut self.position.x,
            "y" => &mut self.position.y,
            "z" => &mut self.position.z,
            "nx" => &mut self.normal.x,
            "ny" => &mut self.normal.y,
            "nz" => &mut self.normal.z,
            "u" | "s" | "texture_u" => &mut self.uv.x,
            "v" | "t" | "texture_v" => &mut self.uv.y,
            _ => return PropertyAccessResult::Ignored,
        };
        let Some(value) = number(property) else { return PropertyAccessResult::UnsupportedType };
        *slot = value;
        PropertyAccessResult::Set
    }
}

/// A face as a list of vertex numbers.
#[derive(Default)]
struct Face(Vec<i64>);

impl PropertyAccess for Face {
    fn new() -> Self {
        Self::default()
    }

    fn set_property(&mut self, key: &str, property: Property) -> PropertyAccessResult {
        if key != "vertex_indices" && key != "vertex_index" {
            return PropertyAccessResult::Ignored;
        }
        self.0 = match property {
            Property::ListInt(list) => list.into_iter().map(i64::from).collect(),
            Property::ListUInt(list) => list.into_iter().map(i64::from).collect(),
            Property::ListShort(list) => list.into_iter().map(i64::from).collect(),
            Property::ListUShort(list) => list.into_iter().map(i64::from).collect(),
            Property::ListChar(list) => list.into_iter().map(i64::from).collect(),
            Property::ListUChar(list) => list.into_iter().map(i64::from).collect(),
            _ => return PropertyAccessResult::UnsupportedType,
        };
        PropertyAccessResult::Set
    }
}

/// Reads a mesh; faces with more than three corners become fans.
pub fn read(path: &Path) -> Result<MeshData> {
    let place = Place::file(path);
    let file = std::fs::File::open(path).map_err(|error| Error::io(path, error))?;
    let size = file.metadata().map_err(|error| Error::io(path, error))?.len();
    let mut reader = Reader::new(std::io::BufReader::with_capacity(1 << 20, file));
    let damaged = |error: ParseError| place.invalid(format!("not a readable PLY file: {error}"));
    let header = Parser::<Vertex>::new().read_header(&mut reader).map_err(damaged)?;
    let mut mesh = MeshData::default();
    for (name, element) in &header.elements {
        // Every entry takes at least one byte: a larger count is a damaged header.
        if element.count as u64 > size {
            return Err(place.invalid(format!("{} entries of `{name}` do not fit in the file", element.count)));
        }
        match name.as_str() {
            "vertex" => {
                let parser = Parser::<Vertex>::new();
                let vertices = parser.read_payload_for_element(&mut reader, element, &header).map_err(damaged)?;
                let has = |key: &str| element.properties.contains_key(key);
                if has("nx") && has("ny") && has("nz") {
                    mesh.normals = vertices.iter().map(|vertex| vertex.normal).collect();
                }
                if (has("u") && has("v")) || (has("s") && has("t")) || (has("texture_u") && has("texture_v")) {
                    mesh.uvs = vertices.iter().map(|vertex| vertex.uv).collect();
                }
                mesh.positions = vertices.into_iter().map(|vertex| vertex.position).collect();
            }
            "face" => {
                let parser = Parser::<Face>::new();
                let faces = parser.read_payload_for_element(&mut reader, element, &header).map_err(damaged)?;
                for Face(corners) in faces {
                    let corner = |index: i64| {
                        let fits = usize::try_from(index).is_ok_and(|index| index < mesh.positions.len());
                        let what = || place.invalid(format!("a face names vertex {index} of {}", mesh.positions.len()));
                        if fits { Ok(index as u32) } else { Err(what()) }
                    };
                    let corners = corners.into_iter().map(corner).collect::<Result<Vec<_>>>()?;
                    mesh.triangles.extend(corners.windows(2).skip(1).map(|pair| [corners[0], pair[0], pair[1]]));
                }
            }
            _ => {
                Parser::<Face>::new().read_payload_for_element(&mut reader, element, &header).map_err(damaged)?;
            }
        }
    }
    Ok(mesh)
}
