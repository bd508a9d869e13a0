//! Meshes of triangles as PLY files.

use std::io::Write as _;
use std::{fs, io};

/// Writes vertices of the named properties, one row each, and triangles between them.
pub fn write<const N: usize>(
    path: &str,
    binary: bool,
    properties: [&str; N],
    vertices: impl ExactSizeIterator<Item = [f32; N]>,
    triangles: &[[u32; 3]],
) -> io::Result<()> {
    let format = if binary { "binary_little_endian" } else { "ascii" };
    let properties = properties.map(|name| format!("property float {name}\n")).concat();
    let mut bytes = format!(
        "ply\nformat {format} 1.0\nelement vertex {}\n{properties}element face {}\n\
         property list uchar int vertex_indices\nend_header\n",
        vertices.len(),
        triangles.len()
    )
    .into_bytes();
    for row in vertices {
        if binary {
            row.iter().for_each(|value| bytes.extend(value.to_le_bytes()));
        } else {
            writeln!(bytes, "{}", row.map(|value| value.to_string()).join(" "))?;
        }
    }
    for [a, b, c] in triangles {
        if binary {
            bytes.push(3);
            [a, b, c].iter().for_each(|index| bytes.extend((**index as i32).to_le_bytes()));
        } else {
            writeln!(bytes, "3 {a} {b} {c}")?;
        }
    }
    fs::write(path, bytes)
}
