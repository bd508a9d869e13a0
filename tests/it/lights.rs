//! Many emitters.

use crate::common::{check_zero, film, scene, sensor};
use fluxion::film::{Layer, Needs};
use fluxion::scene::Scene;

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
    let lamps: String = (0..tiles * tiles).map(lamp).collect();
    let floor = r#"<shape type="rectangle"><transform name="to_world"><scale value="3"/><rotate x="1" angle="-90"/>
        <translate y="-0.2"/></transform></shape>
        <shape type="rectangle"><transform name="to_world"><scale value="3"/><translate z="-1.5"/></transform></shape>"#;
    scene(&format!("{}{floor}{lamps}", sensor("0,0.6,5", 24, 24)))
}

#[test]
fn a_lamp_in_tiles_lights_as_one_in_a_piece_and_is_no_noisier() {
    let (whole, tiles) = (under_a_lamp(1), under_a_lamp(12));
    assert_eq!(tiles.emitters().len(), 144);
    let needs = Needs::EDGES;
    let frames: Vec<_> = (0..16)
        .map(|run| [film(&whole, 32, 2 * run, needs).develop(), film(&tiles, 32, 2 * run + 1, needs).develop()])
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
    assert!(noise(1) < 1.1 * noise(0), "{} instead of {}", noise(1), noise(0));
}
