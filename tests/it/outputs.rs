//! The files that the program writes, and what it says to whom.

use crate::cli::{fluxion, scene, stderr};
use fluxion::image::io::read_color;

/// A round thing on a transparent ground.
const ALPHA: &str = "<scene version=\"3.0.0\"><integrator type=\"path\"><boolean name=\"hide_emitters\" value=\"true\"/>\
    </integrator><sensor type=\"perspective\"><transform name=\"to_world\"><lookat origin=\"0,0,5\" target=\"0,0,0\" \
    up=\"0,1,0\"/></transform><film type=\"hdrfilm\"><integer name=\"width\" value=\"24\"/><integer name=\"height\" \
    value=\"24\"/><string name=\"pixel_format\" value=\"rgba\"/></film></sensor><shape type=\"sphere\"/><emitter \
    type=\"constant\"/></scene>";

#[test]
fn alpha_goes_with_the_colours_into_every_file_that_can_hold_it() {
    use fluxion::image::io::read_picture;
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("s.xml"), ALPHA).unwrap();
    let outputs = ["-o", "a.exr", "-o", "a.png", "-o", "a.tiff", "-o", "a.jpg", "--layers", "l.exr"];
    fluxion(folder.path()).args(["render", "s.xml", "--spp", "64", "-q"]).args(outputs).assert().success();
    let alpha = |name: &str| read_picture(&folder.path().join(name)).unwrap().alpha;
    assert!(alpha("a.jpg").is_none());
    for name in ["a.exr", "a.png", "a.tiff", "l.exr"] {
        let alpha = alpha(name).unwrap_or_else(|| panic!("{name} has no alpha"));
        let mean = alpha.data.iter().sum::<f32>() / 576.0;
        assert!(alpha.pixel(12, 12)[0] > 0.99 && alpha.pixel(0, 0)[0] < 0.01, "{name}");
        assert!((mean - 0.349).abs() < 0.01, "{name}: {mean}");
    }
    // Colours are as bright where half of the pixel is covered, since png has them without alpha.
    let png = fluxion::image::io::read(&folder.path().join("a.png"), &[]).unwrap();
    let edge = png.data.chunks_exact(4).find(|pixel| pixel[3] > 0.3 && pixel[3] < 0.7).unwrap();
    assert!(edge[0] > 0.5, "{edge:?}");
    for method in ["primal", "nlm", "rdfc"] {
        let arguments = ["reconstruct", "l.exr", "-o", "r.exr", "--method", method, "-q"];
        fluxion(folder.path()).args(arguments).assert().success();
        let picture = read_picture(&folder.path().join("r.exr")).unwrap();
        let mean = picture.alpha.unwrap().data.iter().sum::<f32>() / 576.0;
        assert!((mean - 0.349).abs() < 0.01, "{method}: {mean}");
    }
    let output = fluxion(folder.path()).args(["compare", "a.png", "a.exr", "--html", "p.html"]).output().unwrap();
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    let row = text.lines().find(|line| line.trim_start().starts_with("alpha")).unwrap();
    assert!(row.split_whitespace().nth(1).unwrap().parse::<f64>().unwrap() < 0.005, "{row}");
    // Without `rgba` there is no alpha.
    std::fs::write(folder.path().join("s.xml"), ALPHA.replace("rgba", "rgb")).unwrap();
    fluxion(folder.path()).args(["render", "s.xml", "--spp", "4", "-q", "-o", "b.exr"]).assert().success();
    assert!(alpha("b.exr").is_none());
}

#[test]
fn a_part_of_the_film_is_written_as_that_part() {
    let folder = tempfile::tempdir().unwrap();
    let render = |output: &str, extra: &[&str]| {
        let arguments = ["-o", output, "--size", "40x40", "--spp", "64", "-q", "--method", "primal"];
        let mut command = fluxion(folder.path());
        command.args(["render", &scene("cornell-box")]).args(arguments).args(extra).assert().success();
    };
    render("all.exr", &[]);
    render("part.exr", &["--crop", "10,20,16x12", "--layers", "l.exr"]);
    fluxion(folder.path())
        .args(["reconstruct", "l.exr", "-o", "again.exr", "-q", "--method", "rdfc"])
        .assert()
        .success();
    let all = read_color(&folder.path().join("all.exr")).unwrap();
    for name in ["part.exr", "again.exr"] {
        let file = fluxion::image::io::read(&folder.path().join(name), &[]).unwrap();
        let window = file.window.expect("it is a part");
        assert_eq!((window.origin, window.full, file.width, file.height), ((10, 20), (40, 40), 16, 12));
        let part = read_color(&folder.path().join(name)).unwrap();
        let pixels = (0..16 * 12).map(|i| (i % 16, i / 16));
        let apart: f32 = pixels.map(|(x, y)| (part.rgb(x, y) - all.rgb(x + 10, y + 20)).length()).sum();
        assert!(apart / 192.0 < 0.2, "{name}: {}", apart / 192.0);
    }
    let beyond = ["render", &scene("cornell-box"), "-o", "b.exr", "--size", "40x40", "--crop", "30,0,20x20"];
    let (code, text) = stderr(fluxion(folder.path()).args(beyond));
    assert!(code == 2 && text.contains("a crop window of 20x20 at 30,0 in a film of 40x40"), "{text}");
}

#[test]
fn exposure_brightens_pictures_for_displays_only() {
    let folder = tempfile::tempdir().unwrap();
    let render = |name: &str, exposure: &str| {
        let arguments = ["-o", name, "--size", "16x16", "--spp", "4", "-q", "--exposure", exposure];
        fluxion(folder.path()).args(["render", &scene("cornell-box")]).args(arguments).assert().success();
        read_color(&folder.path().join(name)).unwrap()
    };
    assert_eq!(render("a.exr", "0"), render("b.exr", "-2"));
    let (plain, darker) = (render("a.png", "0"), render("b.png", "-1"));
    let pairs = plain.data.iter().zip(&darker.data).filter(|(plain, _)| (0.1..0.9).contains(*plain));
    assert!(pairs.clone().count() > 50);
    pairs.for_each(|(plain, darker)| assert!((darker / plain - 0.5).abs() < 0.05, "{plain} {darker}"));
}

#[cfg(unix)]
#[test]
fn readers_may_go_away_and_disks_be_full() {
    use std::os::unix::fs::PermissionsExt;
    let folder = tempfile::tempdir().unwrap();
    let program = assert_cmd::cargo::cargo_bin("fluxion").display().to_string();
    let shell = |line: &str| {
        let line = line.replace("FLUXION", &program).replace("SCENE", &scene("cornell-box"));
        let output =
            std::process::Command::new("bash").current_dir(folder.path()).args(["-c", &line]).output().unwrap();
        (output.status.code(), String::from_utf8_lossy(&output.stderr).into_owned())
    };
    shell("umask 027; FLUXION render SCENE -o a.exr -o a.png --size 8x8 --spp 1 -q");
    for name in ["a.exr", "a.png"] {
        let mode = std::fs::metadata(folder.path().join(name)).unwrap().permissions().mode();
        assert_eq!(mode & 0o777, 0o640, "{name}");
    }
    for command in
        ["info --plugins", "info SCENE", "info --methods", "compare a.exr a.exr", "stress --list", "merge --help"]
    {
        let (code, text) = shell(&format!("set -o pipefail; FLUXION {command} | head -c 1 > /dev/null"));
        assert!(code == Some(0) && text.is_empty(), "{command}: {code:?} {text}");
        if command != "merge --help" {
            let (code, text) = shell(&format!("FLUXION {command} > /dev/full"));
            assert!(code == Some(1) && text.contains("standard output: No space left"), "{command}: {code:?} {text}");
        }
    }
    let (code, text) =
        shell("FLUXION render SCENE -o b.exr --size 8x8 --spp 1 2>&1 >/dev/null | head -c 0; exit ${PIPESTATUS[0]}");
    assert!(code == Some(0) && folder.path().join("b.exr").exists(), "{code:?} {text}");
}

#[test]
fn a_dash_is_standard_output() {
    let folder = tempfile::tempdir().unwrap();
    let arguments = ["-o", "a.exr", "--size", "8x8", "--spp", "2", "-q", "--json", "-"];
    let output = fluxion(folder.path()).args(["render", &scene("cornell-box")]).args(arguments).output().unwrap();
    let stats: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(stats["spp"].as_u64(), Some(2));
    assert!(!folder.path().join("-").exists());
    let output = fluxion(folder.path()).args(["compare", "a.exr", "a.exr", "--json=-"]).output().unwrap();
    assert!(serde_json::from_slice::<serde_json::Value>(&output.stdout).is_ok());
}

#[test]
fn windows_with_overscan_fit_together() {
    let folder = tempfile::tempdir().unwrap();
    let scene = crate::common::root().join("scenes/cornell-box/scene.xml").display().to_string();
    let render = |name: &str, more: &[&str]| {
        let command = ["render", &scene, "--spp", "8", "--method", "frgr", "-q", "--size", "48x32", "-o", name];
        crate::cli::fluxion(folder.path()).args(command).args(more).assert().success();
        fluxion::image::io::read(&folder.path().join(name), &[]).unwrap()
    };
    let whole = render("whole.exr", &[]);
    let (plain, wide) = (
        render("plain.exr", &["--crop", "16,8,16x16"]),
        render("wide.exr", &["--crop", "16,8,16x16", "--overscan", "100", "--cryptomatte", "mattes.exr"]),
    );
    let mattes = fluxion::image::io::read(&folder.path().join("mattes.exr"), &[]).unwrap();
    assert_eq!((wide.width, wide.height, wide.window), (16, 16, plain.window));
    assert_eq!((mattes.width, mattes.height, mattes.window), (16, 16, plain.window));
    let red = |pixels: &fluxion::image::io::Pixels, x: usize, y: usize| {
        let at = pixels.channels.iter().position(|name| name == "R").unwrap();
        pixels.data[(y * pixels.width + x) * pixels.channels.len() + at]
    };
    let apart = |pixels: &fluxion::image::io::Pixels| {
        let all = (0..16 * 16).map(|i| (i % 16, i / 16));
        all.map(|(x, y)| (red(pixels, x, y) / red(&whole, x + 16, y + 8) - 1.0).abs()).fold(0.0, f32::max)
    };
    // Around it is the whole film.
    assert!(apart(&wide) == 0.0 && apart(&plain) > 0.01, "{} {}", apart(&wide), apart(&plain));
}
