//! `fluxion dataset`: files of a frame, prefixes of one render, and what happens to frames that are there.

use std::path::Path;

use assert_cmd::Command;
use fluxion::film::{Layer, exr};
use fluxion::image::io::read_color;
use serde_json::Value;

const SCENE: &str = "scenes/unit/occluder/scene.xml";

fn fluxion(args: &[&str]) -> Command {
    let mut command = Command::cargo_bin("fluxion").unwrap();
    command.args(args).arg("-q");
    command
}

fn made(folder: &Path, extra: &[&str]) -> assert_cmd::assert::Assert {
    let mut args =
        vec!["dataset", SCENE, "-o", folder.to_str().unwrap(), "--size", "20x12", "--spp", "4,2", "--reference", "8"];
    args.extend(extra);
    fluxion(&args).assert()
}

fn manifest(folder: &Path) -> Value {
    serde_json::from_str(&std::fs::read_to_string(folder.join("occluder.json")).unwrap()).unwrap()
}

/// Values of a file of single floats, and its header.
fn array(path: &Path) -> (String, Vec<f32>) {
    let bytes = std::fs::read(path).unwrap();
    let start = 10 + usize::from(u16::from_le_bytes([bytes[8], bytes[9]]));
    let values = bytes[start..].chunks_exact(4).map(|b| f32::from_le_bytes(b.try_into().unwrap())).collect();
    (String::from_utf8(bytes[10..start].to_vec()).unwrap(), values)
}

#[test]
fn arrays_hold_the_layers_of_a_render_and_the_images_of_methods() {
    let folder = tempfile::tempdir().unwrap();
    made(folder.path(), &["--method", "l2", "--method", "rdfc:window=2", "--layers", "features,gradients"]).success();
    let manifest = manifest(folder.path());
    let channels: Vec<_> = manifest["channels"].as_array().unwrap().iter().map(|name| name.as_str().unwrap()).collect();
    let seed = manifest["seed"].as_str().unwrap();
    assert_ne!(seed, manifest["target_seed"].as_str().unwrap());
    assert!(manifest["floor"].as_f64().unwrap() > 0.0);
    let layers = folder.path().join("layers.exr");
    for spp in [2, 4] {
        let (header, values) = array(&folder.path().join(format!("occluder_{spp:04}spp.npy")));
        assert!(header.contains(&format!("(12, 20, {}, )", channels.len())), "{header}");
        let (out, spp) = (folder.path().join("o.exr"), spp.to_string());
        let [out, saved] = [&out, &layers].map(|path| path.to_str().unwrap());
        let render = ["render", SCENE, "-o", out, "--layers", saved, "--size", "20x12", "--spp", &spp, "--seed", seed];
        fluxion(&render).args(["--method", "l2"]).assert().success();
        let (frame, image) = (exr::load(&layers).unwrap(), read_color(Path::new(out)).unwrap());
        let column = |name: &str| channels.iter().position(|other| *other == name).unwrap();
        for (name, layer, root) in
            [("G", Layer::Color, false), ("dx_sigma.G", Layer::DxVariance, true), ("normal.Y", Layer::Normal, false)]
        {
            let at = |i: usize| values[i * channels.len() + column(name)];
            let expected = |i: usize| frame.get(layer).unwrap().data[3 * i + 1];
            assert!((0..240).all(|i| at(i) == if root { expected(i).sqrt() } else { expected(i) }), "{name}");
        }
        assert!((0..240).all(|i| values[i * channels.len() + column("l2.G")] == image.data[3 * i + 1]));
        assert!(values.iter().all(|value| value.is_finite()) && column("rdfc_window_2_sigma.R") > 0);
    }
    let (header, target) = array(&folder.path().join("occluder_ref.npy"));
    assert!(header.contains("(12, 20, 6, )") && target.iter().sum::<f32>() > 0.0);
}

#[test]
fn frames_are_kept_only_if_that_is_asked_for_and_the_settings_are_the_same() {
    let folder = tempfile::tempdir().unwrap();
    made(folder.path(), &[]).success();
    let written = || std::fs::metadata(folder.path().join("occluder_ref.npy")).unwrap().modified().unwrap();
    let before = written();
    made(folder.path(), &["--resume"]).success();
    assert_eq!(written(), before);
    let refused = |extra: &[&str], why: &str| {
        let output = made(folder.path(), extra).failure().get_output().stderr.clone();
        assert!(String::from_utf8_lossy(&output).contains(why), "{}", String::from_utf8_lossy(&output));
    };
    refused(&[], "keep it with --resume");
    refused(&["--resume", "--seed", "7"], "other settings");
    refused(&["--resume", "--crop", "0,0,8x8"], "other settings");
    refused(&["--method", "l2", "--method", "l2"], "names of another");
    refused(&["--layout", "oidn", "--layers", "bins"], "albedo and normal only");
    refused(&[SCENE], "two scenes would be the frame occluder");
    refused(&["--method", "l3"], "`l3` is not known");
    std::fs::write(folder.path().join("occluder.json"), "{").unwrap();
    refused(&["--resume"], "occluder.json");
}

#[test]
fn images_are_those_that_open_image_denoise_is_trained_on() {
    let folder = tempfile::tempdir().unwrap();
    made(folder.path(), &["--layout", "oidn", "--half"]).success();
    for name in ["0002spp.hdr", "0002spp.alb", "0004spp.nrm", "ref.hdr"] {
        let image = read_color(&folder.path().join(format!("occluder_{name}.exr"))).unwrap();
        assert_eq!((image.width, image.height), (20, 12), "{name}");
        assert!(image.data.iter().any(|value| *value != 0.0), "{name}");
    }
}
