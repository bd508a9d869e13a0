//! The program as a user runs it.

use std::path::Path;

use assert_cmd::Command;
use fluxion::film::RECORDED;
use fluxion::image::io::read_color;
use fluxion::render::EPOCH;

pub fn fluxion(folder: &Path) -> Command {
    let mut command = Command::cargo_bin("fluxion").unwrap();
    command.current_dir(folder);
    command
}

pub fn scene(name: &str) -> String {
    format!("{}/scenes/{name}/scene.xml", env!("CARGO_MANIFEST_DIR"))
}

pub fn stderr(command: &mut Command) -> (i32, String) {
    let output = command.output().unwrap();
    (output.status.code().unwrap_or(-1), String::from_utf8_lossy(&output.stderr).into_owned())
}

#[test]
fn reconstructing_saved_layers_gives_the_rendered_image() {
    let folder = tempfile::tempdir().unwrap();
    for method in ["primal", "l2", "l2:alpha=0.5"] {
        let arguments = [
            "-o",
            "a.exr",
            "-o",
            "a.png",
            "--size",
            "40x30",
            "--spp",
            "5",
            "--layers",
            "layers.exr",
            "--method",
            method,
        ];
        fluxion(folder.path()).args(["render", &scene("cornell-box")]).args(arguments).assert().success();
        fluxion(folder.path())
            .args(["reconstruct", "layers.exr", "-o", "b.exr", "--method", method])
            .assert()
            .success();
        let [a, b] = ["a.exr", "b.exr"].map(|name| read_color(&folder.path().join(name)).unwrap());
        assert!(a == b, "{method}");
        assert_eq!(read_color(&folder.path().join("a.png")).unwrap().shape(), (40, 30, 3));
    }
}

#[test]
fn the_seed_and_not_the_threads_decide_the_bits() {
    let folder = tempfile::tempdir().unwrap();
    let render = |name: &str, extra: [&str; 4]| {
        let arguments = ["-o", name, "--size", "33x20", "--spp", "3", "-q"];
        fluxion(folder.path()).args(["render", &scene("glossy-metal")]).args(arguments).args(extra).assert().success();
        read_color(&folder.path().join(name)).unwrap()
    };
    let one = render("1.exr", ["--seed", "4", "--threads", "1"]);
    assert!(one == render("2.exr", ["--seed", "4", "--threads", "2"]));
    assert!(one != render("3.exr", ["--seed", "5", "--threads", "2"]));
}

#[test]
fn figures_come_as_json_with_the_promised_keys() {
    let folder = tempfile::tempdir().unwrap();
    let arguments = ["-o", "a.exr", "--size", "16x16", "--spp", "2", "--json", "stats.json"];
    fluxion(folder.path()).args(["render", &scene("cornell-box")]).args(arguments).assert().success();
    let text = std::fs::read_to_string(folder.path().join("stats.json")).unwrap();
    let stats: serde_json::Value = serde_json::from_str(&text).unwrap();
    for key in ["load", "render", "develop", "reconstruct", "write"] {
        assert!(stats["seconds"][key].as_f64().unwrap() >= 0.0, "{key}");
    }
    assert_eq!(
        (stats["spp"].as_u64(), stats["samples"].as_u64(), stats["rejected"].as_u64()),
        (Some(2), Some(512), Some(0))
    );
    assert!(stats["peak_bytes"].as_u64().unwrap() > 1 << 20);
    assert_eq!(stats["method"].as_str(), Some("net"));
    let plan = stats["plan"].as_str().unwrap();
    let needed = |name: &str| ["gradients", "features"].contains(&name);
    let decisions = ["gradients"].into_iter().chain(RECORDED.iter().map(|row| row.name)).chain(["lights", "materials"]);
    let expected = decisions.map(|name| format!("{}{name}", if needed(name) { '+' } else { '-' }));
    assert!(plan.starts_with(&expected.collect::<Vec<_>>().join(" ")), "{plan}");
    let output =
        fluxion(folder.path()).args(["compare", "a.exr", "a.exr", "--json", "-", "--map", "map.png"]).output().unwrap();
    let figures: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    for (key, value) in [("relmse", 0.0), ("smape", 0.0), ("flip", 0.0), ("mse", 0.0), ("mean_ratio", 1.0)] {
        assert_eq!(figures[key].as_f64(), Some(value), "{key}");
    }
    assert!(folder.path().join("map.png").is_file());
    let arguments = ["compare", "a.exr", "a.exr", "a.exr", "--json=all.json", "--html", "page.html"];
    fluxion(folder.path()).args(arguments).assert().success();
    let all = std::fs::read_to_string(folder.path().join("all.json")).unwrap();
    let all: serde_json::Value = serde_json::from_str(&all).unwrap();
    assert_eq!((all.as_array().unwrap().len(), all[1]["image"].as_str()), (2, Some("a.exr")));
    let page = std::fs::read_to_string(folder.path().join("page.html")).unwrap();
    assert!(page.contains("data:image/png;base64,") && !page.contains("{{"));
}

#[test]
fn a_time_budget_is_kept_roughly_and_a_replayed_sample_is_printed() {
    let folder = tempfile::tempdir().unwrap();
    let start = std::time::Instant::now();
    let arguments = ["-o", "a.hdr", "--size", "32x32", "--time", "0.5s"];
    fluxion(folder.path()).args(["render", &scene("cornell-box")]).args(arguments).assert().success();
    assert!(start.elapsed().as_secs_f64() > 0.4);
    let output =
        fluxion(folder.path()).args(["render", &scene("cornell-box"), "--replay", "100,100,3"]).output().unwrap();
    assert!(String::from_utf8_lossy(&output.stdout).contains("differences"));
}

#[test]
fn the_program_tells_what_it_knows() {
    let folder = tempfile::tempdir().unwrap();
    for (arguments, expected) in [
        (vec!["info", "--methods"], "alpha=0.2"),
        (vec!["info", "--layers"], "`dx.R` `dx.G` `dx.B`"),
        (vec!["info", "--plugins"], "`roughconductor`"),
        (vec!["info", "--metrics"], "relmse"),
        (vec!["info", &scene("cornell-box"), "--method", "primal"], "gradients    left out"),
        (vec!["--version"], "fluxion "),
    ] {
        let output = fluxion(folder.path()).args(&arguments).output().unwrap();
        let text = String::from_utf8_lossy(&output.stdout).into_owned();
        assert!(output.status.success() && text.contains(expected), "{arguments:?}: {text}");
    }
}

#[test]
fn a_report_says_everything_but_where_files_are() {
    let folder = tempfile::tempdir().unwrap();
    let (scenes, elsewhere) = (folder.path().join("of John Doe"), folder.path().join("else where"));
    for folder in [&scenes, &elsewhere] {
        std::fs::create_dir(folder).unwrap();
    }
    let uneven =
        "<shape type=\"sphere\"><transform name=\"to_world\"><scale x=\"1\" y=\"2\" z=\"1\"/></transform></shape>";
    std::fs::write(elsewhere.join("ball.xml"), format!("<scene version=\"3.0.0\">{uneven}</scene>")).unwrap();
    let text = format!(
        "<scene version=\"3.0.0\"><sensor type=\"perspective\"><film type=\"hdrfilm\"><float name=\"exposure\" value=\"1\"/>\
         </film></sensor><include filename=\"{}\"/></scene>",
        elsewhere.join("ball.xml").display()
    );
    std::fs::write(scenes.join("odd room.xml"), text).unwrap();
    let output = fluxion(folder.path()).args(["info", "--report"]).arg(scenes.join("odd room.xml")).output().unwrap();
    let (text, error) = (String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    assert!(output.status.success(), "{error}");
    let warnings = ["warning      odd room.xml:1: the film's `exposure`", "warning      ball.xml:1: a sphere"];
    let epoch = format!("epoch {EPOCH} of samples");
    for expected in [epoch.as_str(), "threads", "Embree", "fingerprint", "gradients"].into_iter().chain(warnings) {
        assert!(text.contains(expected), "{expected}: {text}");
    }
    for private in ["John", "Doe", "else where", &*folder.path().to_string_lossy()] {
        assert!(!text.contains(private) && !error.contains(private), "{text}\n{error}");
    }
}

#[test]
fn budgets_that_end_before_their_target_say_so() {
    let folder = tempfile::tempdir().unwrap();
    let render = |target: &str| {
        let arguments = ["--size", "32x32", "--spp", "32", "--target-error", target, "-o", "image.exr"];
        let output = fluxion(folder.path()).args(["render", &scene("cornell-box")]).args(arguments).output().unwrap();
        assert!(output.status.success());
        String::from_utf8_lossy(&output.stderr).into_owned()
    };
    let (missed, met) = (render("1e-9"), render("10"));
    assert!(missed.contains("warning: the run ended at an estimated relMSE of"), "{missed}");
    assert!(missed.contains("above the target of 1e-9") && !met.contains("warning"), "{missed}{met}");
}

#[test]
fn the_documents_hold_what_the_program_prints() {
    let folder = tempfile::tempdir().unwrap();
    for (flag, document) in [("--plugins", "docs/figures/plugins.md"), ("--layers", "docs/figures/layers.md")] {
        let output = fluxion(folder.path()).args(["info", flag]).output().unwrap();
        let text = std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join(document)).unwrap();
        assert!(text.contains(&*String::from_utf8_lossy(&output.stdout)), "{document} is not up to date with {flag}");
    }
}

#[test]
fn mistakes_are_told_apart_and_leave_nothing_behind() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("cut.exr"), b"v/1\x01").unwrap();
    std::fs::write(folder.path().join("bad.xml"), "<scene version=\"3.0.0\">\n<shape type=\"teapot\"/></scene>")
        .unwrap();
    let cornell = scene("cornell-box");
    for (arguments, code, expected) in [
        (vec!["render", "no.xml", "-o", "a.exr"], 1, "no.xml"),
        (vec!["render", "bad.xml", "-o", "a.exr"], 1, "bad.xml:2: shape `teapot` is not known; there are obj"),
        (vec!["render", &cornell, "-o", "a.tiff8"], 2, "not one of exr"),
        (vec!["render", &cornell, "-o", "no/folder/a.exr"], 1, "cannot be written"),
        (vec!["render", &cornell, "-o", "a.exr", "--method", "magic"], 2, "there are primal, l2"),
        (vec!["render", &cornell, "-o", "a.exr", "--size", "0x5"], 2, "positive"),
        (vec!["render", &cornell, "-o", "a.exr", "--size", "999999x999999"], 1, "pixels"),
        (vec!["render", &cornell, "-o", "a.exr", "--spp", "0"], 2, "--spp"),
        (vec!["render", &cornell], 2, "--output"),
        (vec!["render", &cornell, "-o", "b.exr", "--layers", "./b.exr"], 2, "written over"),
        (vec!["validate", "--spp", "0"], 2, "--spp"),
        (vec!["render", &cornell, "--replay", "5000,1,1"], 2, "outside the film"),
        (vec!["reconstruct", "cut.exr", "-o", "a.exr"], 1, "cut.exr"),
        (vec!["compare", "cut.exr", "cut.exr"], 1, "cut.exr"),
        (vec!["compare", "bad.xml", "cut.exr", "--map", "cut.exr"], 1, "bad.xml"),
        (vec!["info"], 2, "scene file"),
    ] {
        let (found, text) = stderr(fluxion(folder.path()).args(&arguments));
        assert_eq!(found, code, "{arguments:?}: {text}");
        assert!(text.contains(expected), "{arguments:?}: {text}");
        assert!(!folder.path().join("a.exr").exists(), "{arguments:?} left a file");
    }
}

#[test]
fn data_errors_are_no_mistakes_on_the_command_line() {
    let folder = tempfile::tempdir().unwrap();
    let mut frame = fluxion::internals::synthetic::exact(&fluxion::internals::synthetic::picture((9, 7)));
    fluxion::internals::synthetic::change(
        &mut frame,
        fluxion::Layer::Dx,
        |i, value| if i == 4 { f32::NAN } else { value },
    );
    fluxion::exr::save(&folder.path().join("nan.exr"), &frame).unwrap();
    for (name, size) in [("small.exr", (9, 7)), ("large.exr", (9, 8))] {
        let image = fluxion::internals::synthetic::picture(size);
        fluxion::write_color(&folder.path().join(name), &image, &fluxion::Extras::default()).unwrap();
    }
    for (arguments, expected) in [
        (vec!["reconstruct", "nan.exr", "-o", "a.exr", "--method", "l2"], "dx.G is not finite at pixel 1,0"),
        (vec!["compare", "small.exr", "large.exr"], "differ in shape"),
        (vec!["reconstruct", "small.exr", "-o", "a.exr", "--method", "control_variate:weights=given"], "missing"),
    ] {
        let (code, text) = stderr(fluxion(folder.path()).args(&arguments));
        assert!(code == 1 && text.contains(expected), "{arguments:?}: {code} {text}");
    }
}

#[test]
fn every_image_says_where_it_comes_from() {
    let folder = tempfile::tempdir().unwrap();
    let run = |arguments: &[&str]| fluxion(folder.path()).args(arguments).assert().success();
    let cornell = scene("cornell-box");
    let render = ["render", &cornell, "--size", "16x12", "--spp", "8", "--seed", "4", "-q"];
    let saved = ["-o", "a.exr", "--layers", "layers.exr", "--checkpoint", "a.ckpt"];
    run(&[&render[..], &saved[..]].concat());
    for from in ["layers.exr", "a.ckpt"] {
        run(&["reconstruct", from, "-o", &format!("{from}.exr"), "--method", "l1"]);
    }
    let headers = |name: &str| {
        let names = fluxion::film::Provenance::NAMES;
        let pixels = fluxion::image::io::read(&folder.path().join(name), &names).unwrap();
        fluxion::film::Provenance::from_attributes(&pixels.attributes)
    };
    let rendered = headers("a.exr");
    assert_eq!((rendered.method.as_str(), rendered.seed.as_str(), rendered.spp.as_str()), ("net", "4", "8"));
    assert!(
        rendered.plan.starts_with("+gradients") && rendered.fingerprint.len() == 16 && rendered.scene == "scene.xml"
    );
    for name in ["layers.exr.exr", "a.ckpt.exr"] {
        let found = headers(name);
        // Times are those of the render, which is measured after the checkpoint has been written.
        let expected =
            fluxion::film::Provenance { method: "l1".into(), seconds: found.seconds.clone(), ..rendered.clone() };
        assert_eq!(found, expected, "{name}");
    }
}

#[test]
fn a_missing_layer_is_named_with_the_flag_that_renders_it() {
    let folder = tempfile::tempdir().unwrap();
    let arguments = ["-o", "a.exr", "--size", "8x8", "--spp", "1", "--layers", "l.exr", "--method", "primal"];
    fluxion(folder.path()).args(["render", &scene("cornell-box")]).args(arguments).assert().success();
    let (code, text) = stderr(fluxion(folder.path()).args(["reconstruct", "l.exr", "-o", "b.exr", "--method", "l2"]));
    assert!(code == 1 && text.contains("dx.R") && text.contains("--method l2"), "{text}");
}

#[cfg(unix)]
#[test]
fn an_interrupt_ends_after_the_running_tiles_and_writes_what_is_there() {
    let folder = tempfile::tempdir().unwrap();
    /// Does not outlive the test, whatever happens.
    struct Child(std::process::Child);
    impl Drop for Child {
        fn drop(&mut self) {
            let _ = self.0.kill();
        }
    }
    let child = std::process::Command::new(assert_cmd::cargo::cargo_bin("fluxion"))
        .current_dir(folder.path())
        .args(["render", &scene("cornell-box"), "-o", "a.exr", "--spp", "100000"])
        .stderr(std::process::Stdio::piped())
        .spawn()
        .unwrap();
    let mut child = Child(child);
    crate::common::signal(&child.0, "-INT", std::time::Duration::from_millis(1000));
    assert_eq!(child.0.wait().unwrap().code(), Some(130));
    let image = read_color(&folder.path().join("a.exr")).unwrap();
    assert!(image.data.iter().sum::<f32>() > 0.0);
}

#[test]
fn adaptive_renders_hold_their_counts_and_errors() {
    let folder = tempfile::tempdir().unwrap();
    let render = |extra: &[&str]| {
        let arguments = ["-o", "a.exr", "--size", "40x30", "--json", "a.json", "-q", "--method", "apr"];
        let mut command = fluxion(folder.path());
        command.args(["render", &scene("cornell-box")]).args(arguments).args(extra).assert().success();
        let text = std::fs::read_to_string(folder.path().join("a.json")).unwrap();
        serde_json::from_str::<serde_json::Value>(&text).unwrap()
    };
    let stats = render(&["--spp", "20", "--adaptive"]);
    assert_eq!(stats["samples"], 20 * 1200);
    assert!(stats["passes"].as_array().unwrap().len() > 1);
    let image = fluxion::image::io::read(&folder.path().join("a.exr"), &[]).unwrap();
    let expected = ["B", "G", "R", "error.B", "error.G", "error.R", "samples.Y"];
    assert!(expected.iter().all(|name| image.channels.iter().any(|channel| channel == name)), "{:?}", image.channels);
    let at = image.channels.iter().position(|name| name == "samples.Y").unwrap();
    let counts = image.data.iter().skip(at).step_by(image.channels.len());
    assert_eq!(counts.sum::<f32>(), 20.0 * 1200.0);
    assert_eq!(render(&["--spp", "20", "--adaptive", "variance"])["samples"], 20 * 1200);
    // With time to decide by it is the default, for methods that can.
    let passes = |extra: &[&str]| render(extra)["passes"].as_array().map_or(0, Vec::len);
    assert!(passes(&["--time", "1s"]) > 0 && passes(&["--time", "0.2s", "--adaptive", "uniform"]) > 0);
    let stats = render(&["--spp", "4000", "--target-error", "0.05"]);
    assert!(stats["samples"].as_u64().unwrap() < 4000 * 1200);
    for (extra, expected) in [
        (&["--adaptive", "nosuch"][..], "predicted_error"),
        (&["--adaptive", "--method", "l1"], "--adaptive variance"),
        (&["--target-error", "0"], "positive"),
        (&["--target-error", "0.1", "--method", "nlm"], "estimate its error"),
    ] {
        let mut command = fluxion(folder.path());
        command.args(["render", &scene("cornell-box"), "-o", "b.exr", "--size", "9x7", "--spp", "20"]).args(extra);
        let (code, text) = stderr(&mut command);
        assert!(code > 0 && text.contains(expected), "{extra:?}: {code} {text}");
        assert!(!folder.path().join("b.exr").exists());
    }
}
