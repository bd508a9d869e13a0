//! Scene files that are wrong, odd or hostile: an error that names the place, or a correct image; never a panic.

use crate::common::{film, scene, sensor, try_scene};
use fluxion::film::{Layer, Needs, Recorded};
use fluxion::internals::math::{vec2, vec3};
use fluxion::mitsuba;
use fluxion::scene::Ray;
use fluxion::scene::emitter::Position;
use proptest::prelude::*;

fn message(body: &str) -> String {
    try_scene(body).err().unwrap_or_else(|| panic!("taken: {body}")).to_string()
}

#[test]
fn mistakes_are_named_with_their_line() {
    let camera = sensor("0,0,4", 4, 4).replace('\n', " ");
    for (body, expected) in [
        ("<shape type=\"sphere\"/>", "scene.xml: the scene has no sensor"),
        ("<shape type=\"spere\"/>", "scene.xml:2: shape `spere` is not known; there are obj, ply"),
        (
            "\n<shape type=\"sphere\"><float name=\"radiu\" value=\"1\"/></shape>",
            "scene.xml:3: shape `sphere` has no property `radiu`; it takes: center = 0, radius = 1",
        ),
        ("<shape type=\"sphere\"><float name=\"radius\" value=\"one\"/></shape>", "`one` is not a finite number"),
        ("<shape type=\"sphere\"><float name=\"radius\" value=\"nan\"/></shape>", "`nan` is not a finite number"),
        ("<shape type=\"sphere\"><float name=\"radius\" value=\"-1\"/></shape>", "`radius` must be positive"),
        ("<shape type=\"sphere\"><string name=\"radius\" value=\"1\"/></shape>", "`radius` must be a number"),
        ("<shape type=\"sphere\"><ref id=\"nobody\"/></shape>", "nothing has the id `nobody`"),
        ("<bsdf type=\"diffuse\" id=\"a\"/><bsdf type=\"diffuse\" id=\"a\"/>", "the id `a` is given twice"),
        (
            "<bsdf type=\"twosided\" id=\"a\"><ref id=\"a\"/></bsdf><shape type=\"sphere\"><ref id=\"a\"/></shape>",
            "refer to itself",
        ),
        ("<shape type=\"obj\"><string name=\"filename\" value=\"no.obj\"/></shape>", "no file `no.obj`"),
        ("<include filename=\"scene.xml\"/>", "includes itself"),
        ("<include filename=\"other.xml\"/>", "no file `other.xml`"),
        ("<float name=\"x\" value=\"$unknown\"/>", "parameter `$unknown` has no value"),
        (
            "<shape type=\"cube\"><transform name=\"to_world\"><scale value=\"0\"/></transform></shape>",
            "cannot be inverted",
        ),
        (
            "<shape type=\"cube\"><transform name=\"to_world\"><skew value=\"0\"/></transform></shape>",
            "unknown transform <skew>",
        ),
        ("<medium type=\"homogeneous\"/>", "<medium> in a scene"),
        ("<emitter type=\"constant\"/><emitter type=\"constant\"/>CAMERA", "more than one environment"),
        ("<sensor type=\"thinlens\"/>", "needs an `aperture_radius`"),
        (
            "<sensor type=\"perspective\"><film type=\"hdrfilm\"><integer name=\"width\" value=\"8\"/><integer name=\"crop_offset_x\" value=\"6\"/><integer name=\"crop_width\" value=\"3\"/></film></sensor>",
            "a crop window of 3x576 at 6,0",
        ),
        ("CAMERA<emitter type=\"spot\"><float name=\"cutoff_angle\" value=\"100\"/></emitter>", "a cone of 100"),
        ("<emitter type=\"timed_sunsky\"/>", "`timed_sunsky` is not supported: use sunsky"),
        ("<emitter type=\"area\"/>", "`area` is not supported: it lights a shape: nest it in one"),
        ("<emitter type=\"sunsky\"><float name=\"turbidity\" value=\"11\"/></emitter>", "Turbidity must be"),
        (
            "<shape type=\"sphere\"><float name=\"radius\" value=\"1\"/>\n<float name=\"radius\" value=\"2\"/></shape>",
            "scene.xml:3: `radius` is given twice, before in line 2",
        ),
        (
            "<emitter type=\"constant\"><blackbody name=\"radiance\"/></emitter>",
            "<blackbody> needs the attribute `temperature`",
        ),
        ("<emitter type=\"constant\"><blackbody name=\"radiance\" temperature=\"-5K\"/></emitter>", "must be positive"),
        ("<Shape/>", "<Shape> is no element that is known"),
        ("<shape type=\"instance\"/>", "needs exactly one shapegroup"),
        ("<shape type=\"merge\"><transform name=\"to_world\"/></shape>", "has no property `to_world`"),
        ("<shape type=\"sphere\"><emitter type=\"area\"/><emitter type=\"area\"/></shape>", "a second emitter"),
        (
            "<bsdf type=\"diffuse\" id=\"a\"/><bsdf type=\"null\" id=\"b\"/><alias id=\"a\" as=\"b\"/>",
            "the id `b` is given twice",
        ),
        (
            "<emitter type=\"directional\"><transform name=\"to_world\"/><vector name=\"direction\" value=\"0,0,1\"/></emitter>",
            "either `direction` or `to_world`",
        ),
        (
            "<shape type=\"instance\"><shape type=\"shapegroup\"><shape type=\"sphere\"><emitter type=\"area\"/></shape></shape></shape>",
            "an emitter in a shapegroup",
        ),
        ("<shape type=\"merge\" id=\"m\"><ref id=\"m\"/></shape>", "nested too deeply"),
        (
            "<shape type=\"sphere\"><bsdf type=\"diffuse\"><spectrum name=\"reflectance\" value=\"500:1, 400:1\"/></bsdf></shape>",
            "must rise",
        ),
        (
            "CAMERA<shape type=\"sphere\"><bsdf type=\"diffuse\"><texture name=\"reflectance\" type=\"mesh_attribute\"><string name=\"name\" value=\"face_tone\"/></texture></bsdf></shape>",
            "no mesh has the attribute `face_tone`",
        ),
        (
            "<shape type=\"sphere\"><bsdf type=\"twosided\"><bsdf type=\"dielectric\"/></bsdf></shape>",
            "transmits light",
        ),
        (
            "<shape type=\"sphere\"><bsdf type=\"dielectric\"><string name=\"int_ior\" value=\"jelly\"/></bsdf></shape>",
            "no known material",
        ),
        ("<shape type=\"sphere\"", "scene.xml:"),
        ("<shape type=\"sphere\"><bsdf type=\"diffuse\"/><bsdf type=\"diffuse\"/></shape>", "a second bsdf"),
        (
            "<shape type=\"sphere\"><bsdf type=\"mask\"><texture name=\"opactiy\" type=\"checkerboard\"/><bsdf type=\"diffuse\"/></bsdf></shape>",
            "has no use for the texture here",
        ),
    ] {
        let text = message(&body.replace("CAMERA", &camera));
        assert!(text.contains(expected), "{body}: {text}");
    }
}

#[test]
fn files_that_blow_up_are_refused() {
    let nested = "<bsdf type=\"twosided\">".repeat(5000) + &"</bsdf>".repeat(5000);
    assert!(message(&nested).contains("nested more than"));
    // Every level of blending names the one below twice.
    let mut blends = String::from("<bsdf type=\"diffuse\" id=\"b0\"/>");
    for level in 1..25 {
        let below = format!("<ref id=\"b{}\"/>", level - 1);
        blends += &format!(
            "<bsdf type=\"blendbsdf\" id=\"b{level}\"><float name=\"weight\" value=\"0.5\"/>{below}{below}</bsdf>"
        );
    }
    assert!(message(&format!("{blends}<shape type=\"sphere\"><ref id=\"b24\"/></shape>")).contains("more than 1000"));
    let mut doubling = String::from("<default name=\"p0\" value=\"xxxxxxxx\"/>");
    (0..40).for_each(|i| doubling += &format!("<default name=\"p{}\" value=\"$p{i}$p{i}\"/>", i + 1));
    assert!(message(&doubling).contains("longer than"));
}

/// Mean colour of a small render with directly seen emitters.
fn mean(body: &str) -> f32 {
    let scene = scene(body);
    let frame = film(&scene, 16, 1, Needs::EDGES.with(Recorded::Features)).develop();
    assert_eq!(frame.get(Layer::Rejected).unwrap().data.iter().sum::<f32>(), 0.0);
    let sum = |layer| frame.get(layer).unwrap().data.iter().sum::<f32>();
    (sum(Layer::Color) + sum(Layer::Direct)) / frame.get(Layer::Color).unwrap().data.len() as f32
}

#[test]
fn scenes_without_light_are_black_and_without_shapes_show_the_sky() {
    let camera = sensor("0,0,4", 8, 8);
    assert_eq!(mean(&format!("{camera}<shape type=\"sphere\"/>")), 0.0);
    assert_eq!(mean(&camera), 0.0);
    assert_eq!(mean(&format!("{camera}<emitter type=\"constant\"/>")), 1.0);
}

#[test]
fn depth_counts_as_in_the_documentation() {
    let body = |depth: i32| {
        format!(
            "{}<integrator type=\"path\"><integer name=\"max_depth\" value=\"{depth}\"/></integrator>\
             <emitter type=\"constant\"/><shape type=\"rectangle\"><transform name=\"to_world\"><scale value=\"9\"/></transform></shape>",
            sensor("0,0,4", 8, 8)
        )
    };
    // A grey plane under a white sky: nothing, then half of the light by one bounce.
    assert_eq!(mean(&body(0)), 0.0);
    assert_eq!(mean(&body(1)), 0.0);
    assert!((mean(&body(2)) - 0.5).abs() < 0.02);
    assert!((mean(&body(-1)) - 0.5).abs() < 0.02);
}

fn with_mesh(obj: &str) -> fluxion::error::Result<fluxion::scene::Scene> {
    with_file("m.obj", "obj", obj.as_bytes())
}

fn with_file(name: &str, plugin: &str, bytes: &[u8]) -> fluxion::error::Result<fluxion::scene::Scene> {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join(name), bytes).unwrap();
    let emitter = "<emitter type=\"area\"/>";
    let body = format!(
        "<scene version=\"3.0.0\">{}<shape type=\"{plugin}\"><string name=\"filename\" value=\"{name}\"/>{emitter}</shape></scene>",
        sensor("0,0,4", 4, 4)
    );
    let path = folder.path().join("scene.xml");
    std::fs::write(&path, body).unwrap();
    mitsuba::load(&path, &mitsuba::Options::default())
}

#[test]
fn degenerate_meshes_are_harmless() {
    for obj in [
        "v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n",
        "v 0 0 0\nf 1 1 1\n",
        "v nan 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n",
        "v 1e38 0 0\nv -1e38 0 0\nv 0 1e38 0\nf 1 2 3\n",
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nvn 0 0 0\nf 1//1 2//1 3//1\nf 1//1 2//1 2//1\n",
        "",
    ] {
        let scene = with_mesh(obj).unwrap_or_else(|error| panic!("{obj}: {error}"));
        let frame = film(&scene, 2, 1, Needs::EDGES.with(Recorded::Features)).develop();
        assert!(frame.present().all(|(_, image)| image.data.iter().all(|value| value.is_finite())), "{obj}");
    }
    assert!(with_mesh("v 0 0 0\nv 1 0 0\nf 1 2 9\n").is_err());
}

fn asset(name: &str) -> Vec<u8> {
    std::fs::read(crate::common::root().join("scenes/assets").join(name)).unwrap()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(60))]

    #[test]
    fn damaged_meshes_are_errors_or_meshes(cut in 0usize..60_000, flips in prop::collection::vec((0usize..60_000, any::<u8>()), 0..4)) {
        for (name, plugin) in [("torus.ply", "ply"), ("torus_binary.ply", "ply"), ("torus.serialized", "serialized"), ("torus.obj", "obj")] {
            let mut bytes = asset(name);
            bytes.truncate(cut.max(1));
            for (at, value) in &flips {
                let length = bytes.len();
                bytes[at % length] ^= value;
            }
            // Whatever happens, it is no panic.
            let _ = with_file(name, plugin, &bytes);
        }
    }

    #[test]
    fn damaged_scene_files_are_errors_or_scenes(cut in 0usize..4000, at in 0usize..4000, value in any::<u8>()) {
        let mut bytes = std::fs::read(crate::common::root().join("scenes/glossy-metal/scene.xml")).unwrap();
        bytes.truncate(cut.max(1));
        let length = bytes.len();
        bytes[at % length] ^= value & 0x7f;
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("scene.xml");
        std::fs::write(&path, bytes).unwrap();
        let _ = mitsuba::load(&path, &mitsuba::Options::default());
    }
}

#[test]
fn files_of_older_versions_say_the_same() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("old.xml");
    let text = r##"<scene version="0.6.0">
        <integrator type="path"><integer name="maxDepth" value="3"/><boolean name="strictNormals" value="true"/></integrator>
        <sensor type="perspective"><string name="fovAxis" value="smaller"/><float name="fov" value="40"/>
            <transform name="toWorld"><lookAt origin="0,0,4" target="0,0,0" up="0,1,0"/></transform>
            <film type="ldrfilm"><integer name="width" value="6"/><integer name="height" value="4"/></film></sensor>
        <shape type="rectangle"><bsdf type="diffuse"><srgb name="reflectance" value="#808080"/></bsdf></shape>
        <shape type="sphere"><bsdf type="roughplastic"><float name="intIOR" value="1.5"/>
            <texture name="diffuseReflectance" type="checkerboard"><float name="uscale" value="4"/></texture></bsdf></shape>
    </scene>"##;
    std::fs::write(&path, text).unwrap();
    let scene = mitsuba::load(&path, &mitsuba::Options::default()).unwrap();
    assert_eq!((scene.integrator().max_depth, scene.shapes().len()), (3, 2));
    let hit = scene.intersect(scene.sensor().ray(vec2(1.8, 0.7), vec2(0.5, 0.5))).unwrap();
    assert!((scene.bsdf(&hit).albedo(&hit).x - 0.2158605).abs() < 1e-4);
}

/// The same group once as instances and once as shapes of their own.
#[test]
fn instances_are_what_their_shapes_would_be() {
    let shapes = |transform: &str| {
        let mut text = String::new();
        for (plugin, own) in [
            ("sphere", "<scale value=\"0.6\"/>"),
            ("cube", "<translate x=\"1.5\"/>"),
            ("disk", "<translate y=\"1.4\"/>"),
            ("cylinder", "<translate y=\"-2\"/>"),
        ] {
            text +=
                &format!("<shape type=\"{plugin}\"><transform name=\"to_world\">{own}{transform}</transform></shape>");
        }
        text
    };
    let placement = "<scale value=\"0.7\"/><rotate x=\"1\" y=\"1\" angle=\"35\"/><translate x=\"-0.4\"/>";
    let camera = crate::common::sensor("0,0,6", 24, 24);
    let plain = crate::common::scene(&format!("{camera}{}", shapes(placement)));
    let group = format!("<shape type=\"shapegroup\" id=\"g\">{}</shape>", shapes(""));
    let instance =
        format!("<shape type=\"instance\"><ref id=\"g\"/><transform name=\"to_world\">{placement}</transform></shape>");
    let instanced = crate::common::scene(&format!("{camera}{group}{instance}"));
    let (a, b) = (plain.bounds(), instanced.bounds());
    assert!(a.lower.cmpge(b.lower - 1e-4).all() && a.upper.cmple(b.upper + 1e-4).all());
    let mut hits = 0;
    for pixel in 0..24 * 24 {
        let ray = plain.sensor().ray(vec2((pixel % 24) as f32 + 0.3, (pixel / 24) as f32 + 0.6), vec2(0.5, 0.5));
        let (Some(a), Some(b)) = (plain.intersect(ray), instanced.intersect(ray)) else {
            assert!(plain.intersect(ray).is_none() && instanced.intersect(ray).is_none(), "pixel {pixel}");
            continue;
        };
        hits += 1;
        assert_eq!(a.at.shape, b.at.shape, "pixel {pixel}");
        assert!(a.p.distance(b.p) < 1e-4 && a.n.distance(b.n) < 1e-3 && a.frame.n.distance(b.frame.n) < 1e-3);
        assert!(a.at.uv.distance(b.at.uv) < 1e-3 && a.wi.z - b.wi.z < 1e-3, "pixel {pixel}: {a:?} {b:?}");
    }
    assert!(hits > 100, "{hits}");
}

/// Points drawn on a shape lie where rays meet it, with its normal and texture coordinates there.
#[test]
fn points_drawn_on_shapes_are_on_them() {
    let place =
        "<transform name=\"to_world\"><scale value=\"1.3\"/><rotate y=\"1\" z=\"0.5\" angle=\"50\"/></transform>";
    for (plugin, extra) in
        [("disk", ""), ("cylinder", "<boolean name=\"flip_normals\" value=\"true\"/>"), ("rectangle", "")]
    {
        let scene = crate::common::scene(&format!(
            "{}<shape type=\"{plugin}\">{place}{extra}<emitter type=\"area\"/></shape>",
            crate::common::sensor("0,0,6", 4, 4)
        ));
        let geometry = &scene.shapes()[0].geometry;
        for i in 0..64 {
            let u = vec2((i % 8) as f32 + 0.5, (i / 8) as f32 + 0.5) / 8.0;
            let from = vec3(0.3, -0.2, 5.0);
            let point = geometry.sample(from, u, true).unwrap();
            let Position::Surface { p, n } = point.position else { panic!("{plugin} has no surface") };
            let hit = scene.intersect(Ray::new(p + n * 0.1, -n)).unwrap();
            assert!(hit.p.distance(p) < 1e-4 && hit.n.distance(n) < 1e-4, "{plugin}: {hit:?} {point:?}");
            assert!(hit.at.uv.distance(point.at.uv) < 1e-3, "{plugin}: {} {}", hit.at.uv, point.at.uv);
            let seen = point.solid_angle(from);
            let density = geometry.pdf(from, &point) * seen * geometry.area();
            assert!(seen == 0.0 || (density - 1.0).abs() < 1e-3, "{plugin}: {density}");
        }
    }
}
