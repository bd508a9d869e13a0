//! The contract of every emitter of the table: points are sampled by the densities that are claimed, and light the same as
//! directions taken evenly. And many emitters at once.

use std::f32::consts::{PI, TAU};

use crate::common::{check_zero, film, scene, sensor};
use fluxion::film::{Layer, Needs};
use fluxion::internals::math::{Rgb, Vec2, Vec3, rng, vec2, vec3, warp};
use fluxion::scene::Scene;
use fluxion::scene::emitter::{Emitter, PLUGINS, Position};

/// Name of the plugin that a case is of, and its XML.
const CASES: &[(&str, &str)] = &[
    ("constant", r#"<emitter type="constant"/>"#),
    ("envmap", r#"<emitter type="envmap"><string name="filename" value="SCENES/assets/sky.exr"/></emitter>"#),
    (
        "envmap",
        r#"<emitter type="envmap"><string name="filename" value="SCENES/assets/sky.exr"/><boolean name="mis_compensation" value="false"/></emitter>"#,
    ),
    (
        "sunsky",
        r#"<emitter type="sunsky"><float name="sun_aperture" value="30"/><float name="turbidity" value="5"/><rgb name="albedo" value="0.1,0.5,0.9"/></emitter>"#,
    ),
    (
        "sunsky",
        r#"<emitter type="sunsky"><float name="sun_scale" value="0"/><vector name="sun_direction" value="1,0.2,0.1"/><transform name="to_world"><rotate x="1" y="1" angle="40"/></transform></emitter>"#,
    ),
    (
        "sky",
        r#"<emitter type="sky"><string name="convention" value="0.6"/><float name="stretch" value="1.5"/></emitter>"#,
    ),
    (
        "sky",
        r#"<emitter type="sky"><string name="convention" value="0.6"/><boolean name="extend" value="true"/></emitter>"#,
    ),
    (
        "sun",
        r#"<emitter type="sun"><string name="convention" value="0.6"/><float name="sun_radius_scale" value="120"/><vector name="sun_direction" value="1,1,0.3"/></emitter>"#,
    ),
    ("point", r#"<emitter type="point"/>"#),
    ("spot", r#"<emitter type="spot"/>"#),
    (
        "projector",
        r#"<emitter type="projector"><float name="fov" value="60"/><rgb name="irradiance" value="3,2,1"/></emitter>"#,
    ),
    ("directional", r#"<emitter type="directional"/>"#),
];

/// Every case, of which the emitters at infinity if `far`, else those of a single point.
fn each(far: bool, check: impl Fn(&str, &dyn Emitter)) {
    for (name, xml) in CASES {
        let scenes = crate::common::root().join("scenes").display().to_string();
        let body = format!("{}{}", sensor("0,0,4", 4, 4), xml.replace("SCENES", &scenes));
        let scene = scene(&body);
        let emitter = &*scene.emitters()[0];
        if emitter.is_environment() == far {
            check(name, emitter);
        }
    }
}

fn numbers(i: u64, k: u64) -> Vec2 {
    vec2(rng::unit(rng::combine(rng::mix(i), 2 * k)), rng::unit(rng::combine(rng::mix(i), 2 * k + 1)))
}

fn direction(position: Position) -> Vec3 {
    let Position::Infinity { direction } = position else { panic!("an environment is at infinity") };
    direction
}

#[test]
fn every_emitter_has_a_case() {
    for plugin in PLUGINS {
        assert!(CASES.iter().any(|(name, _)| *name == plugin.name), "{} has no case", plugin.name);
    }
}

/// Directions darker than the mean are left to materials, but none is left to them alone.
#[test]
fn compensated_environments_sample_what_is_bright_and_never_nothing() {
    let sky = crate::common::root().join("scenes/assets/sky.exr").display().to_string();
    let with = |compensated: bool| {
        scene(&format!(
            r#"{}<emitter type="envmap"><string name="filename" value="{sky}"/><boolean name="mis_compensation" value="{compensated}"/></emitter>"#,
            sensor("0,0,4", 4, 4)
        ))
    };
    let scenes = [with(true), with(false)];
    let mut ratios: Vec<(f32, f32)> = (0..2000)
        .map(|i| {
            let d = warp::sphere(numbers(i, 3));
            let [compensated, plain] = scenes.each_ref().map(|scene| {
                let emitter = &scene.emitters()[0];
                emitter.pdf(Vec3::ZERO, &emitter.environment_point(d))
            });
            assert!(plain > 0.0 && compensated > 0.1 * plain, "{d}: {compensated} {plain}");
            (plain, compensated / plain)
        })
        .collect();
    ratios.sort_by(|a, b| a.0.total_cmp(&b.0));
    assert!(ratios[0].1 < 0.6 && ratios[1999].1 > 1.2, "{:?} {:?}", ratios[0], ratios[1999]);
}

/// Pearson's test of sampled directions against the integrated density, over cells of the sphere.
#[test]
fn sampled_directions_follow_the_density() {
    const ROWS: usize = 12;
    const COLUMNS: usize = 24;
    const SAMPLES: u64 = 100_000;
    each(true, |name, emitter| {
        let mut counts = vec![0.0f64; ROWS * COLUMNS];
        for i in 0..SAMPLES {
            let Some(point) = emitter.sample(Vec3::ZERO, numbers(i, 0)) else { continue };
            let d = direction(point.position);
            let row = ((0.5 * (d.y + 1.0)) * ROWS as f32) as usize;
            let column = (d.z.atan2(d.x).rem_euclid(TAU) / TAU * COLUMNS as f32) as usize;
            counts[row.min(ROWS - 1) * COLUMNS + column.min(COLUMNS - 1)] += 1.0;
        }
        let fine = 100;
        let (mut statistic, mut cells) = (0.0f64, 0.0f64);
        for (cell, &count) in counts.iter().enumerate() {
            let mean = (0..fine * fine).map(|k| {
                let inside = vec2((k % fine) as f32 + 0.5, (k / fine) as f32 + 0.5) / fine as f32;
                let at = vec2((cell % COLUMNS) as f32, (cell / COLUMNS) as f32) + inside;
                let (phi, y) = (TAU * at.x / COLUMNS as f32, 2.0 * at.y / ROWS as f32 - 1.0);
                let r = (1.0 - y * y).max(0.0).sqrt();
                let point = emitter.environment_point(vec3(r * phi.cos(), y, r * phi.sin()));
                f64::from(emitter.pdf(Vec3::ZERO, &point)) / (fine * fine) as f64
            });
            let expected = mean.sum::<f64>() * f64::from(4.0 * PI) / (ROWS * COLUMNS) as f64 * SAMPLES as f64;
            if expected < 8.0 {
                assert!(count < 40.0, "{name}: {count} for {expected}");
                continue;
            }
            // The midpoint rule is allowed to be two percent off, at the rim of a disk.
            let excess = ((count - expected).abs() - 0.02 * expected).max(0.0);
            (statistic, cells) = (statistic + excess * excess / expected, cells + 1.0);
        }
        let limit = cells + 5.0 * (2.0 * cells).sqrt();
        assert!(statistic < limit, "{name}: chi-squared {statistic:.1} over {cells} cells");
    });
}

/// Irradiance from above by points of the emitter, and by directions taken evenly.
#[test]
fn emitters_light_as_the_directions_that_meet_them() {
    each(true, |name, emitter| {
        let n = Vec3::new(0.3, 0.8, 0.4).normalize();
        let mut sums = [Rgb::ZERO; 2];
        const SAMPLES: u64 = 400_000;
        for i in 0..SAMPLES {
            if let Some(point) = emitter.sample(Vec3::ZERO, numbers(i, 1)) {
                let d = direction(point.position);
                let pdf = emitter.pdf(Vec3::ZERO, &point);
                assert!(pdf > 0.0, "{name}: a sampled direction has no density");
                sums[0] += emitter.radiance(&point, -d) * (n.dot(d).max(0.0) / pdf);
            }
            let d = warp::sphere(numbers(i, 2));
            sums[1] += emitter.radiance(&emitter.environment_point(d), -d) * (n.dot(d).max(0.0) * 4.0 * PI);
        }
        let [sampled, even] = sums.map(|sum| sum / SAMPLES as f32);
        let apart = (sampled - even).length() / even.length();
        assert!(apart < 0.03, "{name}: {sampled} {even}");
    });
}

#[test]
fn a_projected_picture_is_as_bright_everywhere_on_a_plane_and_ends_at_its_rim() {
    each(false, |name, emitter| {
        let point = emitter.sample(Vec3::ZERO, Vec2::ZERO).unwrap();
        assert!(point.delta, "{name}");
        if name != "projector" {
            return;
        }
        let half = 30f32.to_radians().tan();
        for (x, y) in [(0.0, 0.0), (0.5, -0.5), (-0.5, 0.2)] {
            let at = vec3(x, y, 1.0);
            let cos = 1.0 / at.length();
            let irradiance = emitter.radiance(&point, at.normalize()) * (cos * point.solid_angle(at));
            assert!(irradiance.distance(PI * vec3(3.0, 2.0, 1.0)) < 1e-3, "{irradiance}");
        }
        for outside in [vec3(1.01 * half, 0.0, 1.0), vec3(0.0, -1.01 * half, 1.0), vec3(0.0, 0.0, -1.0)] {
            assert_eq!(emitter.radiance(&point, outside.normalize()), Rgb::ZERO);
        }
    });
}

/// The default sun and sky of both renderers: a renderer's own numbers for the zenith and for the sun's centre.
#[test]
fn skies_are_as_bright_as_those_of_the_renderers_they_come_from() {
    let at = |xml: &str, direction: Vec3| {
        let scene = scene(&format!("{}{xml}", sensor("0,0,4", 4, 4)));
        let emitter = &scene.emitters()[0];
        emitter.radiance(&emitter.environment_point(direction), -direction)
    };
    let old =
        |plugin: &str| format!("<emitter type=\"{plugin}\"><string name=\"convention\" value=\"0.6\"/></emitter>");
    for (name, found, expected) in [
        ("0.6 zenith", at(&old("sky"), Vec3::Y), vec3(0.023_169, 0.039_894, 0.080_756)),
        ("0.6 sun", at(&old("sun"), vec3(-0.691_757, 0.7203, 0.051_378)), vec3(19252.2, 15862.9, 12873.7)),
        ("3 zenith", at("<emitter type=\"sky\"/>", Vec3::Z), vec3(0.024_351, 0.042_308, 0.085_594)),
        ("3 sun", at("<emitter type=\"sun\"/>", vec3(0.051_378, 0.691_757, 0.7203)), vec3(21372.3, 17588.0, 13013.3)),
    ] {
        assert!((found / expected - Rgb::ONE).abs().max_element() < 5e-3, "{name}: {found} {expected}");
    }
}

/// A floor and a wall under a square lamp, in one piece or in tiles.
fn under_a_lamp(tiles: usize) -> Scene {
    let lamp = |i: usize| {
        let half = 1.0 / tiles as f32;
        let (x, z) = ((2 * (i % tiles) + 1) as f32 * half - 1.0, (2 * (i / tiles) + 1) as f32 * half - 1.0);
        format!(
            r#"<shape type="rectangle"><transform name="to_world"><scale value="{half}"/><rotate x="1" angle="90"/>
            <translate x="{x}" y="1" z="{z}"/></transform>
            <emitter type="area"><rgb name="radiance" value="3, 2, 1"/></emitter></shape>"#
        )
    };
    over_a_floor((0..tiles * tiles).map(lamp).collect())
}

/// The floor and the wall under a glowing cube, in one piece or of smaller ones, whose triangles are chosen one by one.
fn under_a_cube(parts: usize) -> Scene {
    let cube = |i: usize| {
        let half = 0.5 / parts as f32;
        let [x, y, z] = [i % parts, i / parts % parts, i / parts / parts].map(|k| (2 * k + 1) as f32 * half - 0.5);
        format!(
            r#"<shape type="cube"><transform name="to_world"><scale value="{half}"/><translate x="{x}" y="{y}" z="{z}"/>
            <translate y="0.8"/></transform><emitter type="area"><rgb name="radiance" value="3, 2, 1"/></emitter></shape>"#
        )
    };
    over_a_floor((0..parts.pow(3)).map(cube).collect())
}

fn over_a_floor(lamps: String) -> Scene {
    let floor = r#"<shape type="rectangle"><transform name="to_world"><scale value="3"/><rotate x="1" angle="-90"/>
        <translate y="-0.2"/></transform></shape>
        <shape type="rectangle"><transform name="to_world"><scale value="3"/><translate z="-1.5"/></transform></shape>"#;
    scene(&format!("{}{floor}{lamps}", sensor("0,0.6,5", 24, 24)))
}

#[test]
fn a_lamp_in_tiles_lights_as_one_in_a_piece_and_is_no_noisier() {
    let tiles = under_a_lamp(12);
    assert_eq!(tiles.emitters().len(), 144);
    let noise = light_alike(&under_a_lamp(1), &tiles);
    assert!(noise < 1.1, "{noise}");
}

#[test]
fn a_cube_of_smaller_ones_lights_as_one_in_a_piece() {
    light_alike(&under_a_cube(1), &under_a_cube(3));
}

/// Whether colours and differences of two scenes are the same but for noise; the second one's variance over the first one's.
fn light_alike(whole: &Scene, parts: &Scene) -> f64 {
    let needs = Needs::EDGES;
    let frames: Vec<_> = (0..16)
        .map(|run| [film(whole, 32, 2 * run, needs).develop(), film(parts, 32, 2 * run + 1, needs).develop()])
        .collect();
    for layer in [Layer::Color, Layer::Dx, Layer::Dy] {
        let apart = |[a, b]: &[fluxion::film::Frame; 2]| {
            let (a, b) = (&a.get(layer).unwrap().data, &b.get(layer).unwrap().data);
            a.iter().zip(b).map(|(a, b)| f64::from(a - b)).collect::<Vec<_>>()
        };
        check_zero(&format!("{layer:?}"), &frames.iter().map(apart).collect::<Vec<_>>());
    }
    let noise = |k: usize| -> f64 {
        let of = |frames: &[fluxion::film::Frame; 2]| {
            frames[k].get(Layer::ColorVariance).unwrap().data.iter().map(|&v| f64::from(v)).sum::<f64>()
        };
        frames.iter().map(of).sum()
    };
    noise(1) / noise(0)
}
