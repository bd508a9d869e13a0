//! Round curves; expected points, normals and texture coordinates are those of Mitsuba 3.9.1 for the same file.

use std::fs;

use fluxion::Result;
use fluxion::internals::math::{Vec3, vec3};
use fluxion::mitsuba;
use fluxion::scene::packet::{Rays, Surfaces};
use fluxion::scene::{Purpose, Ray, Scene};

use crate::common::sensor;

/// A straight curve of equal radii, and one that gets thicker.
const POINTS: &str = "0 -3 0 0.2\n0 -1 0 0.2\n0 1 0 0.2\n0 3 0 0.2\n\n\
    3 -3 0 0.1\n3 -1 0 0.2\n3 1 0 0.3\n3 3 0 0.4\n3 5 0 0.5\n";

fn try_scene(plugin: &str, points: &str, more: &str) -> Result<Scene> {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("curves.txt"), points).unwrap();
    let shape = format!("<shape type=\"{plugin}\"><string name=\"filename\" value=\"curves.txt\"/>{more}</shape>");
    let text = format!("<scene version=\"3.0.0\">{}{shape}</scene>", sensor("0,0,20", 8, 8));
    fs::write(folder.path().join("scene.xml"), text).unwrap();
    mitsuba::load(&folder.path().join("scene.xml"), &mitsuba::Options::default())
}

fn scene(plugin: &str, more: &str) -> Scene {
    try_scene(plugin, POINTS, more).unwrap()
}

/// A ray from in front.
fn ray(x: f32, y: f32) -> Ray {
    Ray::new(vec3(x, y, 10.0), Vec3::NEG_Z)
}

/// Column and row of a ray, with z, normal and texture coordinates where it meets a curve.
type Row = ([f32; 2], f32, [f32; 3], [f32; 2]);

fn check(scene: &Scene, rows: &[Row], what: &str) {
    for &([x, y], z, n, uv) in rows {
        let surface = scene.intersect(ray(x, y)).unwrap_or_else(|| panic!("{what}: nothing at {x},{y}"));
        assert!(surface.p.distance(vec3(x, y, z)) < 1e-3, "{what} at {x},{y}: {}", surface.p);
        assert!(surface.n.distance(Vec3::from_array(n)) < 2e-3, "{what} at {x},{y}: {}", surface.n);
        let apart = surface.at.uv.distance(uv.into());
        assert!(apart < 2e-3, "{what} at {x},{y}: {}", surface.at.uv);
        // Packets meet the same.
        let (mut rays, mut surfaces) = (Rays::NONE, Surfaces::default());
        (0..16).for_each(|lane| rays.set(lane, ray(x, y)));
        let hit = scene.intersect_packet(
            &rays,
            fluxion::internals::math::lanes::Mask::first(16),
            Purpose::Camera,
            &mut surfaces,
        );
        assert!(hit.get(5) && surfaces.p.get(5).distance(surface.p) < 1e-3, "{what} at {x},{y}");
    }
}

#[test]
fn curves_are_those_of_mitsuba() {
    let spline = scene("bsplinecurve", "");
    check(
        &spline,
        &[
            ([0.0, 0.0], 0.2, [0.0, 0.0, 1.0], [0.25, 0.1667]),
            ([0.1, 0.0], 0.1732, [0.5, 0.0, 0.866], [0.3333, 0.1667]),
            ([0.1, 0.9], 0.1732, [0.5, 0.0, 0.866], [0.3333, 0.3167]),
            ([3.0, 0.3], 0.265, [0.0, -0.0499, 0.9988], [0.25, 0.55]),
            ([3.1, 2.5], 0.3614, [0.2663, -0.0499, 0.9626], [0.293, 0.9167]),
        ],
        "bsplinecurve",
    );
    let linear = scene("linearcurve", "");
    check(
        &linear,
        &[
            ([0.0, 0.0], 0.2, [0.0, 0.0, 1.0], [0.25, 0.2143]),
            ([0.1, -2.5], 0.1732, [0.5, 0.0, 0.866], [0.3333, 0.0357]),
            ([3.0, 0.3], 0.2653, [0.0, -0.05, 0.9987], [0.25, 0.6652]),
            ([3.1, 2.5], 0.3619, [0.266, -0.05, 0.9627], [0.2929, 0.8228]),
        ],
        "linearcurve",
    );
    for (curves, what) in [(&spline, "bsplinecurve"), (&linear, "linearcurve")] {
        // No caps, and nothing inside.
        for (origin, direction) in
            [(Vec3::ZERO, Vec3::Z), (vec3(0.0, -10.0, 0.0), Vec3::Y), (vec3(0.05, -10.0, 0.02), Vec3::Y)]
        {
            assert!(curves.intersect(Ray::new(origin, direction)).is_none(), "{what}: from {origin} along {direction}");
        }
    }
    assert!(spline.intersect(ray(0.1, -2.5)).is_none(), "a B-spline ends before its first point");
    // Radii are not scaled.
    let scaled = scene("bsplinecurve", "<transform name=\"to_world\"><scale value=\"2\"/></transform>");
    check(&scaled, &[([6.1, 0.3], 0.2373, [0.3882, -0.025, 0.9212], [0.3135, 0.525])], "scaled");
}

#[test]
fn curves_that_cannot_be_read_are_errors_with_their_line() {
    for (plugin, points, more, expected) in [
        ("bsplinecurve", "0 0 0 1\n1 0 0 1\n2 0 0 1\n", "", "a curve of 3 control points; it needs 4"),
        ("linearcurve", "0 0 0 1\n\n1 0 0 1\n2 0 0 1\n", "", "curves.txt:2: a curve of 1 control points"),
        ("linearcurve", "0 0 0\n", "", "curves.txt:1: a control point has x, y, z and a radius, not 3 numbers"),
        ("linearcurve", "0 0 0 1\n0 0 1 -1\n", "", "curves.txt:2: a radius of -1"),
        ("linearcurve", "0 0 0 x\n", "", "curves.txt:1: `x` is not a finite number"),
        ("linearcurve", POINTS, "<emitter type=\"area\"/>", "an emitter on curves"),
    ] {
        let message = try_scene(plugin, points, more).err().unwrap().to_string();
        assert!(message.contains(expected), "{message}");
    }
}
