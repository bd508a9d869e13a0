//! A thousand damaged files for every reader: each is read or refused, soon and in little memory, without a panic.

use std::fs;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;
use std::time::Instant;

use crate::common::{bundled, film};
use fluxion::checkpoint::{self, Origin, Run};
use fluxion::film::{Needs, exr};
use fluxion::image::io;
use fluxion::internals::math::rng;
use fluxion::mitsuba::{self, mesh};
use fluxion::pipeline::peak_bytes;
use fluxion::render::{RenderOutcome, Shift};

const FILES: u64 = 1000;

/// Runs the readers one after the other in a process of their own, whose peak of memory is that of the readers.
#[test]
fn readers_survive_damaged_files() {
    let program = std::env::current_exe().unwrap();
    let arguments = ["corrupt::", "--ignored", "--test-threads=1"];
    let output = std::process::Command::new(program).args(arguments).output().unwrap();
    let text = String::from_utf8_lossy(&output.stdout);
    assert!(output.status.success(), "{text}{}", String::from_utf8_lossy(&output.stderr));
    assert!(text.contains("4 passed"), "{text}");
}

/// A file with one to eight mistakes: bits, bytes, numbers, lost, doubled and moved pieces, and an early end.
fn damage(original: &[u8], seed: u64) -> Vec<u8> {
    let mut bytes = original.to_vec();
    let mut draws = 0;
    let mut draw = |most: usize| {
        draws += 1;
        (rng::combine(rng::mix(seed), draws) % most.max(1) as u64) as usize
    };
    for _ in 0..=draw(8) {
        if bytes.is_empty() {
            break;
        }
        // Half of the mistakes are near the beginning, where headers are.
        let reach = if draw(2) == 0 { bytes.len() } else { bytes.len().min(400) };
        let (at, length) = (draw(reach), 1 + draw(64));
        let end = bytes.len().min(at + length);
        match draw(7) {
            0 => bytes[at] ^= 1 << draw(8),
            1 => bytes[at] = [0, 1, 127, 128, 255, b'-', b'9', b'<'][draw(8)],
            2 => bytes.truncate(at),
            3 => drop(bytes.drain(at..end)),
            4 => {
                let piece = bytes[at..end].to_vec();
                let to = draw(bytes.len());
                bytes.splice(to..to, piece);
            }
            5 => bytes[at..end].fill(0xff),
            _ => {
                let number = ["1e38", "-1", "4294967295", "nan", "0", "99999999999999999999"][draw(6)];
                bytes.splice(at..end.min(at + 4), number.bytes());
            }
        }
    }
    bytes
}

/// Has a reader read damaged files; `read` says whether it took one.
fn check(name: &str, original: &[u8], mut read: impl FnMut(&[u8]) -> bool) {
    assert!(read(original), "{name}: the original is fine");
    let before = peak_bytes();
    let mut taken = 0;
    for seed in 0..FILES {
        let bytes = damage(original, seed);
        let start = Instant::now();
        match catch_unwind(AssertUnwindSafe(|| read(&bytes))) {
            Ok(ok) => taken += u32::from(ok),
            Err(_) => {
                let path = std::env::temp_dir().join(format!("damaged-{seed}-{name}"));
                fs::write(&path, &bytes).unwrap();
                panic!("{name}: a panic over {}", path.display());
            }
        }
        assert!(start.elapsed().as_secs() < 10, "{name} {seed}: {:?}", start.elapsed());
    }
    let more = peak_bytes().saturating_sub(before) >> 20;
    assert!(more < 1024, "{name}: {more} MB");
    assert!(taken < FILES as u32, "{name}: mistakes are found");
}

fn asset(name: &str) -> Vec<u8> {
    fs::read(crate::common::root().join("scenes/assets").join(name)).unwrap()
}

#[test]
#[ignore = "run by `readers_survive_damaged_files`, in a process of its own"]
fn scenes() {
    let options = mitsuba::Options { threads: 1, size: Some((4, 4)), ..mitsuba::Options::default() };
    for name in ["cornell-box", "unit/textures", "unit/principled", "unit/instances"] {
        let folder = crate::common::root().join("scenes").join(name);
        let text = fs::read_to_string(folder.join("scene.xml")).unwrap();
        let scenes = crate::common::root().join("scenes").display().to_string();
        let text = text.replace("../../assets", "ASSETS").replace("../assets", "ASSETS");
        let text = text.replace("ASSETS", &format!("{scenes}/assets"));
        check(&name.replace('/', "-"), text.as_bytes(), |bytes| {
            let Ok(text) = std::str::from_utf8(bytes) else { return false };
            // Any scene that is taken can be traced.
            mitsuba::load_text(text, &options).is_ok_and(|scene| film(&scene, 1, 1, Needs::ALL).samples() > 0)
        });
    }
}

#[test]
#[ignore = "run by `readers_survive_damaged_files`, in a process of its own"]
fn meshes() {
    let obj = b"v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 1\nvt 1 1\nvn 0 0 1\nf 1/1/1 2/2/1 -1/1/1\nf 1 2 3 4\nf 1//1 2//1 3//1\n";
    for (name, format, bytes) in [
        ("a.obj", "obj", obj.to_vec()),
        ("torus_binary.ply", "ply", asset("torus_binary.ply")),
        ("torus_colors.ply", "ply", asset("torus_colors.ply")),
        ("torus.serialized", "serialized", asset("torus.serialized")),
    ] {
        check(name, &bytes, |bytes| mesh::read(format, bytes, 0, Path::new(name)).is_ok());
    }
}

#[test]
#[ignore = "run by `readers_survive_damaged_files`, in a process of its own"]
fn layers_and_images() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("layers.exr");
    exr::save(&path, &film(&bundled("unit/diffuse", (19, 17)), 9, 1, Needs::ALL).develop()).unwrap();
    check("layers.exr", &fs::read(&path).unwrap(), |bytes| {
        fs::write(&path, bytes).unwrap();
        exr::load(&path).is_ok()
    });
    let image =
        fluxion::image::Image::from_rgb(40, 30, |x, y| fluxion::internals::math::vec3(x as f32, y as f32, 9.0) / 40.0);
    for name in ["a.exr", "a.hdr", "a.png", "a.jpg"] {
        let path = folder.path().join(name);
        io::write_color(&path, &image, &io::Extras::default()).unwrap();
        check(name, &fs::read(&path).unwrap(), |bytes| {
            fs::write(&path, bytes).unwrap();
            // Pixels of formats without checksums may be damaged and nobody can know.
            io::read_color(&path).is_ok()
        });
    }
}

#[test]
#[ignore = "run by `readers_survive_damaged_files`, in a process of its own"]
fn checkpoints() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.ckpt");
    let scene = bundled("unit/diffuse", (19, 17));
    let mut outcome = RenderOutcome::new(&scene, Needs::ALL);
    outcome.film = film(&scene, 9, 1, Needs::ALL);
    let origin = Origin {
        version: "1".into(),
        epoch: fluxion::render::EPOCH,
        scene: "scene.xml".into(),
        content: "0".into(),
        fingerprint: "0".into(),
        method: "frgr".into(),
        plan: "+gradients".into(),
        size: (19, 17),
        needs: Needs::ALL,
        shift: Shift::default(),
        kernel: fluxion::neighbours::Selector::default(),
        lights: Vec::new(),
        runs: vec![Run { seed: 1, first: 0, samples: 9 }],
    };
    checkpoint::save(&path, &origin, &outcome, None).unwrap();
    let original = fs::read(&path).unwrap();
    check("a.ckpt", &original, |bytes| {
        fs::write(&path, bytes).unwrap();
        // Whatever is taken is the original: the checksum sees to it.
        checkpoint::load(&path).is_ok_and(|found| found.outcome.film == outcome.film && bytes == original)
    });
    // With a right checksum nothing is read that the rest does not support, either.
    let forged = |bytes: &[u8]| {
        let content = &bytes[..bytes.len().saturating_sub(4)];
        let mut sum = crc32fast::Hasher::new();
        sum.update(content);
        [content, &sum.finalize().to_le_bytes()].concat()
    };
    check("forged.ckpt", &original, |bytes| {
        fs::write(&path, forged(bytes)).unwrap();
        checkpoint::load(&path).is_ok_and(|found| found.outcome.film.develop().width == 19)
    });
}
