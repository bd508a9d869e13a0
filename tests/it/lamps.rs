//! Lamps of every kind, turned in 26 directions, against quadrature over their squares.

use std::f32::consts::PI;
use std::fs;

use fluxion::film::Needs;
use fluxion::internals::math::{Frame, Vec3, vec3};
use fluxion::mitsuba;
use fluxion::scene::Scene;

use crate::common::film;
use crate::wild::pixels;

/// How a square lamp is written that faces along the +z of its frame.
struct Lamp {
    name: &'static str,
    /// The shape's type and its properties, without `to_world`.
    shape: &'static str,
    /// What is done to it before it is put in its place.
    before: &'static str,
    /// The obj file of those that have one.
    mesh: &'static str,
}

const CORNERS: &str = "v -1 -1 0\nv 1 -1 0\nv 1 1 0\nv -1 1 0\n";
const FRONT: &str = "f 1 2 3\nf 1 3 4\n";
const BACK: &str = "f 3 2 1\nf 4 3 1\n";
const NORMALS: &str = "vn 0 0 1\n";
const FRONT_WITH_NORMALS: &str = "f 1//1 2//1 3//1\nf 1//1 3//1 4//1\n";

const FILE: &str = "obj\"><string name=\"filename\" value=\"lamp.obj\"/>";
const FLAT: &str =
    "obj\"><string name=\"filename\" value=\"lamp.obj\"/><boolean name=\"face_normals\" value=\"true\"/>";
const FLIPPED: &str =
    "obj\"><string name=\"filename\" value=\"lamp.obj\"/><boolean name=\"flip_normals\" value=\"true\"/>";
const FLAT_FLIPPED: &str = "obj\"><string name=\"filename\" value=\"lamp.obj\"/><boolean name=\"face_normals\" value=\"true\"/>\
    <boolean name=\"flip_normals\" value=\"true\"/>";
const MIRROR: &str = "<scale x=\"-1\"/>";

const LAMPS: &[Lamp] = &[
    Lamp { name: "rectangle", shape: "rectangle\">", before: "", mesh: "" },
    Lamp { name: "mirrored rectangle", shape: "rectangle\">", before: MIRROR, mesh: "" },
    Lamp { name: "own normals", shape: FILE, before: "", mesh: "{n}{fn}" },
    Lamp { name: "mirrored, own normals", shape: FILE, before: MIRROR, mesh: "{n}{fn}" },
    Lamp { name: "averaged normals", shape: FILE, before: "", mesh: "{f}" },
    Lamp { name: "averaged normals, flipped", shape: FLIPPED, before: "", mesh: "{b}" },
    Lamp { name: "flat", shape: FLAT, before: "", mesh: "{f}" },
    Lamp { name: "flat, flipped", shape: FLAT_FLIPPED, before: "", mesh: "{b}" },
    Lamp { name: "flat, mirrored", shape: FLAT, before: MIRROR, mesh: "{b}" },
    Lamp { name: "flat, mirrored, flipped", shape: FLAT_FLIPPED, before: MIRROR, mesh: "{f}" },
    Lamp { name: "flat, own normals", shape: FLAT, before: "", mesh: "{n}{fn}" },
];

fn text(v: Vec3) -> String {
    format!("{},{},{}", v.x, v.y, v.z)
}

/// A lamp at three times a direction that faces a small square at the origin, which faces it.
fn scene(lamp: &Lamp, direction: Vec3) -> Scene {
    let up = text(Frame::around(direction).s);
    let look =
        |from: Vec3, to: Vec3| format!("<lookat origin=\"{}\" target=\"{}\" up=\"{up}\"/>", text(from), text(to));
    let (near, far) = (direction * 0.5, direction * 3.0);
    let xml = format!(
        r#"<scene version="3.0.0"><integrator type="path"><integer name="max_depth" value="2"/></integrator>
        <sensor type="orthographic"><transform name="to_world"><scale value="0.001"/>{camera}</transform>
            <film type="hdrfilm"><integer name="width" value="16"/><integer name="height" value="16"/></film></sensor>
        <shape type="rectangle"><transform name="to_world"><scale value="0.01"/>{floor}</transform>
            <bsdf type="diffuse"><rgb name="reflectance" value="0.5"/></bsdf></shape>
        <shape type="{shape}<transform name="to_world">{before}{place}</transform>
            <emitter type="area"><rgb name="radiance" value="10"/></emitter></shape></scene>"#,
        camera = look(near, Vec3::ZERO),
        floor = look(Vec3::ZERO, direction),
        shape = lamp.shape,
        before = lamp.before,
        place = look(far, Vec3::ZERO),
    );
    let parts = [("{n}", NORMALS), ("{fn}", FRONT_WITH_NORMALS), ("{f}", FRONT), ("{b}", BACK)];
    let mesh = parts.iter().fold(lamp.mesh.to_owned(), |mesh, (name, part)| mesh.replace(name, part));
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("lamp.obj"), format!("{CORNERS}{mesh}")).unwrap();
    fs::write(folder.path().join("scene.xml"), xml).unwrap();
    mitsuba::load(&folder.path().join("scene.xml"), &mitsuba::Options::default()).unwrap()
}

/// Light that the small square reflects: the integral of L cos²/(π r²) over the lamp, times its reflectance.
fn expected() -> f32 {
    const STEPS: i32 = 200;
    let at = |i: i32| (2 * i + 1) as f32 / STEPS as f32 - 1.0;
    let cells = (0..STEPS * STEPS).map(|i| vec3(at(i % STEPS), at(i / STEPS), 3.0));
    let area = 4.0 / (STEPS * STEPS) as f32;
    let irradiance: f32 = cells.map(|p| 10.0 * area * (3.0 / p.length()).powi(2) / p.length_squared()).sum();
    0.5 / PI * irradiance
}

#[test]
fn lamps_light_alike_whichever_way_they_are_turned() {
    let expected = expected();
    for lamp in LAMPS {
        for i in (0..27).filter(|&i| i != 13) {
            let direction = vec3((i % 3 - 1) as f32, (i / 3 % 3 - 1) as f32, (i / 9 - 1) as f32).normalize();
            let all = pixels(&film(&scene(lamp, direction), 16, 1, Needs::default()));
            let mean = all.iter().map(|pixel| pixel[0]).sum::<f32>() / all.len() as f32;
            assert!((mean / expected - 1.0).abs() < 0.02, "{} at {direction}: {mean}, not {expected}", lamp.name);
        }
    }
}
