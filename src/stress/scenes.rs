//! Scenes at the ends of what numbers can hold, with closed answers.

use std::f32::consts::PI;
use std::fmt::Write;

use super::probe::{Probe, area_emitter, camera, grey, sky, square};
use super::{Case, Checks};
use crate::error::Result;

pub const CASES: &[Case] = &[
    Case { name: "scenes/scale", summary: "a lit floor in units from 1e-5 to 1e7", run: scale },
    Case { name: "scenes/far", summary: "the same far from the origin", run: far },
    Case {
        name: "scenes/large",
        summary: "the same on floors up to a million times as wide as the lamp is high",
        run: large,
    },
    Case { name: "scenes/unequal", summary: "emitters of 1e-6 and 1e9, each in its own room", run: unequal },
    Case { name: "scenes/slit", summary: "a point of light behind a slit", run: slit },
    Case { name: "scenes/grazing", summary: "light along a floor, up to 1e-4 from its plane", run: grazing },
    Case {
        name: "scenes/threshold",
        summary: "metals about as smooth as those that shifts take for mirrors",
        run: threshold,
    },
    Case { name: "scenes/coincident", summary: "surfaces in the same place", run: coincident },
    Case { name: "scenes/slivers", summary: "a floor of triangles up to 20000 times as long as wide", run: slivers },
    Case { name: "scenes/overlapping", summary: "glass in glass, overlapping", run: overlapping },
    Case { name: "scenes/inside", summary: "a camera inside glass", run: inside },
    Case { name: "scenes/million", summary: "a million emitters instead of one", run: million },
    Case { name: "scenes/depth", summary: "paths of one edge, and of ten thousand", run: depth },
    Case { name: "scenes/corridor", summary: "light after ten mirrors, and after ten bounces", run: corridor },
    Case { name: "scenes/mirrors", summary: "a room of emissive mirrors", run: mirrors },
];

/// The irradiance that a small emitter of radiance one, an area of `area` at distance `d` straight above, makes.
fn below(area: f64, d: f64) -> f64 {
    area / (d * d)
}

/// A floor of reflectance 0.5 under a small square light of radiance one, all of it `unit` times as
/// large and around `at`; the floor is `width` wide.
/// The camera sees so little of the floor that it is as bright as its middle.
fn lit_floor(unit: f32, at: f32, width: f32) -> Result<(Probe, f64)> {
    let place = |y: f32| [at, at + unit * y, at];
    let point = |p: [f32; 3]| format!("{},{},{}", p[0], p[1], p[2]);
    let eye = [at, at + unit * 1.0, at + unit * 1.0];
    let elements = [
        camera(&point(eye), &point(place(0.0)), 0.5),
        square(place(0.0), [0.0, 1.0, 0.0], width * unit, &grey(0.5)),
        square(place(2.0), [0.0, -1.0, 0.0], 0.2 * unit, &area_emitter(1.0)),
    ];
    // Closed form of a square above a point, to second order in its size.
    let exact = below(0.04, 2.0) * (1.0 - 4.0 / 6.0 * 0.02 / 4.0 * 2.0) * 0.5 / f64::from(PI);
    Ok((Probe::new(&elements, 2, 64)?, exact))
}

fn scale(checks: &mut Checks) -> Result<()> {
    for unit in [1e-5, 1e-3, 1.0, 1e4, 1e7] {
        let (probe, exact) = lit_floor(unit, 0.0, 4.0)?;
        probe.check(checks, &format!("units of {unit:.0e}"), exact, 0.02)?;
    }
    Ok(())
}

fn far(checks: &mut Checks) -> Result<()> {
    for at in [1e2, 1e3] {
        let (probe, exact) = lit_floor(1.0, at, 4.0)?;
        probe.check(checks, &format!("at {at:.0e}"), exact, 0.02)?;
    }
    Ok(())
}

fn large(checks: &mut Checks) -> Result<()> {
    for width in [1e2, 1e3, 1e4, 1e5, 1e6] {
        let (probe, exact) = lit_floor(1.0, 0.0, width)?;
        probe.check(checks, &format!("{width:.0e} wide"), exact, 0.02)?;
    }
    Ok(())
}

fn unequal(checks: &mut Checks) -> Result<()> {
    // Two floors with a wall between them and a lamp above each.
    for (name, side) in [("the dim room", -1.0f32), ("the bright room", 1.0)] {
        let (dim, bright) = (area_emitter(1e-6), area_emitter(1e9));
        let elements = [
            camera(&format!("{},1,1", 5.0 * side), &format!("{},0,0", 5.0 * side), 0.5),
            square([0.0, 0.0, 0.0], [0.0, 1.0, 0.0], 40.0, &grey(0.5)),
            square([0.0, 0.0, 0.0], [1.0, 0.0, 0.0], 100.0, &grey(0.0)),
            square([-5.0, 2.0, 0.0], [0.0, -1.0, 0.0], 0.2, &dim),
            square([5.0, 2.0, 0.0], [0.0, -1.0, 0.0], 0.2, &bright),
        ];
        let radiance = if side < 0.0 { 1e-6 } else { 1e9 };
        let exact = radiance * below(0.04, 2.0) * 0.5 / f64::from(PI);
        Probe::new(&elements, 2, 64)?.check(checks, name, exact, 0.03)?;
    }
    Ok(())
}

fn slit(checks: &mut Checks) -> Result<()> {
    // A slit of width w at height 1 under a point at height 2 throws a strip of width 2 w on the floor.
    for width in [1e-1f32, 1e-2, 1e-3] {
        let point = r#"<emitter type="point"><point name="position" value="0,2,0"/><rgb name="intensity" value="100"/></emitter>"#;
        let half = |x: f32| {
            format!(
                r#"<shape type="rectangle"><transform name="to_world"><scale x="5" y="10"/><rotate x="1" angle="-90"/><translate x="{x}" y="1"/></transform>{}</shape>"#,
                grey(0.0)
            )
        };
        let elements = [
            // A thousandth of a radian at a distance of 0.5: from between the wall and the floor.
            camera("0,0.5,0.0001", "0,0,0", 2.0),
            square([0.0, 0.0, 0.0], [0.0, 1.0, 0.0], 10.0, &grey(0.5)),
            half(5.0 + 0.5 * width),
            half(-5.0 - 0.5 * width),
            point.to_owned(),
        ];
        // The strip across the field of view, which is `view` wide; all of it if the strip is wider.
        let view = 2.0 * 0.5 * f64::from((1.0f32).to_radians()).tan();
        let share = (2.0 * f64::from(width) / view).min(1.0);
        let exact = share * 100.0 / 4.0 * 0.5 / f64::from(PI);
        // Positions on the film are spread evenly, but only so well across a strip of a few samples' width.
        Probe::new(&elements, 2, 256)?.check(checks, &format!("width {width:.0e}"), exact, 0.03)?;
    }
    Ok(())
}

fn grazing(checks: &mut Checks) -> Result<()> {
    for angle in [1e-1f32, 1e-2, 1e-3, 1e-4] {
        let sun = format!(
            r#"<emitter type="directional"><vector name="direction" value="{},{},0"/><rgb name="irradiance" value="1000"/></emitter>"#,
            angle.cos(),
            -angle.sin()
        );
        let elements = [camera("0,1,1", "0,0,0", 10.0), square([0.0; 3], [0.0, 1.0, 0.0], 10.0, &grey(0.5)), sun];
        let exact = 1000.0 * f64::from(angle).sin() * 0.5 / f64::from(PI);
        Probe::new(&elements, 2, 16)?.check(checks, &format!("angle {angle:.0e}"), exact, 0.01)?;
    }
    Ok(())
}

fn threshold(checks: &mut Checks) -> Result<()> {
    // A metal floor that mirrors a glowing wall: half of the image is bright, the other dark.
    for alpha in ["0", "1e-4", "9e-4", "1e-3", "1.1e-3", "1e-2"] {
        let metal = format!(
            r#"<bsdf type="roughconductor"><string name="distribution" value="ggx"/><float name="alpha" value="{alpha}"/><string name="material" value="none"/></bsdf>"#
        );
        let elements = [
            camera("0,2,2", "0,0,0", 20.0),
            square([0.0; 3], [0.0, 1.0, 0.0], 10.0, &metal),
            // Its mirror image begins at the middle of the view and is wider than it.
            square([10.0, 10.0, -10.0], [0.0, 0.0, 1.0], 20.0, &area_emitter(1.0)),
        ];
        Probe::new(&elements, 4, 64)?.check(checks, &format!("roughness {alpha}"), 0.5, 0.02)?;
    }
    Ok(())
}

fn coincident(checks: &mut Checks) -> Result<()> {
    let floor = |inside: &str| square([0.0; 3], [0.0, 1.0, 0.0], 10.0, inside);
    let seen = camera("0,1,1", "0,0,0", 20.0);
    let white = grey(1.0);
    Probe::new(&[seen.clone(), sky(1.0), floor(&white), floor(&white)], 50, 64)?.check(
        checks,
        "white on white",
        1.0,
        0.01,
    )?;
    let lamp = format!("{}{}", white, area_emitter(1.0));
    // Whichever lies on top, the light is at least that of one.
    Probe::new(&[seen.clone(), floor(&lamp), floor(&lamp)], 1, 16)?.check(checks, "lamp on lamp", 1.0, 0.01)?;
    let glass = r#"<bsdf type="thindielectric"/>"#;
    Probe::new(&[seen, sky(1.0), floor(glass), floor(glass)], 100, 64)?.check(checks, "glass on glass", 1.0, 0.01)
}

fn slivers(checks: &mut Checks) -> Result<()> {
    // A fan of triangles around a point.
    for parts in [1000usize, 20_000] {
        let mut ply = format!(
            "ply\nformat ascii 1.0\nelement vertex {}\nproperty float x\nproperty float y\nproperty float z\n\
             element face {parts}\nproperty list uchar int vertex_indices\nend_header\n",
            parts + 2
        );
        ply.push_str("0 0 -5\n");
        for i in 0..=parts {
            // Writing to a string does not fail.
            let _ = writeln!(ply, "{} 0 5", -5.0 + 10.0 * i as f64 / parts as f64);
        }
        (0..parts).for_each(|i| {
            let _ = writeln!(ply, "3 0 {} {}", i + 1, i + 2);
        });
        let path = std::env::temp_dir().join(format!("fluxion-slivers-{}.ply", std::process::id()));
        crate::files::write(&path, ply)?;
        let fan =
            format!(r#"<shape type="ply"><string name="filename" value="{}"/>{}</shape>"#, path.display(), grey(1.0));
        let probe = Probe::new(&[camera("0,2,2.2", "0,0,2", 10.0), sky(1.0), fan], 50, 64);
        std::fs::remove_file(&path).map_err(|error| crate::error::Error::io(&path, error))?;
        probe?.check(checks, &format!("{parts} slivers"), 1.0, 0.01)?;
    }
    Ok(())
}

fn ball(x: f32, radius: f32, material: &str) -> String {
    format!(
        r#"<shape type="sphere"><point name="center" value="{x},0,0"/><float name="radius" value="{radius}"/>{material}</shape>"#
    )
}

/// For balls that are seen from inside.
const FLIPPED: &str = r#"<boolean name="flip_normals" value="true"/>"#;

const GLASS: &str =
    r#"<bsdf type="dielectric"><float name="int_ior" value="1.5"/><float name="ext_ior" value="1"/></bsdf>"#;

fn overlapping(checks: &mut Checks) -> Result<()> {
    let balls = [ball(-0.5, 1.0, GLASS), ball(0.5, 1.0, GLASS), ball(0.0, 0.3, GLASS)];
    let [a, b, c] = balls;
    Probe::new(&[camera("0,0,4", "0,0,0", 20.0), sky(1.0), a, b, c], 10_000, 64)?.check(
        checks,
        "three balls",
        1.0,
        0.02,
    )
}

fn inside(checks: &mut Checks) -> Result<()> {
    // Radiance is larger in glass by the square of its index; from the middle nothing is totally reflected.
    let probe = Probe::new(&[camera("0,0,0", "0,0,1", 60.0), sky(1.0), ball(0.0, 1.0, GLASS)], 1000, 256)?;
    probe.check(checks, "smooth glass", 2.25, 0.01)
}

fn million(checks: &mut Checks) -> Result<()> {
    let floor = square([0.0; 3], [0.0, 1.0, 0.0], 20.0, &grey(0.5));
    let view = camera("0,1,2", "0,0,0", 10.0);
    let one = Probe::new(
        &[view.clone(), floor.clone(), square([0.0, 2.0, 0.0], [0.0, -1.0, 0.0], 2.0, &area_emitter(1.0))],
        2,
        64,
    )?;
    let means = one.means();
    let expected = means.iter().sum::<f64>() / means.len() as f64;
    for side in [100usize, 1000] {
        let mut tiles = String::new();
        for i in 0..side * side {
            let at = |k: usize| (2 * k + 1) as f64 / side as f64 - 1.0;
            let (x, z, size) = (at(i % side), at(i / side), 1.0 / side as f64);
            let _ = write!(
                tiles,
                r#"<shape type="rectangle"><transform name="to_world"><scale value="{size}"/><rotate x="1" angle="90"/><translate x="{x}" y="2" z="{z}"/></transform><emitter type="area"/></shape>"#
            );
        }
        Probe::new(&[view.clone(), floor.clone(), tiles], 2, 64)?.check(
            checks,
            &format!("{} emitters", side * side),
            expected,
            0.02,
        )?;
    }
    Ok(())
}

/// The inside of a cube of side two whose walls area_emitter with one and reflect.
fn cube(material: &str) -> String {
    let walls =
        [[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, 1.0], [0.0, 0.0, -1.0]];
    let inside = format!("{material}{}", area_emitter(1.0));
    walls.iter().map(|wall| square(wall.map(|x: f32| -x), *wall, 2.0, &inside)).collect()
}

fn depth(checks: &mut Checks) -> Result<()> {
    let view = camera("0,0,0", "0.3,0.2,1", 60.0);
    Probe::new(&[view.clone(), cube(&grey(0.9))], 1, 16)?.check(checks, "one edge", 1.0, 1e-5)?;
    Probe::new(&[view.clone(), cube(&grey(0.9))], 2, 64)?.check(checks, "two edges", 1.9, 0.01)?;
    // Rooms in which light is reflected a hundred times on average: one without edges, and one whose walls meet. Rays
    // start a little off their surfaces, which next to an edge is beyond the other wall.
    let inside = format!("{}{}", grey(0.99), area_emitter(1.0));
    Probe::new(&[view.clone(), ball(0.0, 1.0, &format!("{FLIPPED}{inside}"))], 10_000, 16)?.check(
        checks,
        "ten thousand edges",
        100.0,
        0.02,
    )?;
    let means = Probe::new(&[view, cube(&grey(0.99))], 10_000, 64)?.means();
    let mean = means.iter().sum::<f64>() / means.len() as f64;
    // The sum of a geometric series whose ratio is 0.99 less the loss.
    checks.add("a room with edges", "light lost per reflection", 0.99 - (1.0 - 1.0 / mean), 1e-3);
    Ok(())
}

fn mirrors(checks: &mut Checks) -> Result<()> {
    let mirror = |reflectance: &str| {
        format!(
            r#"<bsdf type="conductor"><string name="material" value="none"/><rgb name="specular_reflectance" value="{reflectance}"/></bsdf>"#
        )
    };
    let view = camera("0,0,0", "0.3,0.2,1", 60.0);
    Probe::new(&[view.clone(), cube(&mirror("0.5"))], 1000, 64)?.check(checks, "reflectance 0.5", 2.0, 0.01)?;
    Probe::new(&[view, cube(&mirror("0.9"))], 10_000, 64)?.check(checks, "reflectance 0.9", 10.0, 0.02)
}

fn corridor(checks: &mut Checks) -> Result<()> {
    // A ray that zigzags up between two mirrors and meets the lamp after ten reflections.
    let mirror = r#"<bsdf type="conductor"><string name="material" value="none"/><rgb name="specular_reflectance" value="0.8"/></bsdf>"#;
    let elements = [
        camera("0,0,0", "1,1,0", 1.0),
        square([1.0, 0.0, 0.0], [-1.0, 0.0, 0.0], 39.0, mirror),
        square([-1.0, 0.0, 0.0], [1.0, 0.0, 0.0], 39.0, mirror),
        square([0.0, 20.0, 0.0], [0.0, -1.0, 0.0], 10.0, &area_emitter(1.0)),
    ];
    // Heights of 1, 3, ... 19 after ten reflections. Russian roulette leaves noise of 0.4 % in the mean of six renders.
    Probe::new(&elements, 20, 256)?.check(checks, "mirrors", 0.8f64.powi(10), 0.01)?;
    // A tower with ten floors of half its width each: there is no closed answer, but what arrives scales with the lamp.
    let tower = |radiance: f32| {
        let mut parts = vec![camera("0,0.5,0", "0.3,0,0.4", 40.0)];
        for floor in 0..10 {
            // Each floor fills one half of the tower, the next one the other.
            let (x, y) = (if floor % 2 == 0 { 0.5 } else { -0.5 }, floor as f32);
            parts.push(format!(
                r#"<shape type="rectangle"><transform name="to_world"><scale x="0.5" y="1"/><rotate x="1" angle="-90"/><translate x="{x}" y="{y}"/></transform>{}</shape>"#,
                grey(0.9)
            ));
        }
        for wall in [[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, 0.0, -1.0]] {
            parts.push(square(wall.map(|x: f32| -x), wall, 24.0, &grey(0.9)));
        }
        parts.push(square([0.0, -0.5, 0.0], [0.0, 1.0, 0.0], 2.0, &grey(0.9)));
        parts.push(square([0.0, 11.0, 0.0], [0.0, -1.0, 0.0], 2.0, &area_emitter(radiance)));
        Probe::new(&parts, 100, 64)
    };
    let means = tower(1.0)?.means();
    let one = means.iter().sum::<f64>() / means.len() as f64;
    tower(1e6)?.check(checks, "tower", 1e6 * one, 0.02)
}
