//! Scenes of any size anywhere, and light that meets the same surface again and again.

use fluxion::film::Needs;
use fluxion::internals::math::Vec3;
use fluxion::scene::Scene;

use crate::common::{film, scene};
use crate::wild::pixels;

fn mean(scene: &Scene, spp: u32) -> f64 {
    let all = pixels(&film(scene, spp, 1, Needs::default()));
    all.iter().map(|pixel| f64::from(pixel[0])).sum::<f64>() / all.len() as f64
}

/// A ball on a floor under a sky, as seen from above: `scale` times as large, and then moved by `shift`.
fn ball(scale: f64, shift: f64) -> String {
    let place = format!("<scale value=\"{scale}\"/><translate x=\"{shift}\"/>");
    format!(
        r#"<sensor type="perspective"><float name="fov" value="40"/>
            <float name="near_clip" value="0.001"/><float name="far_clip" value="100"/>
            <transform name="to_world"><lookat origin="0,0,5" target="0,0,0" up="0,1,0"/>{place}</transform>
            <film type="hdrfilm"><integer name="width" value="16"/><integer name="height" value="16"/></film></sensor>
        <shape type="sphere"><transform name="to_world">{place}</transform></shape>
        <shape type="rectangle"><transform name="to_world"><scale value="4"/><translate z="-1"/>{place}</transform></shape>
        <emitter type="constant"/>"#
    )
}

#[test]
fn scenes_look_the_same_at_any_size_and_place() {
    let expected = mean(&scene(&ball(1.0, 0.0)), 64);
    assert!((expected - 0.4707).abs() < 0.003, "{expected}");
    for scale in [1e-6, 1e-3, 1.0, 1e3, 1e6] {
        for shift in [0.0, 10.0, 1e3, 1e4, 1e5, 1e6] {
            let found = mean(&scene(&ball(scale, shift * scale)), 64);
            assert!(
                (found / expected - 1.0).abs() < 0.004,
                "scale {scale}, shift {shift} sizes: {found}, not {expected}"
            );
        }
    }
}

#[test]
fn lamps_meshes_and_instances_far_away_are_where_they_are_near() {
    let body = |x: &str| {
        format!(
            r#"<sensor type="thinlens"><float name="aperture_radius" value="0.05"/><float name="focus_distance" value="5"/>
                <transform name="to_world"><lookat origin="{x},2,5" target="{x},0,0" up="0,1,0"/></transform>
                <film type="hdrfilm"><integer name="width" value="16"/><integer name="height" value="16"/></film></sensor>
            <shape type="shapegroup" id="g"><shape type="cube"><transform name="to_world"><scale value="0.3"/></transform></shape></shape>
            <shape type="instance"><ref id="g"/><transform name="to_world"><translate x="{x}" y="0.4"/></transform></shape>
            <shape type="disk"><transform name="to_world"><rotate x="1" angle="-90"/><translate x="{x}"/></transform></shape>
            <shape type="cylinder"><point name="p0" x="{x}" y="0" z="-0.6"/><point name="p1" x="{x}" y="1" z="-0.6"/>
                <float name="radius" value="0.1"/></shape>
            <shape type="sphere"><point name="center" x="{x}" y="0.3" z="0.6"/><float name="radius" value="0.2"/></shape>
            <emitter type="point"><point name="position" x="{x}" y="2" z="0.5"/></emitter>
            <emitter type="spot"><transform name="to_world"><lookat origin="{x},3,1" target="{x},0,0" up="0,0,1"/></transform></emitter>"#
        )
    };
    let (near, far) = (mean(&scene(&body("0")), 64), mean(&scene(&body("262144")), 64));
    assert!(near > 0.003 && (far / near - 1.0).abs() < 0.01, "{far}, not {near}");
}

#[test]
fn only_scenes_far_from_their_origin_get_another_one() {
    assert_eq!(scene(&ball(1.0, 10.0)).origin().as_vec3(), Vec3::ZERO);
    let moved = scene(&ball(1.0, 1e4));
    assert!(moved.origin().as_vec3().distance(Vec3::X * 1e4) < 6.0, "{}", moved.origin());
    assert!(moved.bounds().sphere().0.length() < 6.0);
}

/// Doubled surfaces, of which public scenes have many, look right only where rays skip the second one.
#[test]
fn the_second_of_two_nearly_coincident_surfaces_is_skipped() {
    let floor = |z: f32| {
        format!(
            "<shape type=\"rectangle\"><transform name=\"to_world\"><scale value=\"3\"/><translate z=\"{z}\"/></transform></shape>"
        )
    };
    let under = |floors: String| {
        mean(&scene(&format!("{}{floors}<emitter type=\"constant\"/>", crate::common::sensor("0,0,5", 16, 16))), 16)
    };
    let (one, two) = (under(floor(0.0)), under(floor(0.0) + &floor(2e-5)));
    assert!((two / one - 1.0).abs() < 1e-3, "{two}, not {one}");
}

/// In a ball or a round rod of glass the angle stays the same at every reflection: light that is reflected totally never gets out.
#[test]
fn light_that_total_reflection_keeps_in_stays_in() {
    let view = |shape: &str, origin: &str, target: &str| {
        format!(
            r#"<sensor type="perspective"><float name="fov" value="20"/>
            <transform name="to_world"><lookat origin="{origin}" target="{target}" up="0,1,0"/></transform>
            <film type="hdrfilm"><integer name="width" value="8"/><integer name="height" value="8"/></film></sensor>
            {shape}<emitter type="constant"/>"#
        )
    };
    let glass = "<bsdf type=\"dielectric\"/>";
    let ball = format!("<shape type=\"sphere\">{glass}</shape>");
    let small = format!("<shape type=\"sphere\"><float name=\"radius\" value=\"0.1\"/>{glass}</shape>");
    let flipped = "<shape type=\"sphere\"><boolean name=\"flip_normals\" value=\"true\"/><bsdf type=\"dielectric\">\
        <float name=\"int_ior\" value=\"1\"/><float name=\"ext_ior\" value=\"1.5046\"/></bsdf></shape>";
    let instance = format!(
        "<shape type=\"shapegroup\" id=\"g\">{ball}</shape><shape type=\"instance\"><ref id=\"g\"/>\
        <transform name=\"to_world\"><scale value=\"2\"/></transform></shape>"
    );
    let rod = format!(
        "<shape type=\"cylinder\"><point name=\"p0\" x=\"0\" y=\"-1e4\" z=\"0\"/>\
        <point name=\"p1\" x=\"0\" y=\"1e4\" z=\"0\"/>{glass}</shape>"
    );
    for (name, shape, origin, target) in [
        ("ball", ball.as_str(), "0.7,0,0", "0.7,0,-1"),
        ("small ball", &small, "0.07,0,0", "0.07,0,-1"),
        ("flipped ball", flipped, "0.7,0,0", "0.7,0,-1"),
        ("instance", &instance, "1.4,0,0", "1.4,0,-1"),
        ("rod", &rod, "0.75,0,0", "0.75,0,-1"),
    ] {
        let found = mean(&scene(&view(shape, origin, target)), 64);
        assert!(found < 0.05, "{name}: {found}");
    }
    // Through the middle light gets out.
    let found = mean(&scene(&view(&ball, "0,0,0", "0,0,-1")), 64);
    assert!((found / (1.5046 * 1.5046) - 1.0).abs() < 0.02, "{found}");
}
