//! References and benchmarks as a user makes them.

use std::path::Path;

use assert_cmd::Command;
use fluxion::bench::Results;
use fluxion::error::Error;
use fluxion::image::io::{Kind, read, write};
use fluxion::mitsuba;
use fluxion::reference::Reference;
use fluxion::render::Control;

fn scene(name: &str) -> String {
    format!("{}/scenes/{name}/scene.xml", env!("CARGO_MANIFEST_DIR"))
}

fn fluxion(folder: &Path, arguments: &[&str]) -> (i32, String, String) {
    let mut command = Command::cargo_bin("fluxion").unwrap();
    let output = command.current_dir(folder).args(arguments).output().unwrap();
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    (output.status.code().unwrap_or(-1), text(&output.stdout), text(&output.stderr))
}

fn succeed(folder: &Path, arguments: &[&str]) -> String {
    let (code, output, errors) = fluxion(folder, arguments);
    assert_eq!(code, 0, "{arguments:?}: {errors}");
    output
}

fn make_reference(folder: &Path, name: &str, size: &str) {
    std::fs::create_dir_all(folder.join("references")).unwrap();
    let file = format!("references/{name}.exr");
    succeed(folder, &["reference", &scene(name), "-o", &file, "--spp", "32", "--size", size]);
}

fn results(folder: &Path) -> Results {
    Results::load(&folder.join("out/results.json")).unwrap()
}

#[test]
fn a_reference_in_waves_is_the_one_in_a_single_go() {
    let options = mitsuba::Options { size: Some((20, 16)), ..mitsuba::Options::default() };
    let scene = mitsuba::load(Path::new(&scene("cornell-box")), &options).unwrap();
    let make = |waves: &[u32]| {
        let mut reference = Reference::new(&scene, 5);
        for &spp in waves {
            assert!(reference.add_wave(&scene, spp, &Control::QUIET).unwrap());
        }
        reference
    };
    let (whole, waves) = (make(&[48]), make(&[16, 8, 24]));
    assert_eq!((whole.spp, waves.spp), (96, 96));
    let close = |a: &[f32], b: &[f32], tolerance: f32| {
        a.iter().zip(b).for_each(|(a, b)| assert!((a - b).abs() <= tolerance * b.abs().max(1e-3), "{a} and {b}"));
    };
    close(&waves.image.data, &whole.image.data, 1e-4);
    // Of scattered and direct light as if they were independent, which shows where both meet in a pixel.
    close(&waves.variance.data, &whole.variance.data, 1e-2);
    close(&waves.difference.data, &whole.difference.data, 1e-2);
    // The floor is that of independent halves: an eighth of the samples have about eight times as much.
    let few = make(&[6]);
    assert!((3.0..30.0).contains(&(few.floor() / whole.floor())), "{} and {}", few.floor(), whole.floor());
    // The true error against a long reference is what the floor says.
    let mut long = Reference::new(&scene, 6);
    long.add_wave(&scene, 2048, &Control::QUIET).unwrap();
    let metric = fluxion::metrics::find("relmse").unwrap();
    let error = metric.measure(&whole.image, &long.image).unwrap().mean;
    assert!((0.5..2.0).contains(&(error / whole.floor())), "{error} and {}", whole.floor());
}

#[test]
fn references_of_several_machines_are_one_of_all_samples() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let make = |name: &str, seed: &str, spp: &str| {
        let arguments = ["reference", &scene("cornell-box"), "-o", name, "--size", "16x12", "-q", "--seed", seed];
        succeed(folder.path(), &[&arguments[..], &["--spp", spp]].concat());
        Reference::load(&at(name)).unwrap()
    };
    let (a, b) = (make("a.exr", "1", "400"), make("b.exr", "2", "200"));
    succeed(folder.path(), &["merge", "a.exr", "b.exr", "-o", "all.exr"]);
    let all = Reference::load(&at("all.exr")).unwrap();
    assert_eq!((all.spp, all.seed, &all.added[..]), (600, 1, &[2][..]));
    for (i, value) in all.image.data.iter().enumerate() {
        let expected = (2.0 * a.image.data[i] + b.image.data[i]) / 3.0;
        assert!((value - expected).abs() <= 1e-5 * expected.max(1.0), "{value} {expected}");
    }
    // A third of the variance of the smaller one, and two thirds of that of the larger one, in the mean.
    let mean = |reference: &Reference| reference.variance.data.iter().sum::<f32>();
    let share = mean(&all) / (mean(&a) * 4.0 / 9.0 + mean(&b) / 9.0);
    assert!((0.8..1.25).contains(&share), "{share}");
    let (code, _, errors) = fluxion(folder.path(), &["merge", "all.exr", "b.exr", "-o", "more.exr"]);
    assert!(code == 1 && errors.contains("b.exr: has the same samples, those of --seed 2"), "{errors}");
}

#[test]
fn references_are_gone_on_with_and_never_mixed_up() {
    let folder = tempfile::tempdir().unwrap();
    let go = |more: &[&str]| {
        let cornell = scene("cornell-box");
        let arguments = [&["reference", cornell.as_str(), "-o", "r.exr", "-q"][..], more].concat();
        fluxion(folder.path(), &arguments)
    };
    assert_eq!(go(&["--size", "16x16", "--spp", "8"]).0, 0);
    assert!(go(&["--size", "16x16", "--spp", "24"]).1.contains("24 spp"));
    let reference = Reference::load(&folder.path().join("r.exr")).unwrap();
    assert_eq!((reference.spp, reference.image.width), (24, 16));
    for (more, expected) in [
        (vec!["--size", "16x12", "--spp", "8"], "has 16x16 pixels, not 16x12"),
        (vec!["--size", "16x16", "--spp", "48", "--seed", "3"], "was started with --seed"),
        (vec!["--size", "16x16"], "--target-floor"),
        (vec!["--size", "16x16", "--target-floor", "0"], "positive"),
        (vec!["--size", "16x16", "--spp", "8", "-o", "r.png"], "cannot be used multiple times"),
    ] {
        let (code, _, errors) = go(&more);
        assert!(code != 0 && errors.contains(expected), "{more:?}: {errors}");
    }
    let cornell = scene("cornell-box");
    let (code, _, errors) = fluxion(folder.path(), &["reference", &cornell, "-o", "r.png", "--spp", "8"]);
    assert!(code == 1 && errors.contains("ends in .exr"), "{errors}");
    let other = [&scene("glossy-metal"), "-o", "r.exr", "--size", "16x16", "--spp", "64"];
    let (code, _, errors) = fluxion(folder.path(), &[&["reference"], &other[..]].concat());
    assert!(code == 1 && errors.contains("r.exr: is the reference of another scene"), "{errors}");
}

#[test]
fn definitions_make_another_scene() {
    let folder = tempfile::tempdir().unwrap();
    let text = std::fs::read_to_string(scene("unit/diffuse")).unwrap();
    let start = text.find("<scene").unwrap();
    let (head, rest) = text.split_at(start + text[start..].find('>').unwrap() + 1);
    let text = format!("{head}<default name=\"depth\" value=\"3\"/>{rest}");
    let at = text.find("name=\"max_depth\" value=\"").expect("a depth") + "name=\"max_depth\" value=\"".len();
    let end = at + text[at..].find('"').unwrap();
    std::fs::write(folder.path().join("s.xml"), format!("{}$depth{}", &text[..at], &text[end..])).unwrap();
    let go = |more: &[&str]| {
        fluxion(folder.path(), &[&["reference", "s.xml", "-o", "r.exr", "-q", "--size", "8x8"], more].concat())
    };
    assert_eq!(go(&["--spp", "8", "-D", "depth=2"]).0, 0);
    let (code, _, errors) = go(&["--spp", "16", "-D", "depht=2"]);
    assert!(code == 2 && errors.contains("no parameter `depht`; it has `depth`"), "{errors}");
    assert_eq!(go(&["--spp", "16", "-D", "depth=2"]).0, 0);
    let (code, _, errors) = go(&["--spp", "32", "-D", "depth=4"]);
    assert!(code == 1 && errors.contains("reference of another scene"), "{errors}");
}

#[test]
fn a_seed_of_zero_has_two_halves() {
    let folder = tempfile::tempdir().unwrap();
    let cornell = scene("cornell-box");
    let arguments = ["reference", &cornell, "-o", "r.exr", "-q", "--size", "8x8", "--spp", "8", "--seed", "0"];
    succeed(folder.path(), &arguments);
    assert!(Reference::load(&folder.path().join("r.exr")).unwrap().floor() > 0.0);
}

#[test]
fn a_benchmark_is_complete_after_every_run_and_goes_on() {
    let folder = tempfile::tempdir().unwrap();
    make_reference(folder.path(), "cornell-box", "24x20");
    let cornell = scene("cornell-box");
    let methods = "primal,frgr:levels=1,radius=2,l2";
    let arguments = ["bench", &cornell, "--methods", methods, "--spp", "2,4", "--seeds", "2", "-o", "out"];
    let arguments = [&arguments[..], &["--reference", "references", "-q"]].concat();
    let table = succeed(folder.path(), &arguments);
    assert!(table.contains("| frgr:levels=1,radius=2 |") && table.contains("| primal | 1.000 |"), "{table}");
    let all = results(folder.path());
    assert_eq!(all.records.len(), 12);
    for record in &all.records {
        let seconds = record.seconds;
        assert_eq!((record.width, record.height, record.scene.as_str()), (24, 20, "cornell-box"));
        assert!((seconds.total - seconds.render - seconds.develop - seconds.reconstruct).abs() < 1e-9);
        assert!(record.metrics["relmse"] > 0.0 && record.floor.unwrap() > 0.0 && record.peak_bytes > 1 << 20);
        assert_eq!(record.budget, format!("{}spp", record.spp));
    }
    let mut other = all.clone();
    other.records[0].machine = "an abacus".into();
    std::fs::write(folder.path().join("out/results.json"), other.json().unwrap()).unwrap();
    let (code, _, errors) = fluxion(folder.path(), &[&arguments[..], &["--resume"]].concat());
    assert!(code == 1 && errors.contains("another machine"), "{errors}");
    std::fs::write(folder.path().join("out/results.json"), all.json().unwrap()).unwrap();
    // Without --resume nothing is written over; with it, only what is missing is run.
    let (code, _, errors) = fluxion(folder.path(), &arguments);
    assert!(code == 1 && errors.contains("--resume"), "{errors}");
    let mut cut = all.clone();
    cut.records.remove(3);
    std::fs::write(folder.path().join("out/results.json"), cut.json().unwrap()).unwrap();
    succeed(folder.path(), &[&arguments[..], &["--resume", "--baseline", "out/results.json"]].concat());
    let again = results(folder.path());
    assert_eq!(again.records.len(), 12);
    assert_eq!(again.records[0], all.records[0]);
    // The same seed makes the same image.
    assert_eq!(again.records[11].metrics, all.records[3].metrics);
    let page = std::fs::read_to_string(folder.path().join("out/index.html")).unwrap();
    assert!(page.contains("data:image/png;base64,"));
    assert_eq!(std::fs::read_to_string(folder.path().join("out/results.csv")).unwrap().lines().count(), 13);
}

#[test]
fn times_include_the_reconstruction() {
    let folder = tempfile::tempdir().unwrap();
    make_reference(folder.path(), "cornell-box", "48x48");
    let cornell = scene("cornell-box");
    let arguments = ["bench", &cornell, "--methods", "primal,frgr", "--times", "0.25s", "--seeds", "1", "-o", "out"];
    succeed(folder.path(), &[&arguments[..], &["--reference", "references/cornell-box.exr", "-q"]].concat());
    let all = results(folder.path());
    let of = |method: &str| all.records.iter().find(|record| record.method == method).unwrap();
    // Gradients cost, and so does the method: path tracing takes more samples.
    assert!(of("primal").spp > of("frgr").spp, "{} and {}", of("primal").spp, of("frgr").spp);
    assert!(of("frgr").seconds.reconstruct > 0.0);
}

#[test]
fn mistakes_are_found_before_the_work() {
    let folder = tempfile::tempdir().unwrap();
    make_reference(folder.path(), "cornell-box", "24x20");
    std::fs::create_dir(folder.path().join("other")).unwrap();
    std::fs::write(folder.path().join("file"), b"").unwrap();
    let at = |name: &str| folder.path().join(name);
    std::fs::copy(at("references/cornell-box.exr"), at("other/glossy-metal.exr")).unwrap();
    let mut poisoned = read(&at("references/cornell-box.exr"), &[]).unwrap();
    poisoned.data[100] = f32::NAN;
    write(&at("nan.exr"), &poisoned, Kind::Float, None).unwrap();
    let (cornell, glossy) = (scene("cornell-box"), scene("glossy-metal"));
    for (arguments, code, expected) in [
        (vec![&*cornell, "--reference", "references", "--spp", "1", "-o", "file"], 1, "file"),
        (vec![&cornell, "--reference", "references", "--spp", "1", "-o", "o", "--methods", "magic"], 2, "not known"),
        (vec![&cornell, "--reference", "references", "--spp", "1", "-o", "o", "--methods", "l2,l2"], 2, "twice"),
        (vec![&cornell, "--reference", "references", "--times", "1us", "-o", "o"], 2, "positive time"),
        (
            vec![&cornell, "--reference", "references", "--times", "0.000001s", "-o", "o"],
            2,
            "below one sample per pixel",
        ),
        (vec![&cornell, "--reference", "references", "--spp", "0", "-o", "o"], 2, "--spp"),
        (vec![&cornell, "--reference", "references", "-o", "o"], 2, "--times"),
        (
            vec![&cornell, "--reference", "references", "--size", "24x24", "--spp", "1", "-o", "o"],
            1,
            "has 24x20 pixels",
        ),
        (vec![&glossy, "--reference", "other", "--spp", "1", "-o", "o"], 1, "reference of another scene"),
        (vec![&glossy, "--reference", "references", "--spp", "1", "-o", "o"], 1, "`fluxion reference` makes one"),
        (vec![&cornell, "--reference", "nan.exr", "--spp", "1", "-o", "o"], 1, "not finite"),
        (vec![&cornell, "--reference", "file", "--spp", "1", "-o", "o"], 1, "file"),
        (vec![&cornell, &cornell, "--reference", "references", "--spp", "1", "-o", "o"], 2, "two scenes are called"),
        (vec!["references", "--spp", "1", "-o", "o"], 1, "neither a scene.xml"),
        (vec!["no.xml", "--spp", "1", "-o", "o"], 1, "no.xml"),
    ] {
        let (found, _, errors) = fluxion(folder.path(), &[&["bench"], &arguments[..]].concat());
        assert_eq!(found, code, "{arguments:?}: {errors}");
        assert!(errors.contains(expected), "{arguments:?}: {errors}");
    }
    let error = Reference::load(&at("file")).unwrap_err();
    assert!(matches!(error, Error::Io { .. }));
}
