//! Meshes of the scene `night-street`: houses with lit windows, signs and strings of bulbs.

use std::io::Result;

use fluxion::internals::math::{Vec3, rng, vec3};

use crate::ply;

/// Half of the width between the houses, and how far the street goes, in metres.
const HALF_WIDTH: f32 = 5.0;
const LENGTH: f32 = 60.0;

/// Kinds of lit windows, and of signs.
const LIGHTS: usize = 3;
const SIGNS: usize = 3;

/// Triangles with shared corners.
#[derive(Default)]
struct Mesh {
    positions: Vec<Vec3>,
    triangles: Vec<[u32; 3]>,
}

impl Mesh {
    /// The parallelogram from a corner along two sides; it faces their cross product.
    fn quad(&mut self, corner: Vec3, a: Vec3, b: Vec3) {
        let first = self.positions.len() as u32;
        self.positions.extend([corner, corner + a, corner + a + b, corner + b]);
        self.triangles.extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
    }

    /// A box between two corners.
    fn block(&mut self, lower: Vec3, upper: Vec3) {
        let size = upper - lower;
        let [x, y, z] = [Vec3::X * size.x, Vec3::Y * size.y, Vec3::Z * size.z];
        for (a, b) in [(x, y), (y, z), (z, x)] {
            self.quad(lower, b, a);
            self.quad(upper, -a, -b);
        }
    }

    fn octahedron(&mut self, centre: Vec3, radius: f32) {
        let first = self.positions.len() as u32;
        self.positions
            .extend([Vec3::X, -Vec3::X, Vec3::Y, -Vec3::Y, Vec3::Z, -Vec3::Z].map(|axis| centre + radius * axis));
        for corner in 0..8u32 {
            let [x, y, z] = [corner & 1, corner >> 1 & 1, corner >> 2];
            let face = [first + x, first + 2 + y, first + 4 + z];
            // Every mirrored axis turns a face around.
            self.triangles.push(if (x + y + z) % 2 == 0 { face } else { [face[0], face[2], face[1]] });
        }
    }

    fn write(&self, name: &str) -> Result<()> {
        let path = format!("scenes/assets/street_{name}.ply");
        ply::write(&path, true, ["x", "y", "z"], self.positions.iter().map(|p| p.to_array()), &self.triangles)
    }
}

/// Writes `scenes/assets/street_*.ply`.
pub fn write() -> Result<()> {
    let (mut walls, mut panes, mut bulbs) = (Mesh::default(), Mesh::default(), Mesh::default());
    let mut windows: [Mesh; LIGHTS] = Default::default();
    let mut signs: [Mesh; SIGNS] = Default::default();
    let mut numbers = (0u64..).map(|i| rng::unit(rng::combine(17, i)));
    let mut number = move || numbers.next().unwrap_or_default();
    for side in [-1.0f32, 1.0] {
        let mut z = 6.0;
        while z > -LENGTH {
            let (width, floors) = (6.0 + 4.0 * number(), 3 + (4.0 * number()) as usize);
            let front = side * (HALF_WIDTH + 0.6 * number());
            let height = 3.2 * floors as f32 + 1.0;
            let back = front + side * 4.0;
            walls.block(vec3(front.min(back), 0.0, z - width), vec3(front.max(back), height, z));
            // Windows stand before the wall and look at the street.
            let along = Vec3::Z * side;
            let out = front - side * 0.03;
            let columns = (width / 1.7) as usize;
            for floor in 1..floors {
                for column in 0..columns {
                    let start = z - (column as f32 + 0.25) * width / columns as f32;
                    let corner = vec3(out, 3.2 * floor as f32 + 0.6, if side > 0.0 { start - 0.9 } else { start });
                    let kind = number();
                    let of =
                        if kind < 0.45 { &mut windows[(kind / 0.45 * LIGHTS as f32) as usize] } else { &mut panes };
                    of.quad(corner, along * 0.9, Vec3::Y * 1.5);
                }
            }
            let (start, long) = (z - 0.5 - 2.0 * number(), 1.5 + 2.0 * number());
            let kind = (number() * SIGNS as f32) as usize;
            let (near, far) = (front - side * 0.25, front - side * 0.05);
            signs[kind].block(vec3(near.min(far), 2.6, start - long), vec3(near.max(far), 3.1, start));
            z -= width;
        }
    }
    for string in 0..6 {
        let z = 1.0 - 4.0 * string as f32;
        for bulb in 0..30 {
            let t = (bulb as f32 + 0.5) / 30.0 * 2.0 - 1.0;
            bulbs.octahedron(vec3(t * HALF_WIDTH * 0.95, 4.4 + 1.2 * t * t, z - 0.8 * t), 0.07);
        }
    }
    walls.write("walls")?;
    panes.write("panes")?;
    bulbs.write("bulbs")?;
    windows.iter().enumerate().try_for_each(|(k, mesh)| mesh.write(&format!("windows_{k}")))?;
    signs.iter().enumerate().try_for_each(|(k, mesh)| mesh.write(&format!("signs_{k}")))
}
