//! Light of groups of emitters: it adds up, belongs to the right ones, and survives files, merging and reconstruction.

use std::path::Path;

use fluxion::adaptive::{self, AdaptiveSettings, Limits};
use fluxion::film::{Frame, Layer, Needs, Recorded, exr};
use fluxion::image::Image;
use fluxion::image::io::{Pixels, read};
use fluxion::internals::plan::Plan;
use fluxion::mitsuba::{Options, load_text};
use fluxion::reconstruct::{self, Context, METHODS, Reconstruction, light_groups, parse, solve};
use fluxion::render::{Budget, Control, RenderSettings, render};
use fluxion::scene::Scene;

use crate::cli::fluxion;

/// A closed room with two lamps and a glossy ball; the camera sees one of the lamps.
const ROOM: &str = r#"<scene version="3.0.0">
<default name="left" value="6"/><default name="right" value="4"/><default name="integrator" value="path"/>
<integrator type="$integrator"><integer name="max_depth" value="6"/></integrator>
<sensor type="perspective"><float name="fov" value="60"/>
<transform name="to_world"><lookat origin="0,0,0.9" target="0,0,0" up="0,1,0"/></transform>
<film type="hdrfilm"><integer name="width" value="24"/><integer name="height" value="18"/></film></sensor>
<shape type="cube"><boolean name="flip_normals" value="true"/><bsdf type="diffuse"/></shape>
<shape type="sphere"><point name="center" y="-0.6"/><float name="radius" value="0.3"/><bsdf type="roughconductor"/></shape>
<shape type="sphere" id="lamp_left"><point name="center" x="-0.6" y="0.3" z="-0.4"/><float name="radius" value="0.15"/>
<emitter type="area"><rgb name="radiance" value="$left,$left,1"/></emitter></shape>
<shape type="rectangle" id="lamp_right"><transform name="to_world"><scale value="0.2"/><rotate x="1" angle="90"/>
<translate x="0.5" y="0.99"/></transform><emitter type="area"><rgb name="radiance" value="1,$right,$right"/></emitter></shape>
</scene>"#;

const GROUPS: &str = "key=*_left,rest";

fn room(parameters: &[(&str, &str)]) -> Scene {
    let parameters = parameters.iter().map(|(name, value)| ((*name).to_owned(), (*value).to_owned())).collect();
    load_text(ROOM, &Options { parameters, light_groups: Some(GROUPS.into()), ..Options::default() }).unwrap()
}

fn frame(scene: &Scene, needs: Needs, spp: u32) -> Frame {
    let needs = Plan::new(scene, needs, Needs::default()).needs;
    render(scene, RenderSettings::new(Budget::Spp(spp), needs), &Control::QUIET).film.develop()
}

/// The largest difference between an image and the sum of some, over its value or the image's mean, whichever is larger.
fn apart<'a>(image: &Image, parts: impl Iterator<Item = &'a Image>) -> f32 {
    let mut sum = Image::new(image.width, image.height, 3);
    parts.for_each(|part| sum.add(part));
    let mean = image.data.iter().sum::<f32>() / image.data.len() as f32;
    sum.data.iter().zip(&image.data).map(|(a, b)| (a - b).abs() / b.abs().max(mean)).fold(0.0, f32::max)
}

fn mean(image: &Image) -> [f64; 3] {
    let of = |c: usize| image.channel(c).iter().sum::<f64>() / (image.width * image.height) as f64;
    [of(0), of(1), of(2)]
}

#[test]
fn groups_add_up_to_the_colour_and_change_no_bit_of_it() {
    let grouped = room(&[]);
    let plain = load_text(ROOM, &Options::default()).unwrap();
    let needs = Needs::EDGES.with(Recorded::Features);
    let (with, without) = (frame(&grouped, needs, 8), frame(&plain, needs, 8));
    assert_eq!(with.lights.iter().map(|lights| lights.name.as_str()).collect::<Vec<_>>(), ["key", "rest"]);
    with.present().for_each(|(layer, image)| assert_eq!(Some(image), without.get(layer), "{layer:?}"));
    let [color, direct] = [Layer::Color, Layer::Direct].map(|layer| with.get(layer).unwrap());
    assert!(apart(color, with.lights.iter().map(|lights| &lights.color)) < 1e-5);
    assert!(apart(direct, with.lights.iter().map(|lights| &lights.direct)) < 1e-5);
    // The camera sees the left lamp, and not the right one.
    assert!(mean(&with.lights[0].direct)[0] > 0.1 && mean(&with.lights[1].direct) == [0.0; 3]);
}

#[test]
fn groups_are_renders_with_one_lamp() {
    let all = frame(&room(&[]), Needs::default(), 256);
    // A lamp that is dark in two channels is none there.
    for (group, dark, channels) in [(0, ("right", "0"), [1, 2]), (1, ("left", "0"), [0, 1])] {
        let alone = frame(&room(&[dark]), Needs::default(), 256);
        let (found, expected) = (mean(&all.lights[group].color), mean(alone.get(Layer::Color).unwrap()));
        for c in channels {
            assert!((found[c] / expected[c] - 1.0).abs() < 0.02, "group {group}: {found:?} and {expected:?}");
        }
    }
}

#[test]
fn groups_add_up_after_every_reconstruction() {
    let scene = room(&[]);
    let frame = frame(&scene, Needs::ALL, 8);
    for method in METHODS.iter().filter(|method| method.id != "oidn") {
        let made = parse(method.id).unwrap();
        let solution = solve(made.as_ref(), &frame, &Context::QUIET).unwrap();
        let lights = light_groups(made.as_ref(), &frame, &solution).unwrap();
        assert!(apart(&solution.image, lights.iter().map(|light| &light.image)) < 1e-5, "{}", method.id);
        // Filters move light between pixels, not between groups.
        for (light, sampled) in lights.iter().zip(&frame.lights) {
            let (mut noisy, filtered) = (sampled.color.clone(), mean(&light.image));
            noisy.add(&sampled.direct);
            let ratio = filtered.iter().sum::<f64>() / mean(&noisy).iter().sum::<f64>();
            assert!((ratio - 1.0).abs() < 0.1, "{}, {}: {ratio}", method.id, light.name);
        }
    }
    // Those of the mean are the samples' own.
    let primal = parse("primal").unwrap();
    let solution = solve(primal.as_ref(), &frame, &Context::QUIET).unwrap();
    let key = &light_groups(primal.as_ref(), &frame, &solution).unwrap()[0].image;
    let mut own = frame.lights[0].color.clone();
    own.add(&frame.lights[0].direct);
    assert!(apart(&own, std::iter::once(key)) < 1e-5);
}

#[test]
fn adaptive_renders_and_hidden_emitters_have_groups() {
    let scene = room(&[]);
    let method: Box<dyn Reconstruction> = reconstruct::parse("frgr").unwrap();
    let needs = Plan::new(&scene, method.needs(), Needs::default()).needs;
    let settings = AdaptiveSettings {
        render: RenderSettings::new(Budget::Spp(1), needs),
        method: method.as_ref(),
        allocator: adaptive::ALLOCATORS[0],
        limits: Limits { spp: Some(16), ..Limits::default() },
        reconstruction: None,
    };
    let done = adaptive::run(&scene, &settings, &Control::QUIET, &Context::QUIET).unwrap();
    let color = done.frame.get(Layer::Color).unwrap();
    assert!(apart(color, done.frame.lights.iter().map(|lights| &lights.color)) < 1e-5);
    let hidden = ROOM.replace(
        r#"<integer name="max_depth""#,
        r#"<boolean name="hide_emitters" value="true"/><integer name="max_depth""#,
    );
    let scene = load_text(&hidden, &Options { light_groups: Some(GROUPS.into()), ..Options::default() }).unwrap();
    let frame = frame(&scene, Needs::default(), 4);
    assert!(apart(frame.get(Layer::Color).unwrap(), frame.lights.iter().map(|lights| &lights.color)) < 1e-5);
    assert_eq!(mean(&frame.lights[0].direct), [0.0; 3]);
}

/// The sum of the layers of light of a written image, and its colours.
fn written(path: &Path) -> (Image, Image) {
    let Pixels { width, height, channels, data, .. } = read(path, &[]).unwrap();
    let image = |prefix: &str| {
        let at = ["R", "G", "B"].map(|c| channels.iter().position(|name| *name == format!("{prefix}{c}")).unwrap());
        let pixels = data.chunks_exact(channels.len()).flat_map(|pixel| at.map(|at| pixel[at])).collect();
        Image { width, height, channels: 3, data: pixels }
    };
    let mut sum = image("light.key.");
    sum.add(&image("light.rest."));
    (image(""), sum)
}

#[test]
fn images_layers_and_merged_checkpoints_keep_the_groups() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    std::fs::write(at.join("room.xml"), ROOM).unwrap();
    let render = |first: &str, rest: &[&str]| {
        let options = ["render", "room.xml", "-q", "--spp", "4", "--light-groups", GROUPS, "--first", first];
        fluxion(at).args(options).args(rest).assert().success();
    };
    render(
        "0",
        &["-o", "a.exr", "-o", "a.png", "--layers", "layers.exr", "--method", "frgr", "--checkpoint", "a.ckpt"],
    );
    let (image, sum) = written(&at.join("a.exr"));
    assert!(apart(&image, std::iter::once(&sum)) < 1e-5);
    let frame = exr::load(&at.join("layers.exr")).unwrap();
    assert_eq!(frame.lights.len(), 2);
    assert!(apart(frame.get(Layer::Color).unwrap(), frame.lights.iter().map(|lights| &lights.color)) < 1e-5);
    fluxion(at).args(["reconstruct", "layers.exr", "-o", "again.exr", "-q", "--method", "frgr"]).assert().success();
    assert_eq!(written(&at.join("again.exr")), (image, sum));
    // Of samples that were taken one after the other, and of all at once.
    render("4", &["--method", "frgr", "--checkpoint", "b.ckpt"]);
    fluxion(at).args(["merge", "a.ckpt", "b.ckpt", "-o", "ab.ckpt"]).assert().success();
    fluxion(at).args(["reconstruct", "ab.ckpt", "-o", "ab.exr", "-q", "--method", "primal"]).assert().success();
    let (image, sum) = written(&at.join("ab.exr"));
    assert!(apart(&image, std::iter::once(&sum)) < 1e-5);
    for file in ["ab.ckpt", "layers.exr"] {
        let said = fluxion(at).args(["info", file]).assert().success();
        let text = String::from_utf8_lossy(&said.get_output().stdout).into_owned();
        assert!(text.contains("lights       key rest"), "{text}");
    }
}

#[test]
fn films_of_other_groups_are_not_mixed() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    std::fs::write(at.join("room.xml"), ROOM).unwrap();
    let render = |groups: &str, rest: &[&str]| {
        let options = ["render", "room.xml", "-q", "--spp", "2", "--method", "primal", "--light-groups", groups];
        fluxion(at).args(options).args(rest).assert()
    };
    render(GROUPS, &["--checkpoint", "a.ckpt"]).success();
    render("lamps", &["--checkpoint", "b.ckpt", "--seed", "1"]).success();
    let merged = fluxion(at).args(["merge", "a.ckpt", "b.ckpt", "-o", "ab.ckpt"]).assert().code(1);
    let text = String::from_utf8_lossy(&merged.get_output().stderr).into_owned();
    assert!(text.contains("has other light groups: key, rest"), "{text}");
    let resumed = render("lamps", &["--checkpoint", "a.ckpt", "--resume"]).code(1);
    let text = String::from_utf8_lossy(&resumed.get_output().stderr).into_owned();
    assert!(text.contains("was started with other light groups: key, rest"), "{text}");
    let unknown = render("key=nosuch*,rest", &["-o", "a.exr"]).code(2);
    let text = String::from_utf8_lossy(&unknown.get_output().stderr).into_owned();
    assert!(text.contains("there are `lamp_left`, `lamp_right`"), "{text}");
}
