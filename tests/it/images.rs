//! Image files of several parts and view layers, and frames of other programs, through the program.

use std::path::{Path, PathBuf};

use exr::image::{AnyChannel, AnyChannels, Encoding, FlatSamples, Image, Layer};
use exr::meta::attribute::{IntegerBounds, Text};
use exr::meta::header::{ImageAttributes, LayerAttributes};
use exr::prelude::WritableImage;
use fluxion::image::io::{self, DataWindow, Kind, Pixels, read_color};
use tempfile::TempDir;

/// Pixels of a side of all images.
const SIDE: usize = 24;

/// A part of a file: its name, and its channels with the values of all their pixels.
type Part<'a> = (&'a str, &'a [(&'a str, f32)]);

fn value(base: f32, i: usize) -> f32 {
    // Some noise, the same in every channel.
    base * (1.0 + 0.2 * (i as f32 * 12.9898).sin())
}

/// Writes an exr file of several parts.
fn write(path: &Path, parts: &[Part], noisy: bool) {
    let layer = |(name, channels): &Part| {
        let list = channels.iter().map(|(channel, base)| {
            let values = (0..SIDE * SIDE).map(|i| if noisy { value(*base, i) } else { *base });
            AnyChannel::new(*channel, FlatSamples::F32(values.collect()))
        });
        let attributes = LayerAttributes::named(Text::from(*name));
        Layer::new((SIDE, SIDE), attributes, Encoding::UNCOMPRESSED, AnyChannels::sort(list.collect()))
    };
    let layers: Vec<_> = parts.iter().map(layer).collect();
    let bounds = IntegerBounds::from_dimensions((SIDE, SIDE));
    Image::from_layers(ImageAttributes::new(bounds), layers).write().to_file(path).unwrap();
}

fn fluxion(folder: &TempDir, arguments: &[&str]) -> (bool, String) {
    let output = crate::cli::fluxion(folder.path()).args(arguments).output().unwrap();
    (output.status.success(), String::from_utf8_lossy(&output.stderr).into_owned())
}

fn mean(path: PathBuf) -> [f32; 3] {
    let image = read_color(&path).unwrap();
    let pixels = (image.width * image.height) as f32;
    [0, 1, 2].map(|c| image.data.iter().skip(c).step_by(3).sum::<f32>() / pixels)
}

fn near(found: [f32; 3], expected: [f32; 3]) -> bool {
    found.iter().zip(expected).all(|(a, b)| (a - b).abs() <= 0.02 * b.abs())
}

#[test]
fn colours_are_found_in_any_part() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.exr");
    let (depth, normal) = (("depth", &[("Z", 7.0)][..]), ("N", &[("X", 0.0), ("Y", 0.0), ("Z", 1.0)][..]));
    let rgb: &[(&str, f32)] = &[("R", 0.5), ("G", 0.25), ("B", 2.0)];
    for parts in [vec![depth, ("beauty", rgb)], vec![normal, depth, ("main", rgb)], vec![("rgba", rgb), depth]] {
        write(&path, &parts, false);
        assert_eq!(mean(path.clone()), [0.5, 0.25, 2.0], "{parts:?}");
    }
    for parts in [vec![depth], vec![depth, normal], vec![("one", rgb), ("other", rgb)]] {
        write(&path, &parts, false);
        let message = read_color(&path).unwrap_err().to_string();
        assert!(parts.iter().all(|(name, _)| parts.len() == 1 || message.contains(name)), "{message}");
    }
}

#[test]
fn frames_of_several_parts_are_reconstructed() {
    let folder = tempfile::tempdir().unwrap();
    let rgb: &[(&str, f32)] = &[("R", 0.5), ("G", 0.25), ("B", 2.0)];
    let albedo: &[(&str, f32)] = &[("R", 0.5), ("G", 0.5), ("B", 0.5)];
    let variance: &[(&str, f32)] = &[("R", 0.16), ("G", 0.04), ("B", 2.6)];
    let normal: &[(&str, f32)] = &[("X", 0.0), ("Y", 0.0), ("Z", 1.0)];
    let parts = [("albedo", albedo), ("N", normal), ("rgba", rgb), ("variance", variance)];
    write(&folder.path().join("a.exr"), &parts, true);
    let (done, message) = fluxion(&folder, &["reconstruct", "a.exr", "-o", "r.exr", "--method", "nlm", "--spp", "16"]);
    assert!(done && message.is_empty(), "{message}");
    assert!(near(mean(folder.path().join("r.exr")), [0.5, 0.25, 2.0]));
    // Without features, by the colour alone; the alpha has no variance and is taken as it is.
    let parts = [("rgba", &[rgb, &[("A", 0.5)]].concat()[..]), ("variance", variance)];
    write(&folder.path().join("a.exr"), &parts, true);
    let (done, message) = fluxion(&folder, &["reconstruct", "a.exr", "-o", "r.exr", "--method", "nlm", "--spp", "16"]);
    assert!(done && message.contains("the frame lacks albedo, normal: nlm works without"), "{message}");
    let (done, message) = fluxion(&folder, &["reconstruct", "a.exr", "-o", "r.exr", "--spp", "16"]);
    assert!(!done && message.contains("Methods that work on this file: primal, nlm"), "{message}");
}

#[test]
fn of_several_view_layers_the_first_or_the_one_asked_for_is_taken() {
    let folder = tempfile::tempdir().unwrap();
    let view =
        |name: &str, scale: f32| ["R", "G", "B"].map(|channel| (format!("{name}.Combined.{channel}"), scale)).to_vec();
    let channels = [view("back", 2.0), view("front", 1.0)].concat();
    let channels: Vec<_> = channels.iter().map(|(name, value)| (name.as_str(), *value)).collect();
    write(&folder.path().join("a.exr"), &[("", &channels)], false);
    let run = |more: &[&str]| {
        let command = ["reconstruct", "a.exr", "-o", "r.exr", "--method", "primal", "--spp", "4"];
        fluxion(&folder, &[&command[..], more].concat())
    };
    let (done, message) = run(&[]);
    assert!(done && message.contains("has the view layers back, front: `back` is taken"), "{message}");
    assert_eq!(mean(folder.path().join("r.exr")), [2.0; 3]);
    let (done, message) = run(&["--view-layer", "front"]);
    assert!(done && message.is_empty(), "{message}");
    assert_eq!(mean(folder.path().join("r.exr")), [1.0; 3]);
    // A compositor's picture is no view layer of its own.
    let channels = [view("Composite", 9.0), view("Scene", 3.0)].concat();
    let channels: Vec<_> = channels.iter().map(|(name, value)| (name.as_str(), *value)).collect();
    write(&folder.path().join("c.exr"), &[("", &channels)], false);
    let command = ["reconstruct", "c.exr", "-o", "r.exr", "--method", "primal", "--spp", "4"];
    assert_eq!(fluxion(&folder, &command), (true, String::new()));
    assert_eq!(mean(folder.path().join("r.exr")), [3.0; 3]);
    assert_eq!(mean(folder.path().join("c.exr")), [3.0; 3]);
    let (done, message) = run(&["--view-layer", "side"]);
    assert!(!done && message.contains("no view layer `side`; it has back, front"), "{message}");
    assert!(read_color(&folder.path().join("a.exr")).is_err());
}

#[test]
fn faults_are_found_before_the_work_and_named() {
    let folder = tempfile::tempdir().unwrap();
    let scene = crate::common::root().join("scenes/unit/diffuse/scene.xml").display().to_string();
    for option in ["--layers", "--cryptomatte"] {
        let arguments = ["render", &scene, "-o", "a.exr", "--spp", "1000000", option, "a.png"];
        let (done, message) = fluxion(&folder, &arguments);
        assert!(!done && message.contains("a.png: layers are written to exr files only"), "{message}");
    }
    std::fs::write(folder.path().join("empty.ckpt"), "").unwrap();
    for arguments in
        [&["reconstruct", "empty.ckpt", "-o", "a.exr"][..], &["merge", "empty.ckpt", "empty.ckpt", "-o", "b.ckpt"]]
    {
        let (done, message) = fluxion(&folder, arguments);
        assert!(!done && message.contains("empty.ckpt") && message.contains("is empty"), "{message}");
    }
    let rgb = |value| [("R", value), ("G", 1.0), ("B", 1.0)];
    write(&folder.path().join("good.exr"), &[("", &rgb(1.0))], false);
    write(&folder.path().join("bad.exr"), &[("", &rgb(f32::NAN))], false);
    let (done, message) = fluxion(&folder, &["compare", "good.exr", "bad.exr"]);
    assert!(!done && message.contains("bad.exr: R is not finite at pixel 0,0"), "{message}");
    // Parts of a picture at different places in it.
    for (name, x) in [("left.exr", 0), ("right.exr", 8)] {
        let (width, height, channels) = (4, 4, ["R", "G", "B"].map(String::from).to_vec());
        let window = Some(DataWindow { origin: (x, 0), full: (16, 4) });
        let pixels = Pixels { width, height, channels, data: vec![1.0; 48], window, ..Pixels::default() };
        io::write(&folder.path().join(name), &pixels, Kind::Float, None).unwrap();
    }
    let (done, message) = fluxion(&folder, &["compare", "left.exr", "right.exr"]);
    assert!(done && message.contains("left.exr and right.exr are different windows of a picture"), "{message}");
    assert_eq!(fluxion(&folder, &["compare", "left.exr", "left.exr"]).1, "");
}
