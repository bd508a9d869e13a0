//! Round shapes as meshes, where a transform makes them into something that has no surface of its own here.

use std::f32::consts::{PI, TAU};

use crate::math::{Mat4, Vec3, vec2, vec3};
use crate::scene::plugin::MeshData;

/// Columns around an axis, by which areas are too small by one part in ten thousand.
const COLUMNS: u32 = 256;
/// Rows from pole to pole.
const ROWS: u32 = 128;

/// The unit sphere, with the texture coordinates of `sphere`.
pub fn sphere() -> MeshData {
    grid(ROWS, |u, v| {
        let ((sin, cos), (y, x)) = ((PI * v).sin_cos(), (TAU * u).sin_cos());
        let p = vec3(x * sin, y * sin, cos);
        (p, p)
    })
}

/// The unit cylinder about z in [0, 1], with the texture coordinates of `cylinder`.
pub fn cylinder() -> MeshData {
    grid(1, |u, v| {
        let (y, x) = (TAU * u).sin_cos();
        (vec3(x, y, v), vec3(x, y, 0.0))
    })
}

/// Whether a transform bends right angles.
pub fn is_sheared(to_world: Mat4) -> bool {
    let [x, y, z] = [Vec3::X, Vec3::Y, Vec3::Z].map(|axis| to_world.transform_vector3(axis).normalize_or_zero());
    [x.dot(y), x.dot(z), y.dot(z)].iter().any(|cosine| cosine.abs() > 1e-3)
}

/// Squares of (u, v), each as two triangles that face along the normals. `at` gives position and normal.
fn grid(rows: u32, at: impl Fn(f32, f32) -> (Vec3, Vec3)) -> MeshData {
    let mut mesh = MeshData::default();
    for row in 0..=rows {
        for column in 0..=COLUMNS {
            let (u, v) = (column as f32 / COLUMNS as f32, row as f32 / rows as f32);
            // The seam closes without a gap.
            let (p, n) = at(if column == COLUMNS { 0.0 } else { u }, v);
            mesh.positions.push(p);
            mesh.normals.push(n);
            mesh.uvs.push(vec2(u, v));
        }
    }
    for (row, column) in (0..rows).flat_map(|row| (0..COLUMNS).map(move |column| (row, column))) {
        let here = row * (COLUMNS + 1) + column;
        let below = here + COLUMNS + 1;
        for [a, b, c] in [[here, below, below + 1], [here, below + 1, here + 1]] {
            let [pa, pb, pc] = [a, b, c].map(|index| mesh.positions[index as usize]);
            let outward = (pb - pa).cross(pc - pa).dot(mesh.normals[a as usize]);
            mesh.triangles.push(if outward < 0.0 { [a, c, b] } else { [a, b, c] });
        }
    }
    mesh
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn areas_are_nearly_those_of_the_shapes() {
        for (mesh, area) in [(sphere(), 4.0 * PI), (cylinder(), TAU)] {
            let of = |&[a, b, c]: &[u32; 3]| {
                let [a, b, c] = [a, b, c].map(|index| mesh.positions[index as usize]);
                0.5 * (b - a).cross(c - a).length()
            };
            let sum: f32 = mesh.triangles.iter().map(of).sum();
            assert!((sum / area - 1.0).abs() < 3e-4, "{sum} {area}");
        }
    }
}
