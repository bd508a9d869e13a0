//! Makes the textures and meshes of the bundled scenes: `cargo run --release --example scene_assets`, in the
//! repository's top folder. Everything is computed here, so everything is ours to give away.

mod ply;
mod street;

use std::f32::consts::TAU;
use std::fmt::Write as _;
use std::fs;
use std::io::Write as _;
use std::path::Path;

use fluxion::error::Error;
use fluxion::image::{Image, io};
use fluxion::internals::math::{Vec3, rng, srgb_decode, vec3};

type Result = std::result::Result<(), Box<dyn std::error::Error>>;

fn main() -> Result {
    fs::create_dir_all("scenes/assets")?;
    tiles(Path::new("scenes/assets/tiles.png"))?;
    bumps(Path::new("scenes/assets/bumps.png"))?;
    normals(Path::new("scenes/assets/normals.png"))?;
    leaf(Path::new("scenes/assets/holes.png"))?;
    sky(Path::new("scenes/assets/sky.exr"))?;
    let torus = Torus::new(48, 24, 0.3);
    torus.write_obj("scenes/assets/torus.obj")?;
    torus.write_ply("scenes/assets/torus.ply", false)?;
    torus.write_ply("scenes/assets/torus_binary.ply", true)?;
    torus.write_colored_ply("scenes/assets/torus_colors.ply")?;
    torus.write_serialized("scenes/assets/torus.serialized")?;
    Ok(street::write()?)
}

/// Smooth noise of period one with `cells` cells.
fn noise(x: f32, y: f32, cells: u64, seed: u64) -> f32 {
    let value = |i: u64, j: u64| rng::unit(rng::combine(rng::combine(seed, i % cells), j % cells));
    let (x, y) = (x * cells as f32, y * cells as f32);
    let smooth = |t: f32| t * t * (3.0 - 2.0 * t);
    let (i, j, fx, fy) = (x as u64, y as u64, smooth(x.fract()), smooth(y.fract()));
    let row = |j| value(i, j) * (1.0 - fx) + value(i + 1, j) * fx;
    row(j) * (1.0 - fy) + row(j + 1) * fy
}

fn image(path: &Path, size: usize, pixel: impl Fn(f32, f32) -> Vec3) -> std::result::Result<(), Error> {
    let at = |i: usize| (i as f32 + 0.5) / size as f32;
    io::write_color(path, &Image::from_rgb(size, size, |x, y| pixel(at(x), at(y))), &Default::default())
}

/// Square tiles of uneven colour with dark joints.
fn tiles(path: &Path) -> std::result::Result<(), Error> {
    image(path, 256, |x, y| {
        let (i, j) = ((x * 8.0) as u64, (y * 8.0) as u64);
        let (fx, fy) = ((x * 8.0).fract(), (y * 8.0).fract());
        let joint = fx.min(1.0 - fx).min(fy).min(1.0 - fy) < 0.04;
        let shade = 0.6 + 0.3 * rng::unit(rng::combine(i, j)) + 0.1 * noise(x, y, 32, 1);
        if joint { Vec3::splat(0.08) } else { shade * vec3(0.75, 0.5, 0.3) }
    })
}

/// Heights of round bumps.
fn bumps(path: &Path) -> std::result::Result<(), Error> {
    image(path, 128, |x, y| Vec3::splat(0.5 + 0.25 * ((x * 4.0 * TAU).sin() * (y * 4.0 * TAU).sin())))
}

/// The normals of round bumps, as numbers rather than colours.
fn normals(path: &Path) -> std::result::Result<(), Error> {
    image(path, 128, |x, y| {
        let (sx, cx) = (x * 4.0 * TAU).sin_cos();
        let (sy, cy) = (y * 4.0 * TAU).sin_cos();
        let normal = vec3(-0.5 * cx * sy, -0.5 * sx * cy, 1.0).normalize();
        let stored = 0.5 * normal + 0.5;
        // The file's encoding for display is undone, so that what it holds are the numbers.
        Vec3::from_array(stored.to_array().map(srgb_decode))
    })
}

/// White with round holes.
fn leaf(path: &Path) -> std::result::Result<(), Error> {
    image(path, 128, |x, y| {
        let (fx, fy) = ((x * 4.0).fract() - 0.5, (y * 4.0).fract() - 0.5);
        Vec3::splat(if fx * fx + fy * fy < 0.09 { 0.0 } else { 1.0 })
    })
}

/// A blue sky over brown ground with a warm sun that is a few pixels wide.
fn sky(path: &Path) -> std::result::Result<(), Error> {
    let (width, height) = (128, 64);
    let picture = Image::from_rgb(width, height, |x, y| {
        let (u, v) = ((x as f32 + 0.5) / width as f32, (y as f32 + 0.5) / height as f32);
        let base =
            if v < 0.5 { vec3(0.25, 0.45, 0.9).lerp(vec3(0.9, 0.9, 0.95), 2.0 * v) } else { vec3(0.2, 0.15, 0.1) };
        let distance = (u - 0.3).hypot(0.5 * (v - 0.25));
        base + vec3(60.0, 50.0, 35.0) * (-(distance / 0.02).powi(2)).exp()
    });
    io::write_color(path, &picture, &Default::default())
}

/// A torus around the z axis: radius 1 with a tube of radius `tube`.
struct Torus {
    positions: Vec<Vec3>,
    normals: Vec<Vec3>,
    uvs: Vec<[f32; 2]>,
    triangles: Vec<[u32; 3]>,
}

impl Torus {
    fn new(around: u32, across: u32, tube: f32) -> Self {
        let mut torus = Self { positions: vec![], normals: vec![], uvs: vec![], triangles: vec![] };
        for i in 0..=around {
            for j in 0..=across {
                let (u, v) = (i as f32 / around as f32, j as f32 / across as f32);
                let (sin_u, cos_u) = (TAU * u).sin_cos();
                let (sin_v, cos_v) = (TAU * v).sin_cos();
                let normal = vec3(cos_u * cos_v, sin_u * cos_v, sin_v);
                torus.positions.push(vec3(cos_u, sin_u, 0.0) + normal * tube);
                torus.normals.push(normal);
                torus.uvs.push([u, v]);
            }
        }
        let index = |i: u32, j: u32| i * (across + 1) + j;
        for i in 0..around {
            for j in 0..across {
                let [a, b, c, d] = [index(i, j), index(i + 1, j), index(i + 1, j + 1), index(i, j + 1)];
                torus.triangles.extend([[a, b, c], [a, c, d]]);
            }
        }
        torus
    }

    fn write_obj(&self, path: &str) -> Result {
        let mut text = String::from("# A torus, for scenes/unit/meshes.\n");
        for (p, (n, [u, v])) in self.positions.iter().zip(self.normals.iter().zip(&self.uvs)) {
            writeln!(text, "v {} {} {}\nvn {} {} {}\nvt {u} {v}", p.x, p.y, p.z, n.x, n.y, n.z)?;
        }
        for triangle in &self.triangles {
            let [a, b, c] = triangle.map(|index| index + 1);
            writeln!(text, "f {a}/{a}/{a} {b}/{b}/{b} {c}/{c}/{c}")?;
        }
        Ok(fs::write(path, text)?)
    }

    /// Without normals, so that they have to be made on loading.
    fn write_ply(&self, path: &str, binary: bool) -> Result {
        let vertices = self.positions.iter().zip(&self.uvs).map(|(p, [u, v])| [p.x, p.y, p.z, *u, *v]);
        Ok(ply::write(path, binary, ["x", "y", "z", "u", "v"], vertices, &self.triangles)?)
    }

    /// With normals and a colour at every vertex.
    fn write_colored_ply(&self, path: &str) -> Result {
        let properties = ["x", "y", "z", "nx", "ny", "nz", "color_0", "color_1", "color_2"];
        let vertices = self.positions.iter().zip(self.normals.iter().zip(&self.uvs)).map(|(p, (n, [u, v]))| {
            let color = vec3(0.2 + 0.6 * (TAU * u).cos().abs(), 0.3, 0.2 + 0.6 * (TAU * v).sin().abs());
            [p.x, p.y, p.z, n.x, n.y, n.z, color.x, color.y, color.z]
        });
        Ok(ply::write(path, true, properties, vertices, &self.triangles)?)
    }

    fn write_serialized(&self, path: &str) -> Result {
        let mut body = 0x1003u32.to_le_bytes().to_vec();
        body.extend(b"torus\0");
        body.extend((self.positions.len() as u64).to_le_bytes());
        body.extend((self.triangles.len() as u64).to_le_bytes());
        let vectors = self.positions.iter().chain(&self.normals).flat_map(|v| v.to_array());
        vectors.chain(self.uvs.iter().flatten().copied()).for_each(|value| body.extend(value.to_le_bytes()));
        self.triangles.iter().flatten().for_each(|index| body.extend(index.to_le_bytes()));
        let mut encoder = flate2::write::ZlibEncoder::new(Vec::new(), flate2::Compression::best());
        encoder.write_all(&body)?;
        let mut bytes = vec![0x1c, 0x04, 0x04, 0x00];
        bytes.extend(encoder.finish()?);
        bytes.extend(0u64.to_le_bytes());
        bytes.extend(1u32.to_le_bytes());
        Ok(fs::write(path, bytes)?)
    }
}
