//! Stanford PLY meshes, ascii and binary.

use std::path::Path;

use ply_rs_bw::parser::{ParseError, Parser, Reader};
use ply_rs_bw::ply::{ElementDef, Property, PropertyAccess, PropertyAccessResult, PropertyType};

use super::MeshData;
use crate::error::{Place, Result};
use crate::math::{Rgb, Vec2, Vec3};

/// A vertex as the file has it; what it does not have stays zero.
#[derive(Default)]
struct Vertex {
    position: Vec3,
    normal: Vec3,
    uv: Vec2,
    /// Everything else, in the order of the header.
    others: Vec<f32>,
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
            _ => {
                self.others.extend(number(property));
                return PropertyAccessResult::Set;
            }
        };
        let Some(value) = number(property) else { return PropertyAccessResult::UnsupportedType };
        *slot = value;
        PropertyAccessResult::Set
    }
}

/// A face as a list of vertex numbers, with its other values in the order of the header.
#[derive(Default)]
struct Face {
    corners: Vec<i64>,
    others: Vec<f32>,
}

impl PropertyAccess for Face {
    fn new() -> Self {
        Self::default()
    }

    fn set_property(&mut self, key: &str, property: Property) -> PropertyAccessResult {
        if key != "vertex_indices" && key != "vertex_index" {
            self.others.extend(number(property));
            return PropertyAccessResult::Set;
        }
        self.corners = match property {
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

/// Properties that are not attributes.
const GEOMETRY: &[&str] = &["x", "y", "z", "nx", "ny", "nz", "u", "v", "s", "t", "texture_u", "texture_v"];

/// The attributes among the other values of vertices or faces: `NAME_0`, `NAME_1`, `NAME_2` are a colour and `NAME_0`
/// alone a number; red, green and blue are the colour `color`.
fn attributes<'a>(
    prefix: &str,
    element: &ElementDef,
    rows: impl Iterator<Item = &'a [f32]> + Clone,
) -> Vec<(String, Vec<Rgb>)> {
    let scalar = |property: &PropertyType| matches!(property, PropertyType::Scalar(_));
    let scalars = element.properties.iter().filter(|(_, property)| scalar(&property.data_type));
    let names: Vec<&str> = scalars.map(|(name, _)| name.as_str()).filter(|name| !GEOMETRY.contains(name)).collect();
    let place = |name: &str| names.iter().position(|other| *other == name);
    let mut stems: Vec<&str> = names.iter().filter_map(|name| name.strip_suffix("_0")).collect();
    stems.dedup();
    let numbered = stems.into_iter().map(|stem| {
        let columns = [0, 1, 2].map(|i| place(&format!("{stem}_{i}")));
        (stem, columns.map(|column| column.or(columns[0])))
    });
    let colors = [["r", "g", "b"], ["red", "green", "blue"]].map(|names| ("color", names.map(place)));
    let columns = numbered.chain(colors).filter_map(|(stem, columns)| match columns {
        [Some(r), Some(g), Some(b)] => Some((stem, [r, g, b])),
        _ => None,
    });
    let value = |row: &[f32], columns: [usize; 3]| {
        Rgb::from_array(columns.map(|column| row.get(column).copied().unwrap_or_default()))
    };
    columns.map(|(stem, at)| (format!("{prefix}{stem}"), rows.clone().map(|row| value(row, at)).collect())).collect()
}

/// Reads a mesh; faces with more than three corners become fans.
pub fn read(bytes: &[u8], path: &Path) -> Result<MeshData> {
    let place = Place::file(path);
    let mut reader = Reader::new(bytes);
    let damaged = |error: ParseError| place.invalid(format!("not a readable PLY file: {error}"));
    let header = Parser::<Vertex>::new().read_header(&mut reader).map_err(damaged)?;
    let mut mesh = MeshData::default();
    for (name, element) in &header.elements {
        // Every entry takes at least one byte: a larger count is a damaged header.
        if element.count > bytes.len() {
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
                mesh.attributes.extend(attributes("vertex_", element, vertices.iter().map(|vertex| &*vertex.others)));
                mesh.positions = vertices.into_iter().map(|vertex| vertex.position).collect();
            }
            "face" => {
                let parser = Parser::<Face>::new();
                let faces = parser.read_payload_for_element(&mut reader, element, &header).map_err(damaged)?;
                // One entry a triangle, for faces that are fans.
                let mut others = Vec::new();
                for face in &faces {
                    let corner = |index: i64| {
                        let fits = usize::try_from(index).is_ok_and(|index| index < mesh.positions.len());
                        let what = || place.invalid(format!("a face names vertex {index} of {}", mesh.positions.len()));
                        if fits { Ok(index as u32) } else { Err(what()) }
                    };
                    let corners = face.corners.iter().copied().map(corner).collect::<Result<Vec<_>>>()?;
                    mesh.triangles.extend(corners.windows(2).skip(1).map(|pair| [corners[0], pair[0], pair[1]]));
                    others.resize(mesh.triangles.len(), &*face.others);
                }
                mesh.attributes.extend(attributes("face_", element, others.into_iter()));
            }
            _ => {
                Parser::<Face>::new().read_payload_for_element(&mut reader, element, &header).map_err(damaged)?;
            }
        }
    }
    Ok(mesh)
}
