//! Scene files as they are found: of older versions, of other programs, in odd encodings. Each kind has a small file here
//! with the value that is right for it.

use std::fs;
use std::path::{Path, PathBuf};

use crate::common::{film, sensor};
use fluxion::Result;
use fluxion::film::{Film, Layer, Needs, Recorded};
use fluxion::mitsuba;
use fluxion::scene::Scene;

/// A scene of some files, of which `scene.xml` is the first to be read.
fn scene_of(files: &[(&str, &[u8])], options: &mitsuba::Options) -> Result<Scene> {
    let folder = tempfile::tempdir().unwrap();
    for (name, bytes) in files {
        let path = folder.path().join(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, bytes).unwrap();
    }
    mitsuba::load(&folder.path().join("scene.xml"), options)
}

fn try_text(text: &str) -> Result<Scene> {
    scene_of(&[("scene.xml", text.as_bytes())], &mitsuba::Options::default())
}

fn text(text: &str) -> Scene {
    try_text(text).unwrap_or_else(|error| panic!("{error}\n{text}"))
}

/// A scene file of a version, with a camera.
fn file(version: &str, body: &str) -> String {
    format!("<scene version=\"{version}\">{}{body}</scene>", sensor("0,0,5", 16, 16))
}

/// Scattered light and what the camera sees directly, of every pixel.
pub fn pixels(film: &Film) -> Vec<[f32; 3]> {
    let frame = film.develop();
    let (color, direct) = (frame.get(Layer::Color).unwrap(), frame.get(Layer::Direct).unwrap());
    let pixel = |i: usize| [0, 1, 2].map(|c: usize| color.data[3 * i + c] + direct.data[3 * i + c]);
    (0..color.width * color.height).map(pixel).collect()
}

/// The colour of the centre, and of the corner.
fn centre_and_corner(scene: &Scene) -> ([f32; 3], [f32; 3]) {
    let all = pixels(&film(scene, 16, 1, Needs::default()));
    let middle = scene.sensor().height / 2 * scene.sensor().width + scene.sensor().width / 2;
    (all[middle], all[0])
}

fn near(found: [f32; 3], expected: [f32; 3], what: &str) {
    let apart = found.iter().zip(expected).all(|(a, b)| (a - b).abs() <= 0.03 * (0.02 + b.abs()));
    assert!(apart, "{what}: {found:?} instead of {expected:?}");
}

const BALL: &str = "<shape type=\"sphere\"/><emitter type=\"constant\"/>";

#[test]
fn any_encoding_and_what_pugixml_forgives_is_read() {
    let plain = file("3.0.0", BALL);
    let utf16: Vec<u8> = format!("\u{feff}{plain}").encode_utf16().flat_map(u16::to_le_bytes).collect();
    let latin1 = [b"<?xml version=\"1.0\" encoding=\"iso-8859-1\"?><!-- K\xe4se -->", plain.as_bytes()].concat();
    let blank = format!("\n\n<?xml version=\"1.0\"?>\n{plain}\nthe end");
    let odd = file("3.0.0", &format!("<!-- -- a -- b ---->{}", BALL.replace("sphere\"", "sphere\" id=\"a & b\"")));
    for bytes in [plain.as_bytes(), &utf16, &latin1, blank.as_bytes(), odd.as_bytes()] {
        let scene = scene_of(&[("scene.xml", bytes)], &mitsuba::Options::default()).unwrap();
        near(centre_and_corner(&scene).0, [0.5; 3], "the ball");
    }
}

#[test]
fn objects_are_referred_to_from_anywhere() {
    let scene = text(
        "<scene version=\"3.0.0\"><integer id=\"few\" name=\"n\" value=\"7\"/>
        <rgb id=\"paint\" name=\"c\" value=\"0.25\"/><integer id=\"side\" name=\"s\" value=\"16\"/>
        <sampler type=\"independent\" id=\"s\"><ref name=\"sample_count\" id=\"few\"/></sampler>
        <film type=\"hdrfilm\" id=\"f\"><ref name=\"width\" id=\"side\"/><integer name=\"height\" value=\"16\"/></film>
        <sensor type=\"perspective\"><transform name=\"to_world\"><lookat origin=\"0,0,5\" target=\"0,0,0\" up=\"0,1,0\"/>
        </transform><ref id=\"s\"/><ref id=\"f\"/></sensor>
        <emitter type=\"area\" id=\"lamp\"><rgb name=\"radiance\" value=\"3 2 1\"/></emitter>
        <shape type=\"sphere\"><ref id=\"lamp\"/><bsdf type=\"diffuse\"><ref name=\"reflectance\" id=\"paint\"/></bsdf></shape>
        <emitter type=\"constant\"/></scene>",
    );
    assert_eq!((scene.sensor().width, scene.sensor().spp), (16, 7));
    near(centre_and_corner(&scene).0, [3.25, 2.25, 1.25], "the lamp");
}

#[test]
fn included_files_may_hold_one_object() {
    let part = "<bsdf type=\"diffuse\" version=\"0.6.0\"><spectrum name=\"diffuseReflectance\" value=\"0.25\"/></bsdf>";
    let ball = "<shape type=\"sphere\" version=\"3.0.0\"><include filename=\"part.xml\"/></shape>";
    let main = file("3.0.0", "<include filename=\"ball.xml\"/><emitter type=\"constant\"/>");
    let files =
        [("part.xml", part), ("ball.xml", ball), ("scene.xml", &main)].map(|(name, text)| (name, text.as_bytes()));
    let scene = scene_of(&files, &mitsuba::Options::default()).unwrap();
    near(centre_and_corner(&scene).0, [0.25; 3], "the ball");
    let message = scene_of(&[("scene.xml", ball.as_bytes())], &mitsuba::Options::default()).err().unwrap().to_string();
    assert!(message.contains("starts with <scene>, not <shape>"), "{message}");
}

#[test]
fn folders_of_paths_come_before_the_scenes_own_the_last_one_first() {
    let obj = |z: i32| format!("v -9 -9 {z}\nv 9 -9 {z}\nv 0 9 {z}\nf 1 2 3\n");
    let (own, first, second) = (obj(0), obj(1), obj(2));
    for (paths, depth) in [("", 5.0), ("<path value=\"a\"/>", 4.0), ("<path value=\"a\"/><path value=\"b\"/>", 3.0)] {
        let main =
            file("3.0.0", &format!("{paths}<shape type=\"obj\"><string name=\"filename\" value=\"m.obj\"/></shape>"));
        let files = [("m.obj", &own), ("a/m.obj", &first), ("b/m.obj", &second), ("scene.xml", &main)];
        let scene = scene_of(&files.map(|(name, text)| (name, text.as_bytes())), &mitsuba::Options::default()).unwrap();
        let frame = film(&scene, 1, 1, Needs::NONE.with(Recorded::Features)).develop();
        let found = frame.get(Layer::Depth).unwrap().rgb(8, 8).x;
        assert!((found - depth).abs() < 0.05, "{paths}: {found}");
    }
}

#[test]
fn lamps_without_a_material_are_black() {
    let inside = "<scene version=\"3.0.0\"><sensor type=\"perspective\"><film type=\"hdrfilm\"><integer name=\"width\" \
        value=\"4\"/><integer name=\"height\" value=\"4\"/></film></sensor><shape type=\"SHAPE\"><boolean name=\"flip_normals\" \
        value=\"true\"/><emitter type=\"area\"><rgb name=\"radiance\" value=\"1\"/></emitter>MATERIAL</shape></scene>";
    for shape in ["sphere", "cube"] {
        let of = |material: &str| text(&inside.replace("SHAPE", shape).replace("MATERIAL", material));
        near(centre_and_corner(&of("")).0, [1.0; 3], shape);
        let grey = film(&of("<bsdf type=\"diffuse\"/>"), 64, 1, Needs::default());
        let mean = pixels(&grey).iter().map(|pixel| pixel[0]).sum::<f32>() / 16.0;
        assert!((mean - 2.0).abs() < 0.1, "{shape}: {mean}");
    }
}

/// A parallel view of the square [-1, 1]².
fn flat(body: &str) -> String {
    format!(
        "<scene version=\"3.0.0\"><sensor type=\"orthographic\"><transform name=\"to_world\"><lookat origin=\"0,0,5\" \
        target=\"0,0,0\" up=\"0,1,0\"/></transform><film type=\"hdrfilm\"><integer name=\"width\" value=\"8\"/><integer \
        name=\"height\" value=\"8\"/></film></sensor>{body}</scene>"
    )
}

/// Mean of a view of a bright mesh.
fn covered(name: &str, mesh: &[u8]) -> f32 {
    let plugin = name.rsplit('.').next().unwrap();
    let main = flat(&format!(
        "<shape type=\"{plugin}\"><string name=\"filename\" value=\"{name}\"/><emitter type=\"area\"/></shape>"
    ));
    let scene = scene_of(&[(name, mesh), ("scene.xml", main.as_bytes())], &mitsuba::Options::default()).unwrap();
    pixels(&film(&scene, 64, 1, Needs::default())).iter().map(|pixel| pixel[0]).sum::<f32>() / 64.0
}

#[test]
fn meshes_of_any_order_and_outline_are_read_as_they_are() {
    // A square less a notch of a quarter, whose first corner is opposite to it.
    let outline = ["-1 -1 0", "1 -1 0", "1 1 0", "0 1 0", "0 0 0", "-1 0 0"];
    let header = |elements: &str| format!("ply\nformat ascii 1.0\n{elements}end_header\n");
    let (vertex, face) = (
        "element vertex 6\nproperty float x\nproperty float y\nproperty float z\n",
        "element face 1\nproperty list uchar int vertex_index\n",
    );
    for turn in 0..6 {
        let order: Vec<_> = (0..6).map(|k| (k + turn) % 6).collect();
        let corners = |first: usize| order.iter().map(|k| (k + first).to_string()).collect::<Vec<_>>().join(" ");
        let obj: String =
            outline.iter().map(|v| format!("v {v} # corner\n")).collect::<String>() + &format!("f {}\n", corners(1));
        let obj = format!("\u{feff}{}", obj.replacen("f ", "f \\\n", 1));
        let (points, list) = (outline.join("\n") + "\n", format!("6 {}\n", corners(0)));
        let first = header(&format!("{face}{vertex}")) + &list + &points;
        let last = header(&format!("{vertex}{face}")) + &points + &list;
        for (name, mesh) in [("m.obj", &obj), ("m.ply", &first), ("m.ply", &last)] {
            let mean = covered(name, mesh.as_bytes());
            assert!((mean - 0.75).abs() < 0.01, "{name} from corner {turn}: {mean}");
        }
    }
}

#[test]
fn balls_scaled_unevenly_are_meshes_that_look_the_same() {
    let scale = "<transform name=\"to_world\"><scale x=\"0.8\" y=\"0.4\" z=\"0.6\"/></transform>";
    let ball = text(&flat(&format!("<shape type=\"sphere\">{scale}<emitter type=\"area\"/></shape>")));
    assert!(ball.warnings()[0].contains("scaled unevenly is traced as a mesh"), "{:?}", ball.warnings());
    let mean = pixels(&film(&ball, 256, 1, Needs::default())).iter().map(|pixel| pixel[0]).sum::<f32>() / 64.0;
    let ellipse = std::f32::consts::PI * 0.8 * 0.4 / 4.0;
    assert!((mean - ellipse).abs() < 4e-3, "{mean} {ellipse}");
    // A side that is turned outwards in, and a cylinder.
    let inside = flat(&format!(
        "<shape type=\"sphere\">{scale}<boolean name=\"flip_normals\" value=\"true\"/><emitter type=\"area\"/></shape>"
    ));
    assert!(pixels(&film(&text(&inside), 4, 1, Needs::default())).iter().all(|pixel| *pixel == [0.0; 3]));
    let skewed = flat(
        "<shape type=\"cylinder\"><transform name=\"to_world\"><matrix value=\"1 0 0  0 0.5 0  0 0 1\"/></transform><emitter \
        type=\"area\"/></shape>",
    );
    assert_eq!(text(&skewed).warnings().len(), 1);
}

/// What older files say and how it is said today: the same image.
#[test]
fn files_of_version_0_6_show_what_their_translations_show() {
    let material = |text: &str| format!("<shape type=\"sphere\">{text}</shape><emitter type=\"constant\"/>");
    let rough = |text: &str| material(&format!("<bsdf type=\"roughconductor\">{text}</bsdf>"));
    let diffuse = |text: &str| material(&format!("<bsdf type=\"diffuse\">{text}</bsdf>"));
    let tiles = format!("<string name=\"filename\" value=\"{}\"/>", asset("tiles.png"));
    let bitmap = |text: &str| format!("<texture type=\"bitmap\" name=\"reflectance\">{tiles}{text}</texture>");
    let normals = format!("<string name=\"filename\" value=\"{}\"/>", asset("normals.png"));
    let bumps = format!("<string name=\"filename\" value=\"{}\"/>", asset("bumps.png"));
    let torus = format!("<string name=\"filename\" value=\"{}\"/>", asset("torus.obj"));
    let integrator = |plugin: &str, depth: &str| {
        format!("<integrator type=\"{plugin}\"><integer name=\"{depth}\" value=\"3\"/></integrator>{BALL}")
    };
    for (old, new) in [
        (
            diffuse("<rgb name=\"reflectance\" value=\"#808080\"/>"),
            diffuse("<rgb name=\"reflectance\" value=\"0.2158605\"/>"),
        ),
        (
            diffuse("<spectrum name=\"reflectance\" value=\"0.3, 0.2, 0.1\"/>"),
            diffuse("<rgb name=\"reflectance\" value=\"0.3 0.2 0.1\"/>"),
        ),
        (
            "<emitter type=\"constant\"><spectrum name=\"radiance\" value=\"2\"/></emitter>".into(),
            "<emitter type=\"constant\"><rgb name=\"radiance\" value=\"2\"/></emitter>".into(),
        ),
        (
            "<emitter type=\"constant\"><blackbody name=\"radiance\" temperature=\"5000K\" scale=\"2\"/></emitter>"
                .into(),
            "<emitter type=\"constant\"><spectrum type=\"blackbody\" name=\"radiance\"><float name=\"temperature\" \
            value=\"5000\"/><float name=\"scale\" value=\"2\"/></spectrum></emitter>"
                .into(),
        ),
        (
            rough("<string name=\"material\" value=\"Au\"/><float name=\"extEta\" value=\"1\"/>"),
            rough("<string name=\"material\" value=\"Au\"/>"),
        ),
        (rough(""), rough("<string name=\"material\" value=\"Cu\"/>")),
        (
            diffuse(&bitmap(
                "<string name=\"filterType\" value=\"ewa\"/><float name=\"maxAnisotropy\" value=\"10\"/><boolean \
                name=\"cache\" value=\"False\"/><string name=\"wrapModeU\" value=\"clamp\"/><string name=\"wrapModeV\" \
                value=\"mirror\"/>",
            )),
            diffuse(&bitmap(
                "<string name=\"wrap_mode_u\" value=\"clamp\"/><string name=\"wrap_mode_v\" value=\"mirror\"/>",
            )),
        ),
        (
            diffuse(&bitmap("<float name=\"gamma\" value=\"1\"/><string name=\"channel\" value=\"g\"/>")),
            diffuse(&bitmap("<boolean name=\"raw\" value=\"true\"/><string name=\"channel\" value=\"g\"/>")),
        ),
        (
            material(&format!(
                "<bsdf type=\"normalmap\"><texture type=\"bitmap\">{normals}<float name=\"gamma\" value=\"1\"/></texture><bsdf \
                type=\"diffuse\"/></bsdf>"
            )),
            material(&format!(
                "<bsdf type=\"normalmap\"><texture type=\"bitmap\" name=\"normalmap\">{normals}<boolean name=\"raw\" \
                value=\"true\"/></texture><bsdf type=\"diffuse\"/></bsdf>"
            )),
        ),
        (
            material(&format!(
                "<bsdf type=\"bump\"><texture type=\"scale\"><float name=\"scale\" value=\"0.3\"/><texture \
                type=\"bitmap\">{bumps}<float name=\"gamma\" value=\"1\"/></texture></texture><bsdf type=\"diffuse\"/></bsdf>"
            )),
            material(&format!(
                "<bsdf type=\"bumpmap\"><texture type=\"bitmap\">{bumps}<boolean name=\"raw\" value=\"true\"/></texture><float \
                name=\"scale\" value=\"0.3\"/><bsdf type=\"diffuse\"/></bsdf>"
            )),
        ),
        (
            format!(
                "<shape type=\"obj\">{torus}<float name=\"maxSmoothAngle\" value=\"0\"/></shape><emitter type=\"constant\"/>"
            ),
            format!(
                "<shape type=\"obj\">{torus}<boolean name=\"face_normals\" value=\"true\"/></shape><emitter type=\"constant\"/>"
            ),
        ),
        (integrator("gpt", "maxDepth"), integrator("path", "max_depth")),
        (integrator("photonmapper", "maxDepth"), integrator("path", "max_depth")),
        (
            format!(
                "<integrator type=\"adaptive\">{}</integrator>{BALL}",
                "<integrator type=\"path\"><integer name=\"maxDepth\" value=\"3\"/></integrator>"
            ),
            integrator("path", "max_depth"),
        ),
        (
            format!(
                "{BALL}<shape type=\"sphere\"><animation name=\"toWorld\"><transform time=\"0\"><translate x=\"1\"/></transform><transform time=\"1\"><translate x=\"9\"/></transform></animation></shape>"
            ),
            format!(
                "{BALL}<shape type=\"sphere\"><transform name=\"to_world\"><translate x=\"1\"/></transform></shape>"
            ),
        ),
        (
            material("<bsdf type=\"roughdielectric\"><string name=\"distribution\" value=\"as\"/></bsdf>"),
            material("<bsdf type=\"roughdielectric\"/>"),
        ),
    ] {
        let [old_film, new_film] = [("0.6.0", &old), ("3.0.0", &new)]
            .map(|(version, body)| film(&text(&file(version, body)), 4, 1, Needs::NONE.with(Recorded::Features)));
        for (old_pixel, new_pixel) in pixels(&old_film).into_iter().zip(pixels(&new_film)) {
            near(old_pixel, new_pixel, &old);
        }
    }
}

fn asset(name: &str) -> String {
    crate::common::root().join("scenes/assets").join(name).display().to_string()
}

#[test]
fn spectra_and_textures_are_the_same_elements() {
    for element in ["spectrum", "texture"] {
        let light = |inside: &str| {
            let body =
                format!("<emitter type=\"constant\"><{element} name=\"radiance\" {inside}</{element}></emitter>");
            centre_and_corner(&text(&file("3.0.0", &body))).1
        };
        near(light("type=\"d65\"><float name=\"scale\" value=\"2\"/>"), [2.0; 3], "d65");
        near(
            light("type=\"d65\"><rgb name=\"color\" value=\"1 2 3\"/><float name=\"scale\" value=\"2\"/>"),
            [2.0, 4.0, 6.0],
            "tinted",
        );
        near(light("type=\"uniform\"><float name=\"value\" value=\"2\"/>"), [2.0; 3], "uniform");
        near(light("type=\"srgb\"><rgb name=\"color\" value=\"1 2 3\"/>"), [1.0, 2.0, 3.0], "srgb");
        near(
            light(
                "type=\"irregular\"><string name=\"wavelengths\" value=\"400, 500, 600, 700\"/><string name=\"values\" value=\"0, 8, 15.6, 18.4\"/>",
            ),
            [20.7108, 10.8546, 2.771_15],
            "irregular",
        );
        near(
            light(
                "type=\"regular\"><float name=\"wavelength_min\" value=\"400\"/><float name=\"wavelength_max\" value=\"700\"/><string name=\"values\" value=\"0, 8, 15.6, 18.4\"/>",
            ),
            [20.7108, 10.8546, 2.771_15],
            "regular",
        );
        near(
            light("type=\"blackbody\"><float name=\"temperature\" value=\"5000\"/>"),
            [15263.4, 12083.0, 9593.2],
            "black body",
        );
    }
}

#[test]
fn what_means_something_else_is_said_and_strictness_makes_it_an_error() {
    for (body, expected) in [
        (
            "<integrator type=\"bdpt\"><integer name=\"max_depth\" value=\"4\"/></integrator>",
            "`bdpt` is not known here: the scene is path traced with max_depth 4",
        ),
        (
            "<integrator type=\"path\"><float name=\"clamp\" value=\"4\"/></integrator>",
            "`clamp` of integrator `path` has no meaning",
        ),
        (
            "<integrator type=\"path\"><boolean name=\"strict_normals\" value=\"true\"/></integrator>",
            "`strict_normals` is ignored",
        ),
        (
            "<bsdf type=\"mixturebsdf\" id=\"m\"><string name=\"weights\" value=\"1 1\"/><bsdf type=\"diffuse\"/><bsdf type=\"diffuse\"/></bsdf><shape type=\"sphere\"><ref id=\"m\"/></shape>",
            "`weights` add up to 2",
        ),
        ("<emitter type=\"sunsky\"><vector name=\"sun_direction\" value=\"0,0,-1\"/></emitter>", "it is night"),
    ] {
        let all = file("3.0.0", body);
        let scene = text(&all);
        assert!(
            scene.warnings().len() == 1 && scene.warnings()[0].contains(expected),
            "{body}: {:?}",
            scene.warnings()
        );
        let strict = mitsuba::Options { strict: true, ..mitsuba::Options::default() };
        let message = scene_of(&[("scene.xml", all.as_bytes())], &strict).err().unwrap().to_string();
        assert!(message.contains(expected), "{message}");
    }
    // What cannot change the radiance is no matter for words.
    let quiet = "<integrator type=\"path\"><integer name=\"samples_per_pass\" value=\"8\"/><float name=\"timeout\" value=\"60\"/>
        <integer name=\"block_size\" value=\"32\"/></integrator><shape type=\"sphere\"><float \
        name=\"silhouette_sampling_weight\" value=\"0.5\"/></shape>";
    assert_eq!(text(&file("3.0.0", quiet)).warnings(), &[] as &[String]);
}

#[test]
fn any_sensor_can_be_chosen_and_none_is_needed_to_look_at_a_scene() {
    let second = sensor("0,0,9", 8, 4).replace("<sensor ", "<sensor id=\"far\" ");
    let all = file("3.0.0", &format!("{second}{BALL}"));
    let choose = |sensor: Option<&str>| {
        let options = mitsuba::Options { sensor: sensor.map(Into::into), ..mitsuba::Options::default() };
        scene_of(&[("scene.xml", all.as_bytes())], &options)
    };
    for (sensor, width) in [(None, 16), (Some("0"), 16), (Some("1"), 8), (Some("far"), 8)] {
        assert_eq!(choose(sensor).unwrap().sensor().width, width, "{sensor:?}");
    }
    let message = choose(Some("near")).err().unwrap().to_string();
    assert!(message.contains("has no sensor `near`; it has numbers 0, 1 (`far`)"), "{message}");
    assert_ne!(choose(None).unwrap().fingerprint(), choose(Some("far")).unwrap().fingerprint());
    let bare = format!("<scene version=\"3.0.0\">{BALL}</scene>");
    assert!(try_text(&bare).is_err());
    let options = mitsuba::Options { sensor_optional: true, ..mitsuba::Options::default() };
    assert_eq!(scene_of(&[("scene.xml", bare.as_bytes())], &options).unwrap().sensors().len(), 0);
}

#[test]
fn included_files_find_what_lies_beside_them() {
    let flat = |value: &str| format!("400:{value}\n700:{value}\n").replace(':', " ");
    let lamp = "<scene version=\"3.0.0\"><emitter type=\"constant\"><spectrum name=\"radiance\" filename=\"s.spd\"/></emitter></scene>";
    let of = |main: &str, files: &[(&str, String)]| {
        let main = file("3.0.0", main);
        let mut all: Vec<(&str, &[u8])> = files.iter().map(|(name, text)| (*name, text.as_bytes())).collect();
        all.push(("scene.xml", main.as_bytes()));
        centre_and_corner(&scene_of(&all, &mitsuba::Options::default()).unwrap()).0[0]
    };
    let lamp = lamp.to_owned();
    let one = of("<include filename=\"parts/l.xml\"/>", &[("parts/l.xml", lamp.clone()), ("s.spd", flat("1"))]);
    // The file that includes comes first, then the folders of paths.
    let files = [("l.xml", lamp.clone()), ("s.spd", flat("1")), ("a/s.spd", flat("2"))];
    assert_eq!(of("<path value=\"a\"/><include filename=\"l.xml\"/>", &files), one);
    let nested = "<scene version=\"3.0.0\"><include filename=\"l.xml\"/></scene>".to_owned();
    let files = [("parts/n.xml", nested), ("parts/l.xml", lamp.clone()), ("parts/s.spd", flat("1"))];
    assert_eq!(of("<include filename=\"parts/n.xml\"/>", &files), one);
    // A path of an included file is that file's own.
    let own = "<scene version=\"3.0.0\"><path value=\"a\"/></scene>".to_owned();
    let here = format!(
        "<include filename=\"p.xml\"/>{}",
        lamp.replace("<scene version=\"3.0.0\">", "").replace("</scene>", "")
    );
    assert_eq!(of(&here, &[("p.xml", own), ("s.spd", flat("1")), ("a/s.spd", flat("2"))]), one);
}

/// The sky is hidden behind holes as it is beside them, and what is hit through them is not.
#[test]
fn hidden_environments_are_hidden_behind_holes_too() {
    let hidden = "<integrator type=\"path\"><boolean name=\"hide_emitters\" value=\"true\"/></integrator>";
    let holes = "<bsdf type=\"mask\"><float name=\"opacity\" value=\"0.3\"/><bsdf type=\"twosided\"><bsdf type=\"diffuse\"/></bsdf></bsdf>";
    for (material, color, alpha) in
        [(holes, 0.15, 0.3), ("<bsdf type=\"null\"/>", 0.0, 0.0), ("<bsdf type=\"diffuse\"/>", 0.5, 1.0)]
    {
        let body = format!(
            "{hidden}<shape type=\"rectangle\"><transform name=\"to_world\"><scale value=\"9\"/></transform>{material}</shape>\
            <emitter type=\"constant\"/>"
        );
        let frame = film(&text(&file("3.0.0", &body)), 256, 1, Needs::NONE.with(Recorded::Alpha)).develop();
        let mean = |layer| {
            let image = frame.get(layer).unwrap();
            image.data.iter().sum::<f32>() / image.data.len() as f32
        };
        let found = (mean(Layer::Color) + mean(Layer::Direct), mean(Layer::Alpha));
        assert!((found.0 - color).abs() < 0.01 && (found.1 - alpha).abs() < 0.01, "{material}: {found:?}");
    }
    // In files of version 0.6 a hidden lamp is black, and still in the way.
    let lamp = "<integrator type=\"path\"><boolean name=\"hideEmitters\" value=\"true\"/></integrator><shape type=\"sphere\"><emitter \
        type=\"area\"/></shape><shape type=\"rectangle\"><transform name=\"toWorld\"><scale value=\"9\"/><translate z=\"-2\"/>\
        </transform></shape>";
    assert_eq!(centre_and_corner(&text(&file("0.6.0", lamp))).0, [0.0; 3]);
    let through = lamp.replace("hideEmitters", "hide_emitters").replace("toWorld", "to_world");
    assert!(centre_and_corner(&text(&file("3.0.0", &through))).0[0] > 0.0);
}

#[test]
fn values_are_taken_as_files_write_them_or_refused_with_a_reason() {
    let ball = |inside: &str| format!("<shape type=\"sphere\">{inside}</shape><emitter type=\"constant\"/>");
    let warns = |body: &str, expected: &str| {
        let scene = text(&file("3.0.0", body));
        assert!(scene.warnings().iter().any(|warning| warning.contains(expected)), "{body}: {:?}", scene.warnings());
    };
    text(&file(
        "3.0.0",
        &ball(
            "<point name=\"center\" value=\"0.1\"/><bsdf type=\"roughconductor\"><string name=\"distribution\" value=\"GGX\"/></bsdf>",
        ),
    ));
    text(&file(
        "3.0.0",
        &format!(
            "<integrator type=\"moment\"><integrator type=\"aov\"><integrator type=\"path\"/></integrator></integrator>{BALL}"
        ),
    ));
    text(&file(
        "3.0.0",
        &format!("<integrator type=\"path\" id=\"p\"/><integrator type=\"moment\"><ref id=\"p\"/></integrator>{BALL}"),
    ));
    warns(
        &ball("<bsdf type=\"diffuse\"><rgb name=\"reflectance\" value=\"2 1 0.5\"/></bsdf>"),
        "`reflectance` is more than one: it is scaled by 0.495",
    );
    for (body, expected) in [
        (
            ball("<bsdf type=\"diffuse\"><rgb name=\"reflectance\" value=\"-0.5 1 0\"/></bsdf>"),
            "light cannot be less than none",
        ),
        ("<integrator type=\"path\"/><integrator type=\"direct\"/>".into(), "a second integrator"),
        ("<integrator type=\"path\"><integer name=\"max_depth\" value=\"-2\"/></integrator>".into(), "or -1 for any"),
    ] {
        let message = try_text(&file("3.0.0", &body)).err().unwrap().to_string();
        assert!(message.contains(expected), "{message}");
    }
    let empty = file("3.0.0", "<shape type=\"obj\"><string name=\"filename\" value=\"m.obj\"/></shape>");
    let scene =
        scene_of(&[("m.obj", b"no mesh\n"), ("scene.xml", empty.as_bytes())], &mitsuba::Options::default()).unwrap();
    assert!(scene.warnings()[0].contains("the obj file has no faces"), "{:?}", scene.warnings());
    let mean = covered("m.obj", b"v -1 -1 0\rv 1 -1 0\rv 1 1 0\rf 1 2 3\r");
    assert!((mean - 0.5).abs() < 0.01, "lines of old Macs: {mean}");
}

/// Examples that are kept outside of the repository, if they are there.
fn examples() -> Option<PathBuf> {
    Some(crate::common::root().join("../shared/wild")).filter(|folder| folder.is_dir())
}

#[test]
fn shared_examples_have_their_values() {
    let Some(folder) = examples() else { return };
    let load = |name: &str, define: &[(&str, &str)]| -> Scene {
        let parameters = define.iter().map(|(name, value)| ((*name).into(), (*value).into())).collect();
        let options = mitsuba::Options { parameters, ..mitsuba::Options::default() };
        mitsuba::load(&folder.join(name), &options).unwrap_or_else(|error| panic!("{error}"))
    };
    let everywhere = |name: &str, define: &[(&str, &str)], expected: [f32; 3]| {
        pixels(&film(&load(name, define), 16, 1, Needs::default()))
            .into_iter()
            .for_each(|pixel| near(pixel, expected, name));
    };
    everywhere("exr-channels/scene.xml", &[("image", "uint.exr")], [3.0; 3]);
    everywhere("exr-channels/scene.xml", &[("image", "dot-rgb.exr")], [0.25, 0.5, 0.75]);
    everywhere("lamp-without-bsdf/scene.xml", &[], [1.0; 3]);
    everywhere("obj-lines/scene.xml", &[], [1.0; 3]);
    everywhere("obj-lines/scene.xml", &[("mesh", "bom.obj")], [1.0; 3]);
    everywhere("ply-faces-first/scene.xml", &[], [1.0; 3]);
    everywhere("path-order/scene/scene.xml", &[], [1.0; 3]);
    everywhere("texture-16bit-png/scene.xml", &[], [0.2159; 3]);
    let concave = pixels(&film(&load("obj-concave/scene.xml", &[]), 64, 1, Needs::default()));
    assert!((concave.iter().map(|pixel| pixel[0]).sum::<f32>() / 64.0 - 0.75).abs() < 0.01);
    for (name, centre, corner) in [
        ("include-object/scene.xml", 0.25, 1.0),
        ("spectrum-plugins/bitmap.xml", 0.2159, 1.0),
        ("spectrum-plugins/d65.xml", 1.0, 2.0),
        ("spectrum-plugins/d65-texture.xml", 1.0, 2.0),
        ("legacy-06/hex-rgb.xml", 0.2159, 1.0),
        ("lenient-xml/ampersand.xml", 0.5, 1.0),
        ("lenient-xml/blank-first-line.xml", 0.5, 1.0),
        ("lenient-xml/comment-dashes.xml", 0.5, 1.0),
        ("lenient-xml/latin1.xml", 0.5, 1.0),
        ("integrator-parameters/scene.xml", 0.5, 1.0),
    ] {
        let (found_centre, found_corner) = centre_and_corner(&load(name, &[]));
        near(found_centre, [centre; 3], name);
        near(found_corner, [corner; 3], name);
    }
    near(centre_and_corner(&load("top-level-references/scene.xml", &[])).0, [3.0, 2.0, 1.0], "top-level-references");
    for entry in fs::read_dir(folder.join("legacy-06")).unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_some_and(|extension| extension == "xml") {
            load(Path::new("legacy-06").join(path.file_name().unwrap()).to_str().unwrap(), &[]);
        }
    }
    assert_eq!(load("legacy-06/gpt.xml", &[]).integrator().max_depth, 12);
    let options = mitsuba::Options { parameters: vec![("angel".into(), "30".into())], ..mitsuba::Options::default() };
    let message = mitsuba::load(&folder.join("unused-definition/scene.xml"), &options).err().unwrap().to_string();
    assert!(message.contains("no parameter `angel`; it has `angle`"), "{message}");
    let alpha = load("alpha/scene.xml", &[]);
    let frame = film(&alpha, 64, 1, Needs::NONE.with_if(Recorded::Alpha, alpha.sensor().wants_alpha())).develop();
    let alpha = &frame.get(Layer::Alpha).unwrap().data;
    assert!(alpha[8 * 16 + 8] == 1.0 && alpha[0] == 0.0);
    assert!((alpha.iter().sum::<f32>() / 256.0 - 0.349).abs() < 5e-3, "{}", alpha.iter().sum::<f32>() / 256.0);
}

#[test]
fn left_over_properties_of_old_files_are_warnings() {
    let body = "<shape type=\"Sphere\"><bsdf type=\"dielectric\"><float name=\"alpha\" value=\"0.1\"/></bsdf></shape>
        <emitter type=\"constant\"/>";
    for version in ["0.5.0", "0.6.0"] {
        let scene = text(&file(version, body));
        near(centre_and_corner(&scene).0, [1.0; 3], version);
        let warned = scene.warnings().iter().filter(|warning| warning.contains("`dielectric` has no property `alpha`"));
        assert_eq!(warned.count(), 1, "{:?}", scene.warnings());
        let strict = mitsuba::Options { strict: true, ..mitsuba::Options::default() };
        assert!(scene_of(&[("scene.xml", file(version, body).as_bytes())], &strict).is_err());
    }
    for version in ["2.1.0", "3.0.0"] {
        assert!(try_text(&file(version, body)).err().unwrap().to_string().contains("no property `alpha`"));
    }
    // Something nested that has a meaning there and none here is still an error.
    let nested = "<shape type=\"sphere\"><medium type=\"homogeneous\"/></shape>";
    assert!(try_text(&file("0.6.0", nested)).is_err());
}

#[test]
fn ascii_meshes_are_words_between_white_space() {
    let header = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n\
        element face 2\nproperty list uchar int vertex_indices\nend_header\n";
    let body = "-1 -1 0\n1 -1 0\n1 1 0\n-1 1 0\n3 0 1 2\n3 0 2 3\n";
    let scene = file(
        "3.0.0",
        "<shape type=\"ply\"><string name=\"filename\" value=\"m.ply\"/></shape><emitter type=\"constant\"/>",
    );
    let header = header.replace("ascii 1.0", "ascii 1.0\ncomment before end_header there are more lines");
    let load = |body: &str| {
        let mesh = format!("{header}{body}");
        scene_of(&[("scene.xml", scene.as_bytes()), ("m.ply", mesh.as_bytes())], &mitsuba::Options::default())
    };
    for body in [
        body.to_owned(),
        body.replace("3 0 1 2", "\n \n3 0 1 2"),
        body.replace('\n', " "),
        body.replace(' ', "\n"),
        body.replace('\n', "\r\n").replace(' ', "\t  "),
    ] {
        near(centre_and_corner(&load(&body).unwrap()).0, [0.5; 3], &body);
    }
    for (body, expected) in
        [("1 2 3", "ends in entry 1 of 4 of `vertex`"), (&body.replace("3 0 1 2", "x"), "has `x` values")]
    {
        let message = load(body).err().unwrap().to_string();
        assert!(message.contains(expected), "{message}");
    }
}

#[test]
fn corners_that_are_not_finite_are_told() {
    let mesh = "v -1 -1 0\nv 1 -1 0\nv nan 1 0\nv -1 1 0\nf 1 2 4\nf 2 3 4\nf 3 4 1\n";
    let scene = file(
        "3.0.0",
        "<shape type=\"obj\"><string name=\"filename\" value=\"m.obj\"/></shape><emitter type=\"constant\"/>",
    );
    let files = [("scene.xml", scene.as_bytes()), ("m.obj", mesh.as_bytes())];
    let loaded = scene_of(&files, &mitsuba::Options::default()).unwrap();
    let warning = loaded.warnings().join("\n");
    assert!(
        warning.contains("m.obj: 2 of 3 triangles have a corner that is not finite, the first is number 1"),
        "{warning}"
    );
    assert!(scene_of(&files, &mitsuba::Options { strict: true, ..mitsuba::Options::default() }).is_err());
}

#[test]
fn weights_of_emitters_change_the_noise_and_not_the_mean() {
    let lit = |weights: [&str; 2]| {
        let lamp = |x: &str, weight: &str| {
            format!(
            "<shape type=\"rectangle\"><transform name=\"to_world\"><scale value=\"0.3\"/><rotate y=\"1\" angle=\"180\"/>
            <translate x=\"{x}\" z=\"2\"/></transform><emitter type=\"area\">
            <float name=\"sampling_weight\" value=\"{weight}\"/></emitter></shape>"
        )
        };
        text(&file("3.0.0", &format!("<shape type=\"rectangle\"/>{}{}", lamp("-1", weights[0]), lamp("1", weights[1]))))
    };
    let mean = |scene: &Scene| {
        let all = pixels(&film(scene, 512, 1, Needs::default()));
        all.iter().map(|pixel| pixel[0]).sum::<f32>() / all.len() as f32
    };
    let expected = mean(&lit(["1", "1"]));
    for weights in [["1", "9"], ["0", "1"], ["0", "0"], ["3e38", "2e38"]] {
        let found = mean(&lit(weights));
        assert!((found / expected - 1.0).abs() < 0.03, "{weights:?}: {found}, not {expected}");
    }
    let dark = text(&file(
        "3.0.0",
        "<shape type=\"rectangle\"/><emitter type=\"point\"><point name=\"position\" z=\"1\"/>
        <float name=\"sampling_weight\" value=\"0\"/></emitter>",
    ));
    assert!(dark.warnings()[0].contains("`sampling_weight` of 0 gives no light") && mean(&dark) == 0.0);
    let negative = "<emitter type=\"constant\"><float name=\"sampling_weight\" value=\"-1\"/></emitter>";
    assert!(try_text(&file("3.0.0", negative)).is_err());
}

#[test]
fn a_camera_that_cuts_everything_off_is_warned_of() {
    let near = file("3.0.0", "<shape type=\"sphere\"/>")
        .replace("name=\"fov\" value=\"40\"/>", "name=\"fov\" value=\"40\"/><float name=\"near_clip\" value=\"50\"/>");
    let scene = text(&near);
    assert!(scene.warnings()[0].contains("nothing is between the camera's near_clip 50 and its far_clip 10000"));
    assert!(text(&file("3.0.0", "<shape type=\"sphere\"/>")).warnings().is_empty());
}

#[test]
fn sensors_without_a_picture_are_refused_with_the_reason() {
    let sensor = |body: &str| try_text(&format!("<scene version=\"3.0.0\">{body}</scene>")).err().unwrap().to_string();
    for (body, expected) in [
        (
            "<shape type=\"sphere\"><sensor type=\"irradiancemeter\"/></shape>",
            "`irradiancemeter` is not supported: it measures",
        ),
        ("<sensor type=\"batch\"/>", "`batch` is not supported: it is several sensors in one"),
        ("<sensor type=\"fisheye\"/>", "`fisheye` is not known; there are perspective"),
    ] {
        assert!(sensor(body).contains(expected), "{}", sensor(body));
    }
    let measured = "<shape type=\"sphere\"><bsdf type=\"measured_polarized\"/></shape>";
    assert!(try_text(&file("3.0.0", measured)).err().unwrap().to_string().contains("polarized light"));
}

#[test]
fn types_in_capitals_and_references_in_the_scene_are_read() {
    let body = "<shape type=\"Sphere\"/><emitter type=\"Constant\" id=\"sky\"/><ref id=\"sky\"/>";
    near(centre_and_corner(&text(&file("3.0.0", body))).0, [0.5; 3], "capitals");
    assert!(try_text(&file("3.0.0", "<ref id=\"nobody\"/>")).err().unwrap().to_string().contains("nothing has the id"));
}
