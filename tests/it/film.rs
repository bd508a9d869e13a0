//! Films and files: threads do not matter, nothing is lost on disk, an independent reader sees the same.

use crate::common::{bundled, film, root, sensor};
use fluxion::film::{Frame, Layer, Needs, Recorded, exr as layers};
use fluxion::image::Image;
use fluxion::internals::math::Rgb;
use fluxion::internals::plan::Plan;
use fluxion::mitsuba;

fn on_threads(threads: usize) -> fluxion::film::Film {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
    pool.install(|| film(&bundled("glossy-metal", (37, 21)), 10, 3, Needs::ALL))
}

#[test]
fn one_thread_and_two_give_the_same_bits() {
    assert!(on_threads(1) == on_threads(2));
}

#[test]
fn every_layer_survives_a_file_bit_for_bit() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("layers.exr");
    let mut frame = film(&bundled("glossy-metal", (19, 23)), 9, 3, Needs::ALL).develop();
    frame.provenance.seed = "3".into();
    layers::save(&path, &frame).unwrap();
    let back = layers::load(&path).unwrap();
    // Edges were sampled as often as colours.
    assert_eq!(back.present().count(), Layer::COUNT - 1);
    assert!(back == frame);
}

/// The `exr` crate knows nothing of OpenImageIO.
#[test]
fn an_independent_reader_finds_the_channels_by_name() {
    use exr::prelude::*;
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("layers.exr");
    let frame = film(&bundled("unit/diffuse", (8, 6)), 4, 3, Needs::ALL).develop();
    layers::save(&path, &frame).unwrap();
    let image = read_first_flat_layer_from_file(&path).unwrap();
    assert_eq!(image.layer_data.size, Vec2(8, 6));
    for (layer, values) in frame.present() {
        for (c, name) in layer.channel_names().iter().enumerate() {
            let channel = image.layer_data.channel_data.list.iter().find(|channel| channel.name.to_string() == *name);
            let FlatSamples::F32(samples) = &channel.unwrap_or_else(|| panic!("no {name}")).sample_data else {
                panic!("{name} is not stored in full")
            };
            let expected: Vec<_> = values.data.iter().skip(c).step_by(values.channels).copied().collect();
            assert_eq!(samples, &expected, "{name}");
        }
    }
}

/// A floor, and a wall at `x` beside the point that the camera looks at.
fn corner(x: f32) -> fluxion::scene::Scene {
    let sensor = sensor("3,4,0", 4, 3).replace("\"40\"", "\"0.01\"");
    crate::common::scene(&format!(
        r#"{sensor}
        <emitter type="constant"/>
        <shape type="rectangle"><transform name="to_world">
            <rotate x="1" angle="-90"/><scale value="10"/></transform></shape>
        <shape type="rectangle"><transform name="to_world">
            <rotate y="1" angle="90"/><scale value="10"/><translate x="{x}"/></transform></shape>"#
    ))
}

#[test]
fn half_of_the_directions_are_open_beside_a_wall_and_all_of_them_in_the_open() {
    let needs = Needs::NONE.with(Recorded::Features).with(Recorded::Occlusion).with(Recorded::Position);
    for (x, expected) in [(-0.02, 0.5), (-9.0, 1.0)] {
        let frame = film(&corner(x), 1024, 1, needs).develop();
        let open = frame.get(Layer::Occlusion).unwrap();
        let mean = open.data.iter().sum::<f32>() / open.data.len() as f32;
        assert!((mean - expected).abs() < 0.01, "{mean} instead of {expected}");
        // The camera looks at the origin, from five units away; rays start a little before it.
        assert!(frame.get(Layer::Position).unwrap().data.iter().all(|value| value.abs() < 0.01));
        assert!(frame.get(Layer::Depth).unwrap().data.iter().all(|depth| (depth - 5.0).abs() < 0.02));
    }
}

#[test]
fn what_is_left_out_changes_no_bit_of_what_is_not() {
    let names = ["cornell-box", "unit/rough-plastic", "unit/dielectric", "unit/bump", "unit/environment", "unit/lens"];
    for name in names.into_iter().chain(["unit/instances", "unit/mask", "unit/sphere-light"]) {
        let scene = bundled(name, (24, 18));
        let (paths, edges) = (Needs::default(), Needs::EDGES);
        let planned = [paths, edges].map(|needs| film(&scene, 9, 3, needs).develop());
        let options = mitsuba::Options { size: Some((24, 18)), fast_paths: false, ..mitsuba::Options::default() };
        let general = mitsuba::load(&root().join("scenes").join(name).join("scene.xml"), &options).unwrap();
        let all = film(&general, 9, 3, Plan::all(&general).needs).develop();
        for planned in planned {
            for layer in Layer::all().filter(|&layer| planned.get(layer).is_some()) {
                assert_eq!(planned.get(layer), all.get(layer), "{name} {layer:?}");
            }
        }
    }
}

#[test]
fn the_plan_says_what_a_scene_can_do_without() {
    let computed = |scene: &str, name: &str| {
        let plan = Plan::new(&bundled(scene, (8, 6)), Needs::EDGES, Needs::default());
        plan.items.iter().find(|item| item.name == name).unwrap().computed
    };
    for (what, without, with) in [
        ("materials", "unit/diffuse", "unit/thin-pane"),
        ("half-vectors", "unit/diffuse", "unit/dielectric"),
        ("derivatives", "unit/diffuse", "unit/bump"),
        ("environment", "unit/diffuse", "unit/environment"),
        ("offset-rays", "unit/diffuse", "unit/lens"),
        ("emitters", "cornell-box", "unit/sphere-light"),
        ("light-tree", "unit/sphere-light", "night-street"),
    ] {
        assert_eq!((computed(without, what), computed(with, what)), (false, true), "{what}");
    }
}

/// A luminaire in front of nothing, seen through paths of at most `max_depth` edges: the mean of directly seen light.
fn seen_light(max_depth: u32, hide: bool) -> f32 {
    let scene = crate::common::scene(&format!(
        r#"<integrator type="path"><integer name="max_depth" value="{max_depth}"/>
        <boolean name="hide_emitters" value="{hide}"/></integrator>{}
        <shape type="sphere"><float name="radius" value="0.7"/>
        <emitter type="area"><rgb name="radiance" value="3"/></emitter></shape>"#,
        sensor("0,0,4", 24, 18)
    ));
    let direct = film(&scene, 16, 1, Needs::default()).develop().get(Layer::Direct).unwrap().clone();
    direct.data.iter().sum::<f32>() / direct.data.len() as f32
}

#[test]
fn luminaires_are_seen_by_paths_of_one_edge_and_not_where_they_are_hidden() {
    // The disk that a ball of radius r shows at distance d, over the film's area at distance one.
    let (tangent, half_width) = (0.7 / (16.0f32 - 0.49).sqrt(), 20f32.to_radians().tan());
    let share = std::f32::consts::PI * tangent * tangent / (4.0 * half_width * half_width * 18.0 / 24.0);
    assert!((seen_light(1, false) / (3.0 * share) - 1.0).abs() < 5e-3, "{} and {}", seen_light(1, false), 3.0 * share);
    assert_eq!([seen_light(0, false), seen_light(1, true)], [0.0; 2]);
}

#[test]
fn what_nobody_needs_is_not_recorded() {
    let scene = bundled("unit/diffuse", (8, 6));
    let frame = film(&scene, 4, 1, Needs::EDGES.with(Recorded::Features).with(Recorded::Bins)).develop();
    for layer in [Layer::Occlusion, Layer::Position, Layer::BinAmbient(0), Layer::BinAmbientDx(3)] {
        assert!(frame.get(layer).is_none(), "{}", layer.name());
    }
    assert!(film(&scene, 4, 1, Needs::ALL).develop().present().count() == Layer::COUNT - 1);
}

#[test]
fn renders_of_other_programs_tell_their_variance() {
    let values = [1.0f32, 3.0, 2.0, 6.0];
    let renders: Vec<_> =
        values.iter().map(|&value| Image::from_rgb(2, 1, |x, _| Rgb::splat(value + x as f32))).collect();
    let mut frame = Frame::of_renders(&renders, 8).unwrap();
    frame.set(Layer::Albedo, Image::new(2, 1, 3));
    frame.complete(None);
    assert_eq!(frame.get(Layer::Color).unwrap().data, [3.0, 3.0, 3.0, 4.0, 4.0, 4.0]);
    // 4, 0, 1 and 9 over three degrees of freedom and four renders.
    frame.get(Layer::ColorVariance).unwrap().data.iter().for_each(|value| assert!((value - 14.0 / 12.0).abs() < 1e-6));
    assert_eq!(frame.get(Layer::Samples).unwrap().data, [32.0; 2]);
    assert_eq!(frame.get(Layer::BinColor(5)).unwrap().data[0], values[1]);
    assert_eq!(frame.get(Layer::AlbedoVariance).unwrap().data, [0.0; 6]);
    let [a, b] = [0, 1].map(|half| frame.color_half(half).unwrap()[0].data[0]);
    assert_eq!((a, b), (1.5, 4.5));
    // Of three, one has a half to itself.
    let three = Frame::of_renders(&renders[..3], 1).unwrap();
    assert_eq!([0, 1].map(|k| three.get(Layer::BinColor(k)).unwrap().data[0]), [1.5, 3.0]);
    let other = Image::new(1, 1, 3);
    assert!(Frame::of_renders(&renders[..1], 1).unwrap_err().to_string().contains("two or more"));
    assert!(Frame::of_renders(&[renders[0].clone(), other], 1).is_err());
}
