//! Wavefront OBJ meshes: the whole file as one mesh, whatever its groups, objects and materials.

use std::collections::HashMap;
use std::path::Path;

use super::polygon::Triangulation;
use crate::error::{Result, SourceLoc};
use crate::math::{Vec2, Vec3, vec2, vec3};
use crate::scene::plugin::MeshData;

/// Position, texture coordinate and normal of a corner, as numbers from 0.
type Corner = (usize, Option<usize>, Option<usize>);

/// Reads a mesh. Corners that agree in position, texture coordinate and normal share a vertex; faces with more than
/// three corners become triangles, and negative numbers count from the latest entry. A corner without a texture
/// coordinate or normal, in a file that has them, gets zero.
pub fn read(bytes: &[u8], path: &Path) -> Result<MeshData> {
    let text = String::from_utf8_lossy(bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes));
    // Lines of old Macs end in a carriage return alone.
    let text = if text.contains('\n') { text } else { text.replace('\r', "\n").into() };
    let mut file = File::default();
    let mut lines = (1..).zip(text.lines());
    while let Some((number, line)) = lines.next() {
        let mut joined = String::new();
        let line = match without_comment(line).strip_suffix('\\') {
            None => without_comment(line),
            Some(start) => {
                joined.push_str(start);
                // A line that ends in a backslash goes on in the next one.
                for (_, next) in lines.by_ref() {
                    let next = without_comment(next);
                    joined.push(' ');
                    joined.push_str(next.strip_suffix('\\').unwrap_or(next));
                    if !next.ends_with('\\') {
                        break;
                    }
                }
                &joined
            }
        };
        file.line(line).map_err(|what| SourceLoc::line(path, number).invalid(what))?;
    }
    Ok(file.mesh)
}

fn without_comment(line: &str) -> &str {
    line.split_once('#').map_or(line, |(code, _)| code).trim_end()
}

#[derive(Default)]
struct File {
    positions: Vec<Vec3>,
    uvs: Vec<Vec2>,
    normals: Vec<Vec3>,
    vertices: HashMap<Corner, u32>,
    triangulation: Triangulation,
    mesh: MeshData,
}

impl File {
    fn line(&mut self, line: &str) -> Result<(), String> {
        let mut words = line.split_whitespace();
        match words.next() {
            Some("v") => self.positions.push(vector(words)?),
            Some("vn") => self.normals.push(vector(words)?),
            Some("vt") => {
                let uv = numbers(words)?;
                self.uvs.push(vec2(uv[0], uv[1]));
            }
            Some("f") => {
                let corners = words.map(|word| self.vertex(word)).collect::<Result<Vec<_>, _>>()?;
                let Self { triangulation, mesh, .. } = self;
                triangulation.add(&corners, &mesh.positions, &mut mesh.triangles);
            }
            _ => {}
        }
        Ok(())
    }

    /// The vertex of a corner written `v`, `v/vt`, `v//vn` or `v/vt/vn`.
    fn vertex(&mut self, word: &str) -> Result<u32, String> {
        let mut parts = word.split('/');
        let mut index = |count: usize| match parts.next().unwrap_or_default() {
            "" => Ok(None),
            text => resolve(text, count).map(Some),
        };
        let position = index(self.positions.len())?.ok_or_else(|| format!("the corner `{word}` names no vertex"))?;
        let corner = (position, index(self.uvs.len())?, index(self.normals.len())?);
        if let Some(&vertex) = self.vertices.get(&corner) {
            return Ok(vertex);
        }
        let vertex = u32::try_from(self.mesh.positions.len()).map_err(|_| "more than four billion vertices")?;
        self.vertices.insert(corner, vertex);
        append(&mut self.mesh.uvs, vertex, corner.1.map(|at| self.uvs[at]));
        append(&mut self.mesh.normals, vertex, corner.2.map(|at| self.normals[at]));
        self.mesh.positions.push(self.positions[position]);
        Ok(vertex)
    }
}

/// Gives `vertex` a value in a list that stays empty until the first vertex that has one.
fn append<T: Clone + Default>(list: &mut Vec<T>, vertex: u32, value: Option<T>) {
    if value.is_some() || !list.is_empty() {
        list.resize(vertex as usize, T::default());
        list.push(value.unwrap_or_default());
    }
}

fn resolve(text: &str, count: usize) -> Result<usize, String> {
    let number: i64 = text.parse().map_err(|_| format!("`{text}` is not a whole number"))?;
    let index = if number < 0 { count as i64 + number } else { number - 1 };
    let index = usize::try_from(index).ok().filter(|&index| index < count);
    index.ok_or_else(|| format!("entry {number} of {count} does not exist"))
}

/// The first three numbers of a line, missing ones zero.
fn numbers<'a>(words: impl Iterator<Item = &'a str>) -> Result<[f32; 3], String> {
    let mut values = [0.0; 3];
    for (value, word) in values.iter_mut().zip(words) {
        *value = word.parse().map_err(|_| format!("`{word}` is not a number"))?;
    }
    Ok(values)
}

fn vector<'a>(words: impl Iterator<Item = &'a str>) -> Result<Vec3, String> {
    numbers(words).map(|[x, y, z]| vec3(x, y, z))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(text: &str) -> Result<MeshData> {
        read(text.as_bytes(), Path::new("mesh.obj"))
    }

    #[test]
    fn groups_share_vertices_and_attributes_stay_with_their_corners() {
        let head = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0.25 0.5\nvn 0 0 1\n";
        let grouped = parse(&format!("{head}g a\nf 1 2 3\ng b\nf 1 3 4\n")).unwrap();
        assert_eq!((grouped.positions.len(), grouped.triangles.len(), grouped.uvs.len()), (4, 2, 0));
        let partial = parse(&format!("{head}f 1 2 3\nf 1/1/1 3/1/1 4/1/1\n")).unwrap();
        assert_eq!((partial.positions.len(), partial.uvs.len(), partial.normals.len()), (6, 6, 6));
        assert_eq!((partial.uvs[0], partial.uvs[3], partial.normals[5]), (Vec2::ZERO, vec2(0.25, 0.5), Vec3::Z));
        let fan = parse(&format!("{head}f -4 -3 -2 -1\n")).unwrap();
        assert_eq!(fan.triangles, [[0, 1, 2], [0, 2, 3]]);
    }

    #[test]
    fn lines_may_be_commented_continued_and_marked() {
        let text = "\u{feff}v 0 0 0 # first\nv 1 0 \\ # more\n 0\nv 1 1 \\\n \\\n0#last\nf 1 2 3 # a face\n# v x\n";
        let mesh = parse(text).unwrap();
        assert_eq!((mesh.positions.len(), mesh.triangles.len()), (3, 1));
        assert_eq!(mesh.positions[2], vec3(1.0, 1.0, 0.0));
        assert!(parse("v 0 0 0\nf 1 \\\n 1 2\n").unwrap_err().to_string().contains(":2: entry 2 of 1"));
    }

    #[test]
    fn mistakes_are_named_with_their_line() {
        for (text, expected) in [
            ("v 0 0 0\nf 1 2 3\n", ":2: entry 2 of 1 does not exist"),
            ("v 0 zero 0\n", ":1: `zero` is not a number"),
            ("v 0 0 0\nf 1 /1 1\n", ":2: the corner `/1` names no vertex"),
            ("v 0 0 0\nf 0 1 1\n", "entry 0 of 1"),
        ] {
            let message = parse(text).unwrap_err().to_string();
            assert!(message.contains(expected), "{message}");
        }
    }
}
