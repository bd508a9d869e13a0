//! Renders as on processors with narrower vector instructions than this one has.

use std::path::{Path, PathBuf};

use fluxion::image::Image;
use fluxion::image::io::read_color;

use crate::cli::fluxion;
use crate::common::root;

/// Scene files of all bundled scenes.
fn scenes() -> Vec<PathBuf> {
    let pattern = root().join("scenes/**/scene.xml");
    let found: Vec<_> = glob::glob(&pattern.to_string_lossy()).unwrap().map(Result::unwrap).collect();
    assert!(found.len() >= 20, "{found:?}");
    found
}

/// A small image with differences; `embree` configures its device, `lanes` are the widest ones, of all if they are empty.
fn image(scene: &Path, embree: &str, lanes: &str) -> Image {
    let folder = tempfile::tempdir().unwrap();
    let output = folder.path().join("a.exr");
    let mut command = fluxion(folder.path());
    command.arg("render").arg(scene).arg("-o").arg(&output).env("FLUXION_EMBREE", embree);
    command.args(["--size", "19x15", "--spp", "2", "--method", "l2", "--threads", "1", "--quiet"]);
    if !lanes.is_empty() {
        command.env("FLUXION_LANES", lanes);
    }
    command.assert().success();
    read_color(&output).unwrap()
}

/// Share of the pixels of which a channel differs by more than a thousandth of the mean.
fn apart(a: &Image, b: &Image) -> f64 {
    let mean = a.data.iter().sum::<f32>() / a.data.len() as f32;
    let differs = |(a, b): (&[f32], &[f32])| a.iter().zip(b).any(|(a, b)| (a - b).abs() > 1e-3 * mean);
    let pixels = a.data.chunks_exact(3).zip(b.data.chunks_exact(3));
    pixels.filter(|&pair| differs(pair)).count() as f64 / (a.width * a.height) as f64
}

#[test]
fn every_processor_renders_the_same() {
    for scene in scenes() {
        let found = image(&scene, "", "");
        for (isa, lanes) in [("isa=sse4.2", "baseline"), ("isa=avx2", "avx2")] {
            let (wide, narrow) = (image(&scene, isa, ""), image(&scene, isa, lanes));
            assert_eq!(wide.data, narrow.data, "{} with {isa} and lanes of {lanes}", scene.display());
            // Embree's distances differ by rounding: few paths go elsewhere.
            let apart = apart(&found, &wide);
            assert!(apart < 0.05, "{} with {isa}: {apart} of the pixels differ", scene.display());
        }
    }
}

#[test]
fn a_processor_that_is_not_known_is_an_error() {
    let mut command = fluxion(&root());
    let failed = command.args(["info", "--methods"]).env("FLUXION_LANES", "sse9").assert().failure().code(1);
    let message = String::from_utf8_lossy(&failed.get_output().stderr).into_owned();
    assert!(message.contains("FLUXION_LANES=sse9 is not known; there are baseline, avx2, avx512"), "{message}");
}
