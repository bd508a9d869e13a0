//! Stanford PLY meshes, ascii and binary.

use std::path::Path;

use ply_rs_bw::parser::{ParseError, Parser, Reader};
use ply_rs_bw::ply::{ElementDef, Encoding, Header, Property, PropertyAccess, PropertyAccessResult, PropertyType};

use super::polygon::Triangulation;
use crate::error::{Result, SourceLoc};
use crate::math::{Rgb, Vec3, vec2};
use crate::scene::plugin::MeshData;

/// Columns with a meaning of their own.
const POSITION: &[&str] = &["x", "y", "z", "nx", "ny", "nz"];

/// A vertex of the file; absent columns are zero.
#[derive(Default)]
struct Vertex {
    position: Vec3,
    normal: Vec3,
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

/// Names of texture coordinates; the first pair that a file has counts.
const UVS: [[&str; 2]; 3] = [["u", "v"], ["texture_u", "texture_v"], ["s", "t"]];
/// Endings that make columns of one name a colour; the first ending alone makes a number.
const ENDINGS: [[&str; 3]; 4] = [["_0", "_1", "_2"], ["_1", "_2", "_3"], ["_x", "_y", "_z"], ["_r", "_g", "_b"]];

/// The columns that land in `others`: all single values that are no part of `known`.
fn columns<'a>(element: &'a ElementDef, known: &[&str]) -> Vec<&'a str> {
    let scalar = |property: &PropertyType| matches!(property, PropertyType::Scalar(_));
    let scalars = element.properties.iter().filter(|(_, property)| scalar(&property.data_type));
    scalars.map(|(name, _)| name.as_str()).filter(|name| !known.contains(name)).collect()
}

fn position(names: &[&str], name: &str) -> Option<usize> {
    names.iter().position(|other| *other == name)
}

/// The attributes among columns of other values: names with numbered or lettered endings, and red, green and blue as
/// the colour `color`.
fn attributes<'a>(
    prefix: &str,
    names: &[&str],
    rows: impl Iterator<Item = &'a [f32]> + Clone,
) -> Vec<(String, Vec<Rgb>)> {
    let mut found: Vec<(&str, [usize; 3])> = Vec::new();
    for (endings, name) in ENDINGS.iter().flat_map(|endings| names.iter().map(move |name| (endings, *name))) {
        let Some(stem) = name.strip_suffix(endings[0]) else { continue };
        let [first, second, third] = endings.map(|ending| position(names, &format!("{stem}{ending}")));
        // `tone_1` beside `tone_0` is the second column of that, not a name of its own.
        if found.iter().all(|(other, _)| *other != stem) {
            found.extend(first.map(|first| (stem, [first, second.unwrap_or(first), third.unwrap_or(first)])));
        }
    }
    for colors in [["r", "g", "b"], ["red", "green", "blue"]] {
        if let [Some(r), Some(g), Some(b)] = colors.map(|name| position(names, name)) {
            found.push(("color", [r, g, b]));
        }
    }
    let value = |row: &[f32], at: [usize; 3]| Rgb::from_array(at.map(|at| row.get(at).copied().unwrap_or_default()));
    let values = |at: [usize; 3]| rows.clone().map(|row| value(row, at)).collect();
    found.into_iter().map(|(stem, at)| (format!("{prefix}{stem}"), values(at))).collect()
}

/// Reads a mesh; elements may come in any order, and faces may have any number of corners.
pub fn read(bytes: &[u8], path: &Path) -> Result<MeshData> {
    let loc = SourceLoc::file(path);
    let mut reader = Reader::new(bytes);
    let damaged = |error: ParseError| loc.invalid(format!("not a readable PLY file: {error}"));
    let header = Parser::<Vertex>::new().read_header(&mut reader).map_err(damaged)?;
    // Every entry takes at least one byte: a larger count is a damaged header.
    if let Some((name, element)) = header.elements.iter().find(|(_, element)| element.count > bytes.len()) {
        return Err(loc.invalid(format!("{} entries of `{name}` do not fit in the file", element.count)));
    }
    let lines = if header.encoding == Encoding::Ascii { by_lines(bytes, &header, &loc)? } else { Vec::new() };
    let mut reader = if header.encoding == Encoding::Ascii { Reader::new(lines.as_slice()) } else { reader };
    let (mut mesh, mut faces) = (MeshData::default(), None);
    for (name, element) in &header.elements {
        if name == "vertex" {
            let parser = Parser::<Vertex>::new();
            let vertices = parser.read_payload_for_element(&mut reader, element, &header).map_err(damaged)?;
            add_vertices(&mut mesh, vertices, element);
            continue;
        }
        let entries = Parser::<Face>::new().read_payload_for_element(&mut reader, element, &header).map_err(damaged)?;
        if name == "face" {
            faces = Some((entries, element));
        }
    }
    if let Some((faces, element)) = faces {
        add_faces(&mut mesh, &faces, element, &loc)?;
    }
    Ok(mesh)
}

/// The entries of an ASCII file, each on a line of its own: they are words between white space, however that is made up.
fn by_lines(bytes: &[u8], header: &Header, loc: &SourceLoc) -> Result<Vec<u8>> {
    // The line that ends the header: comments may hold the word, too.
    let mut start = 0;
    for line in bytes.split_inclusive(|byte| matches!(byte, b'\n' | b'\r')) {
        start += line.len();
        if line.trim_ascii() == b"end_header" {
            break;
        }
    }
    let mut words = bytes[start..].split(u8::is_ascii_whitespace).filter(|word| !word.is_empty());
    let mut lines = Vec::with_capacity(bytes.len());
    for (name, element) in &header.elements {
        for entry in 0..element.count {
            let ends = || loc.invalid(format!("the file ends in entry {entry} of {} of `{name}`", element.count));
            for property in element.properties.values() {
                let mut copy =
                    || words.next().inspect(|word| lines.extend([word, &b" "[..]].concat())).ok_or_else(ends);
                let word = copy()?;
                if let PropertyType::List(..) = property.data_type {
                    let count = std::str::from_utf8(word).ok().and_then(|text| text.parse::<usize>().ok());
                    let what = || format!("entry {entry} of `{name}` has `{}` values", String::from_utf8_lossy(word));
                    for _ in 0..count.ok_or_else(|| loc.invalid(what()))? {
                        copy()?;
                    }
                }
            }
            lines.push(b'\n');
        }
    }
    Ok(lines)
}

fn add_vertices(mesh: &mut MeshData, vertices: Vec<Vertex>, element: &ElementDef) {
    let has = |key: &str| element.properties.contains_key(key);
    if has("nx") && has("ny") && has("nz") {
        mesh.normals = vertices.iter().map(|vertex| vertex.normal).collect();
    }
    let names = columns(element, POSITION);
    let pairs = UVS.map(|pair| pair.map(|name| position(&names, name)));
    if let Some([Some(u), Some(v)]) = pairs.into_iter().find(|pair| pair.iter().all(Option::is_some)) {
        let value = |row: &Vertex, at: usize| row.others.get(at).copied().unwrap_or_default();
        mesh.uvs = vertices.iter().map(|row| vec2(value(row, u), value(row, v))).collect();
    }
    mesh.attributes.extend(attributes("vertex_", &names, vertices.iter().map(|vertex| &*vertex.others)));
    mesh.positions = vertices.into_iter().map(|vertex| vertex.position).collect();
}

fn add_faces(mesh: &mut MeshData, faces: &[Face], element: &ElementDef, loc: &SourceLoc) -> Result<()> {
    let mut triangulation = Triangulation::default();
    // One entry a triangle, for faces of several.
    let mut others = Vec::new();
    for face in faces {
        let corner = |index: i64| {
            let fits = usize::try_from(index).is_ok_and(|index| index < mesh.positions.len());
            let what = || loc.invalid(format!("a face names vertex {index} of {}", mesh.positions.len()));
            if fits { Ok(index as u32) } else { Err(what()) }
        };
        let corners = face.corners.iter().copied().map(corner).collect::<Result<Vec<_>>>()?;
        triangulation.add(&corners, &mesh.positions, &mut mesh.triangles);
        others.resize(mesh.triangles.len(), &*face.others);
    }
    mesh.attributes.extend(attributes("face_", &columns(element, &[]), others.into_iter()));
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::vec3;

    #[test]
    fn attributes_keep_their_columns_and_faces_of_many_corners_their_values() {
        let text = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n\
            property float s\nproperty float t\nproperty uchar red\nproperty uchar green\nproperty uchar blue\n\
            property float heat_0\nelement face 2\nproperty list uchar int vertex_indices\nproperty float nx\n\
            property float tone_r\nproperty float tone_g\nproperty float tone_b\nend_header\n\
            0 0 0 0 1 10 20 30 0.5\n1 0 0 1 1 10 20 30 0.5\n1 1 0 1 0 10 20 30 0.5\n0 1 0 0 0.25 10 20 30 0.5\n\
            4 0 1 2 3 9 0.1 0.2 0.3\n3 0 1 2 9 0.4 0.5 0.6\n";
        let mesh = read(text.as_bytes(), Path::new("t.ply")).unwrap();
        assert_eq!((mesh.triangles.len(), mesh.uvs[3]), (3, vec2(0.0, 0.25)));
        let find = |name: &str| &mesh.attributes.iter().find(|(other, _)| other == name).unwrap().1;
        assert_eq!(find("vertex_color")[1], vec3(10.0, 20.0, 30.0));
        assert_eq!(find("vertex_heat")[2], Rgb::splat(0.5));
        assert_eq!(*find("face_tone"), [vec3(0.1, 0.2, 0.3), vec3(0.1, 0.2, 0.3), vec3(0.4, 0.5, 0.6)]);
    }
}
