//! Camera samples in files: their means are the film's.

use std::fs;
use std::path::Path;

use assert_cmd::Command;
use fluxion::film::{Frame, Layer, STEPS};
use fluxion::image::Image;

/// Shape and values of an array, as NumPy reads it.
fn array(path: &Path) -> (Vec<usize>, Vec<f32>) {
    let bytes = fs::read(path).unwrap();
    assert_eq!(&bytes[..8], b"\x93NUMPY\x01\x00");
    let start = 10 + usize::from(u16::from_le_bytes([bytes[8], bytes[9]]));
    let header = std::str::from_utf8(&bytes[10..start]).unwrap();
    assert!(header.contains("'descr': '<f4', 'fortran_order': False"), "{header}");
    let shape = header.split_once('(').unwrap().1.split_once(')').unwrap().0;
    let shape: Vec<usize> = shape.split(',').filter_map(|length| length.trim().parse().ok()).collect();
    let values: Vec<f32> =
        bytes[start..].chunks_exact(4).map(|word| f32::from_le_bytes(word.try_into().unwrap())).collect();
    assert_eq!(values.len(), shape.iter().product::<usize>());
    (shape, values)
}

const SIZE: (usize, usize) = (37, 21);

/// Renders with samples and layers; the layers, and the folder of samples.
fn render(folder: &Path, scene: &str, extra: &[&str]) -> Frame {
    let scene = crate::common::root().join("scenes").join(scene).join("scene.xml");
    let mut command = Command::cargo_bin("fluxion").unwrap();
    command.current_dir(folder).arg("render").arg(scene).args(["-o", "a.exr", "-q", "--size", "37x21", "--spp", "6"]);
    command.args(["--samples", "s", "--layers", "l.exr"]).args(extra).assert().success();
    fluxion::exr::load(&folder.join("l.exr")).unwrap()
}

/// Means over the samples whose values are numbers.
fn means(values: &[f32], spp: usize) -> Vec<f64> {
    let stride = values.len() / spp;
    let of = |at: usize| {
        let finite: Vec<f64> =
            (0..spp).map(|k| values[k * stride + at]).filter(|v| v.is_finite()).map(f64::from).collect();
        finite.iter().sum::<f64>() / finite.len() as f64
    };
    (0..stride).map(of).collect()
}

fn check_close(name: &str, found: &[f64], expected: &[f32]) {
    assert_eq!(found.len(), expected.len(), "{name}");
    let most = expected.iter().fold(0.0f32, |most, value| most.max(value.abs()));
    let worst = found.iter().zip(expected).map(|(a, b)| (a - f64::from(*b)).abs()).fold(0.0, f64::max);
    assert!(worst <= 1e-6 * f64::from(most), "{name}: {worst} of {most}");
}

#[test]
fn means_of_samples_are_those_of_the_film() {
    let folder = tempfile::tempdir().unwrap();
    for (scene, method) in [("glossy-metal", "l2"), ("unit/lens", "l2"), ("cornell-box", "rdfc")] {
        let frame = render(folder.path(), scene, &["--method", method]);
        let of = |name: &str| array(&folder.path().join("s").join(format!("{name}.npy")));
        for (name, layer) in
            [("color", Layer::Color), ("direct", Layer::Direct), ("albedo", Layer::Albedo), ("depth", Layer::Depth)]
        {
            let (shape, values) = of(name);
            let expected = frame.get(layer).unwrap();
            assert_eq!(shape, [6, SIZE.1, SIZE.0, expected.channels]);
            // Directly seen emitters are averaged over a pixel's cells, in the same samples.
            check_close(&format!("{scene}: {name}"), &means(&values, 6), &expected.data);
        }
        let film = of("film");
        assert!(film.0 == [6, 2] && film.1.iter().all(|value| (0.0..1.0).contains(value)));
        let description: serde_json::Value =
            serde_json::from_str(&fs::read_to_string(folder.path().join("s/samples.json")).unwrap()).unwrap();
        let files: Vec<_> =
            description["arrays"].as_array().unwrap().iter().map(|entry| entry["file"].as_str().unwrap()).collect();
        assert_eq!((description["taken"].as_u64(), files.contains(&"differences.npy")), (Some(6), method == "l2"));
        for file in files {
            let shape: Vec<usize> = array(&folder.path().join("s").join(file)).0;
            let entry = description["arrays"].as_array().unwrap().iter().find(|entry| entry["file"] == file).unwrap();
            assert_eq!(entry["shape"], serde_json::json!(shape), "{file}");
        }
        fs::remove_dir_all(folder.path().join("s")).unwrap();
    }
}

#[test]
fn differences_of_samples_add_up_to_the_edges() {
    let folder = tempfile::tempdir().unwrap();
    for kernel in ["cross", "structure:k=5"] {
        let frame = render(folder.path(), "glossy-metal", &["--method", "l2", "--kernel", kernel, "--pilot", "2"]);
        let of = |name: &str| array(&folder.path().join("s").join(format!("{name}.npy")));
        let ((shape, values), (_, masks)) = (of("differences"), of("neighbours"));
        let slots = shape[3];
        let row = SIZE.0 * SIZE.1 * slots * 3;
        let pilot = if kernel == "cross" { 0 } else { 2 };
        for (k, sample) in values.chunks_exact(row).enumerate() {
            assert!(sample.iter().all(|value| value.is_nan() == (k < pilot)), "{kernel}: sample {k}");
        }
        let means = means(&values, 6);
        let at = |pixel: usize, step: usize, c: usize| {
            let slot = (masks[pixel] as u32 & ((1 << step) - 1)).count_ones() as usize;
            means[(pixel * slots + slot) * 3 + c]
        };
        let edges = frame.edges(Default::default()).unwrap();
        assert!(edges.len() > 1000, "{}", edges.len());
        let (mut found, mut expected) = (Vec::new(), Vec::new());
        for edge in 0..edges.len() {
            let [lower, higher] = edges.ends(edge);
            let step = STEPS.iter().position(|step| *step == edges.offsets()[edges.kind(edge)]).unwrap();
            found.extend((0..3).map(|c| at(lower, step, c) - at(higher, step ^ 1, c)));
            expected.extend(edges.mean[edge].to_array());
        }
        check_close(kernel, &found, &expected);
        fs::remove_dir_all(folder.path().join("s")).unwrap();
    }
}

#[test]
fn surfaces_say_how_they_scatter() {
    let folder = tempfile::tempdir().unwrap();
    // Diffuse, glossy, specular, reflection, transmission, emission.
    let share = |kinds: &Image, kind: usize| {
        kinds.data.iter().skip(kind).step_by(6).sum::<f32>() / (kinds.width * kinds.height) as f32
    };
    for (scene, least, most) in [
        ("cornell-box", [0.8, 0.0, 0.0, 0.7, 0.0, 0.0], [1.0, 0.0, 0.0, 1.0, 0.0, 0.2]),
        ("unit/rough-conductor", [0.0, 0.05, 0.0, 0.3, 0.0, 0.0], [1.0, 1.0, 0.0, 1.0, 0.0, 0.2]),
        ("unit/sphere-light", [0.1, 0.0, 0.0, 0.1, 0.0, 0.001], [1.0, 1.0, 0.0, 1.0, 0.0, 0.5]),
        ("unit/dielectric", [0.0, 0.0, 0.05, 0.1, 0.01, 0.0], [1.0, 0.0, 1.0, 1.0, 1.0, 0.2]),
    ] {
        render(folder.path(), scene, &["--method", "primal"]);
        let of = |name: &str| array(&folder.path().join("s").join(format!("{name}.npy")));
        let (shape, values) = of("scattering");
        let data: Vec<f32> = means(&values, shape[0]).iter().map(|&value| value as f32).collect();
        let kinds = Image { width: SIZE.0, height: SIZE.1, channels: 6, data };
        for kind in 0..6 {
            let share = share(&kinds, kind);
            assert!((least[kind]..=most[kind]).contains(&share), "{scene}: kind {kind} has {share}");
        }
        let (normals, roughness) = (of("normal").1, of("roughness").1);
        // Towards the viewer, or nothing is there.
        let towards = |n: &[f32]| {
            n.iter().all(|&v| v == 0.0) || (n.iter().map(|v| v * v).sum::<f32>() - 1.0).abs() < 1e-4 && n[2] < 0.3
        };
        assert!(normals.chunks_exact(3).all(towards), "{scene}");
        assert!(roughness.iter().all(|value| (0.0..=1.0).contains(value)));
        fs::remove_dir_all(folder.path().join("s")).unwrap();
    }
}

#[test]
fn samples_want_a_fixed_number_and_a_folder_that_can_be_made() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("file"), "").unwrap();
    let scene = crate::common::root().join("scenes/unit/diffuse/scene.xml");
    for (extra, expected) in [(&["--samples", "s", "--time", "1s"][..], "--time"), (&["--samples", "file"], "file")] {
        let mut command = Command::cargo_bin("fluxion").unwrap();
        command.current_dir(folder.path()).arg("render").arg(&scene).args(["-o", "a.exr", "-q", "--size", "8x8"]);
        let output = command.args(extra).output().unwrap();
        let message = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(!output.status.success() && message.contains(expected), "{message}");
    }
}
