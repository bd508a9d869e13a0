//! Checkpoints: resume equals the straight run, merge equals the whole, and nothing else is taken for one.

use std::fs;
use std::path::Path;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::time::Duration;

use crate::common::{self, bundled, film};
use assert_cmd::Command;
use fluxion::adaptive::{self, ALLOCATORS, AdaptiveSettings, Limits, Start};
use fluxion::checkpoint::{self, Origin, Run};
use fluxion::film::{EdgeNeed, Film, Layer, Needs};
use fluxion::image::Image;
use fluxion::reconstruct::{self, Context};
use fluxion::render::Shift;
use fluxion::render::{self, Budget, Control, FilmSink, RenderOutcome, RenderSettings, render, resume};
use fluxion::scene::Scene;

fn settings(spp: u32, needs: Needs) -> RenderSettings {
    RenderSettings { seed: 7, ..RenderSettings::new(Budget::Spp(spp), needs) }
}

fn origin(scene: &Scene, seed: u64, needs: Needs) -> Origin {
    Origin {
        version: "1".into(),
        epoch: fluxion::render::EPOCH,
        scene: "scene.xml".into(),
        content: checkpoint::content(scene).unwrap(),
        fingerprint: "0".into(),
        method: "frgr".into(),
        plan: "+gradients".into(),
        size: (scene.sensor().width, scene.sensor().height),
        needs,
        shift: Shift::default(),
        kernel: fluxion::neighbours::Selector::default(),
        lights: Vec::new(),
        runs: vec![Run { seed, first: 0, samples: 0 }],
    }
}

/// Everything, with differences where they pay.
const THINNED: Needs = Needs { edges: EdgeNeed::Thinned, ..Needs::ALL };

/// Keeps a render after every so many tiles, and stops it after some of the times.
struct Interruption<'a> {
    tiles: AtomicU32,
    left: AtomicU32,
    stop: &'a AtomicBool,
    keep: &'a (dyn Fn(&RenderOutcome) + Sync),
}

impl FilmSink for Interruption<'_> {
    fn due(&self) -> bool {
        self.tiles.fetch_add(1, Ordering::Relaxed) % 3 == 2
    }

    fn put(&self, outcome: &RenderOutcome) {
        (self.keep)(outcome);
        if self.left.fetch_sub(1, Ordering::Relaxed) == 1 {
            self.stop.store(true, Ordering::Relaxed);
        }
    }
}

/// Does something again and again from the last checkpoint, each time with more time before it is stopped.
fn interrupted<T>(
    path: &Path,
    mut work: impl FnMut(Option<checkpoint::Checkpoint>, &Control) -> (T, bool),
    keep: &(dyn Fn(&RenderOutcome) + Sync),
) -> T {
    let mut kept = None;
    for times in 2.. {
        let stop = AtomicBool::new(false);
        let interruption = Interruption { tiles: AtomicU32::new(0), left: AtomicU32::new(times), stop: &stop, keep };
        let control = Control { stop: &stop, sinks: &[&interruption], ..Control::QUIET };
        let (made, stopped) = work(kept.take(), &control);
        if !stopped {
            return made;
        }
        kept = Some(checkpoint::load(path).unwrap());
    }
    unreachable!("it ends when it is not stopped");
}

#[test]
fn a_render_that_is_resumed_has_the_bits_of_one_that_is_not() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.ckpt");
    for (name, needs) in [("cornell-box", Needs::ALL), ("glossy-metal", Needs::ALL), ("glossy-metal", THINNED)] {
        let scene = bundled(name, (50, 40));
        let straight = film(&scene, 21, 7, needs);
        let origin = origin(&scene, 7, needs);
        let keep = |outcome: &RenderOutcome| checkpoint::save(&path, &origin, outcome, None).unwrap();
        let resumed: Film = interrupted(
            &path,
            |kept, control| {
                let begun = kept.map_or_else(|| RenderOutcome::new(&scene, needs), |kept| kept.outcome);
                let outcome = resume(&scene, settings(21, needs), control, begun);
                (outcome.film, outcome.stopped)
            },
            &keep,
        );
        assert!(resumed == straight, "{name}");
        assert!(checkpoint::load(&path).unwrap().outcome.film == straight, "{name}");
    }
}

#[test]
fn an_adaptive_run_that_is_resumed_makes_the_same_decisions() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.ckpt");
    let scene = bundled("cornell-box", (50, 40));
    let method = reconstruct::parse("frgr").unwrap();
    let quiet = Context::QUIET;
    for (allocator, error) in [(0, None), (1, None), (2, Some(1e-4))] {
        let settings = AdaptiveSettings {
            render: settings(1, method.needs()),
            method: method.as_ref(),
            allocator: ALLOCATORS[allocator],
            limits: Limits { spp: Some(60), time: None, error },
            reconstruction: None,
        };
        let control = Control::QUIET;
        let straight = adaptive::run(&scene, &settings, &control, &quiet).unwrap();
        let origin = origin(&scene, 7, method.needs());
        let journal = Mutex::default();
        let keep = |outcome: &RenderOutcome| {
            checkpoint::save(&path, &origin, outcome, Some(&*journal.lock().unwrap())).unwrap();
        };
        let resumed = interrupted(
            &path,
            |kept, control| {
                let begun = match kept {
                    Some(kept) => kept.resume(&journal),
                    None => Start { render: RenderOutcome::new(&scene, method.needs()), journal: &journal },
                };
                let outcome = adaptive::resume(&scene, &settings, control, &quiet, begun).unwrap();
                let stopped = outcome.render.stopped;
                (outcome, stopped)
            },
            &keep,
        );
        assert!(resumed.render.film == straight.render.film, "{}", ALLOCATORS[allocator].id());
        assert!(resumed.solution.image == straight.solution.image);
        let errors =
            |outcome: &adaptive::AdaptiveOutcome| outcome.passes.iter().map(|pass| pass.error).collect::<Vec<_>>();
        assert_eq!(errors(&resumed), errors(&straight));
    }
}

#[test]
fn films_of_quarters_are_the_film_of_the_whole() {
    let scenes = [("unit/occluder", Needs::ALL), ("glossy-metal", THINNED)];
    let [occluder, metal] = scenes.map(|(name, needs)| (bundled(name, (20, 17)), needs));
    let quarter = |(scene, needs): &(Scene, Needs), first: u32, seed: u64| {
        let settings = RenderSettings { first, seed, ..settings(9, *needs) };
        let control = Control::QUIET;
        render(scene, settings, &control).film
    };
    // The same samples in parts that are no whole number of bins: equal up to rounding.
    let straight = [&occluder, &metal].map(|scene| {
        let whole = quarter_sum((0..4).map(|k| quarter(scene, 9 * k, 7))).develop();
        let at_once = film(&scene.0, 36, 7, scene.1).develop();
        for (layer, a) in whole.present() {
            let b = at_once.get(layer).unwrap();
            let most = b.data.iter().fold(0.0f32, |most, value| most.max(value.abs()));
            let close = |(a, b): (&f32, &f32)| (a - b).abs() <= 1e-5 * most;
            assert!(a.data.iter().zip(&b.data).all(close), "{}", layer.name());
        }
        at_once
    });
    // Other samples: the same mean and variance within the noise of both.
    let b = &straight[0];
    let other = quarter_sum((0..4).map(|seed| quarter(&occluder, 0, 100 + seed))).develop();
    let sum = |image: &Image| image.data.iter().map(|&value| f64::from(value)).sum::<f64>();
    let of = |layer| (sum(other.get(layer).unwrap()), sum(b.get(layer).unwrap()));
    let ((mean, expected), (variance, expected_variance)) = (of(Layer::Color), of(Layer::ColorVariance));
    assert!((mean - expected).abs() < 0.03 * expected, "{mean} {expected}");
    assert!((variance / expected_variance - 1.0).abs() < 0.2, "{variance} {expected_variance}");
}

fn quarter_sum(mut films: impl Iterator<Item = Film>) -> Film {
    let first = films.next().unwrap();
    films.fold(first, |mut all, film| {
        all.merge(&film);
        all
    })
}

fn fluxion(folder: &Path) -> Command {
    let mut command = Command::cargo_bin("fluxion").unwrap();
    command.current_dir(folder);
    command
}

fn refused(command: &mut Command) -> String {
    let output = command.output().unwrap();
    assert!(!output.status.success(), "{command:?}");
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// A scene of its own folder, with a mesh.
fn scene_with_mesh(folder: &Path) {
    let body = r#"<emitter type="constant"/><shape type="obj"><string name="filename" value="a.obj"/></shape>"#;
    let text = format!("<scene version=\"3.0.0\">{body}{}</scene>", common::sensor("0,0,4", 20, 18));
    fs::write(folder.join("scene.xml"), text).unwrap();
    fs::write(folder.join("a.obj"), "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").unwrap();
}

#[test]
fn checkpoints_of_something_else_are_refused_with_the_reason() {
    let folder = tempfile::tempdir().unwrap();
    scene_with_mesh(folder.path());
    let render = |extra: &[&str]| {
        let mut command = fluxion(folder.path());
        command.args(["render", "scene.xml", "-o", "a.exr", "-q", "--spp", "4", "--checkpoint", "a.ckpt"]).args(extra);
        command
    };
    render(&[]).assert().success();
    let kept = fs::read(folder.path().join("a.ckpt")).unwrap();
    for (extra, expected) in [
        (&[][..], "--resume"),
        (&["--resume", "--size", "21x18"], "another size: 20x18, not 21x18"),
        (&["--resume", "--seed", "3"], "was started with --seed 0"),
        (&["--resume", "--first", "9"], "was started with --seed 0"),
        (&["--resume", "--method", "apr"], "records less"),
        (&["--resume", "--shift", "replay"], "another --shift"),
        (&["--resume", "-o", "a.ckpt"], "not one of exr"),
    ] {
        let error = refused(&mut render(extra));
        assert!(error.contains(expected), "{extra:?}: {error}");
    }
    fs::write(folder.path().join("a.obj"), "v 0 0 0\nv 1 0 0\nv 0 2 0\nf 1 2 3\n").unwrap();
    let error = refused(&mut render(&["--resume"]));
    assert!(error.contains("one of its files has changed"), "{error}");
    assert!(fs::read(folder.path().join("a.ckpt")).unwrap() == kept, "what is refused stays as it is");
    // A newer format, and a damaged file.
    for (at, expected) in [(8, "format 255"), (200, "damaged"), (kept.len() / 2 + 1, "checksum")] {
        let mut bytes = kept.clone();
        bytes[at] = 255;
        fs::write(folder.path().join("a.ckpt"), bytes).unwrap();
        let error = refused(&mut render(&["--resume"]));
        assert!(error.contains(expected), "{at}: {error}");
    }
    fs::write(folder.path().join("a.ckpt"), &kept[..kept.len() / 2]).unwrap();
    assert!(refused(&mut render(&["--resume"])).contains("damaged"));
}

#[test]
fn merging_takes_other_samples_of_the_same_scene_only() {
    let folder = tempfile::tempdir().unwrap();
    scene_with_mesh(folder.path());
    let render = |name: &str, extra: &[&str]| {
        let mut command = fluxion(folder.path());
        command.args(["render", "scene.xml", "-o", "x.exr", "-q", "--spp", "5", "--checkpoint", name]).args(extra);
        command.assert().success();
    };
    render("0.ckpt", &[]);
    render("1.ckpt", &["--seed", "1"]);
    render("2.ckpt", &["--first", "5"]);
    render("small.ckpt", &["--seed", "2", "--size", "8x8"]);
    render("less.ckpt", &["--seed", "2", "--method", "l2"]);
    let merge = |names: &[&str], to: &str| {
        let mut command = fluxion(folder.path());
        command.arg("merge").args(names).args(["-o", to]);
        command
    };
    merge(&["0.ckpt", "1.ckpt", "2.ckpt"], "a.ckpt").assert().success();
    merge(&["2.ckpt", "0.ckpt", "1.ckpt"], "b.ckpt").assert().success();
    let film = |name: &str| checkpoint::load(&folder.path().join(name)).unwrap().outcome.film;
    assert!(film("a.ckpt") == film("b.ckpt") && film("a.ckpt").samples() == 15 * 20 * 18);
    merge(&["0.ckpt", "1.ckpt"], "layers.exr").assert().success();
    for from in ["a.ckpt", "layers.exr"] {
        fluxion(folder.path()).args(["reconstruct", from, "-o", "y.exr", "-q"]).assert().success();
    }
    for (names, expected) in [
        (["0.ckpt", "0.ckpt"], "would be written over"),
        (["a.ckpt", "1.ckpt"], "the same samples of seed 1"),
        (["0.ckpt", "small.ckpt"], "another size"),
        (["0.ckpt", "less.ckpt"], "other statistics"),
        (["0.ckpt", "scene.xml"], "no checkpoint"),
    ] {
        let to = if names[0] == names[1] { "0.ckpt" } else { "z.ckpt" };
        let error = refused(&mut merge(&names, to));
        assert!(error.contains(expected), "{names:?}: {error}");
        assert!(!folder.path().join("z.ckpt").exists());
    }
    let arguments = ["render", "scene.xml", "-o", "x.exr", "--checkpoint", "a.ckpt", "--resume"];
    assert!(refused(fluxion(folder.path()).args(arguments)).contains("merged of several"));
}

#[test]
fn what_cannot_be_written_is_an_error_that_says_what_is_kept() {
    let folder = tempfile::tempdir().unwrap();
    scene_with_mesh(folder.path());
    let link = |name: &str| std::os::unix::fs::symlink("/dev/full", folder.path().join(name)).unwrap();
    ["full.exr", "full.png", "full.jpg", "full.ckpt", "full.json"].into_iter().for_each(link);
    let render = |extra: &[&str]| {
        let mut command = fluxion(folder.path());
        command.args(["render", "scene.xml", "-q", "--spp", "2"]).args(extra).env("TMPDIR", folder.path());
        command
    };
    for name in ["full.exr", "full.png", "full.jpg"] {
        let error = refused(&mut render(&["-o", name]));
        // The image is not lost: it is where the error says.
        let rescued = error.trim().rsplit_once("the image is in ").map(|(_, path)| path.to_owned()).expect(&error);
        assert!(fluxion::image::io::read_color(Path::new(&rescued)).unwrap().shape() == (20, 18, 3), "{error}");
        let error = refused(&mut render(&["-o", name, "-o", "good.exr"]));
        assert!(error.contains("the image is in good.exr"), "{error}");
    }
    let error = refused(&mut render(&["-o", "full.exr", "--checkpoint", "a.ckpt"]));
    assert!(error.contains("the samples are kept: `fluxion reconstruct a.ckpt`"), "{error}");
    let error = refused(&mut render(&["-o", "b.exr", "--checkpoint", "full.ckpt"]));
    assert!(error.contains("No space left") && folder.path().join("b.exr").exists(), "{error}");
    let error = refused(&mut render(&["-o", "c.exr", "--layers", "full.exr"]));
    assert!(error.contains("full.exr") && folder.path().join("c.exr").exists(), "{error}");
    assert!(refused(&mut render(&["-o", "d.exr", "--json", "full.json"])).contains("full.json: No space left"));
}

/// Starts a render, sends it a signal after a while, and returns its exit code, if it has one.
fn signalled(folder: &Path, signal: &str, milliseconds: u64, extra: &[&str]) -> Option<i32> {
    let mut child = std::process::Command::new(assert_cmd::cargo::cargo_bin("fluxion"))
        .current_dir(folder)
        .args(["render", &common::root().join("scenes/cornell-box/scene.xml").display().to_string(), "-q"])
        .args(["--size", "64x64", "--checkpoint", "a.ckpt", "--checkpoint-every", "0.02s"])
        .args(extra)
        .spawn()
        .unwrap();
    common::signal(&child, signal, Duration::from_millis(milliseconds));
    child.wait().unwrap().code()
}

#[test]
fn signals_end_a_render_with_an_image_and_a_checkpoint() {
    for signal in ["-INT", "-TERM", "-HUP"] {
        let folder = tempfile::tempdir().unwrap();
        // The code of something that may be tried again.
        let code = signalled(folder.path(), signal, 1000, &["-o", "a.exr", "--time", "60s"]);
        assert_eq!(code, Some(75), "{signal}");
        let kept = checkpoint::load(&folder.path().join("a.ckpt")).unwrap();
        assert!(kept.outcome.film.samples() > 0 && folder.path().join("a.exr").exists(), "{signal}");
    }
}

#[test]
fn a_checkpoint_may_be_all_that_is_wanted_and_has_one_writer() {
    let folder = tempfile::tempdir().unwrap();
    let scene = common::root().join("scenes/cornell-box/scene.xml");
    let render = |extra: &[&str]| {
        let mut command = std::process::Command::new(assert_cmd::cargo::cargo_bin("fluxion"));
        command.current_dir(folder.path()).arg("render").arg(&scene).args(["-q", "--size", "64x64"]).args(extra);
        command
    };
    assert!(render(&["--checkpoint", "a.ckpt", "--spp", "3", "--method", "l2"]).status().unwrap().success());
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1, "no image, no temporary file and no lock");
    let info = fluxion(folder.path()).args(["info", "a.ckpt"]).output().unwrap();
    let info = String::from_utf8_lossy(&info.stdout).into_owned();
    for expected in ["64x64", "l2", "samples      3 from number 0 on, seed 0", "to cross, shifted by reconnect"] {
        assert!(info.contains(expected), "{info}");
    }
    // A twin is turned away, and does not disturb the first, which two requests to terminate do not hurry.
    let mut first = render(&["--checkpoint", "b.ckpt", "--spp", "100000", "--method", "l2"]).spawn().unwrap();
    common::wait_until_it_listens(&first);
    let twin = render(&["--checkpoint", "b.ckpt", "--spp", "4", "--resume"]).output().unwrap();
    let message = String::from_utf8_lossy(&twin.stderr).into_owned();
    assert!(twin.status.code() == Some(1) && message.contains(&format!("process {}", first.id())), "{message}");
    for _ in 0..2 {
        common::signal(&first, "-TERM", Duration::from_millis(20));
    }
    assert_eq!(first.wait().unwrap().code(), Some(75));
    assert!(checkpoint::load(&folder.path().join("b.ckpt")).unwrap().outcome.film.samples() > 0);
    // Without a checkpoint nothing can be resumed.
    let mut lost = render(&["-o", "a.exr", "--spp", "100000", "--method", "primal"]).spawn().unwrap();
    common::signal(&lost, "-TERM", Duration::from_millis(200));
    assert_eq!(lost.wait().unwrap().code(), Some(143));
}

#[test]
fn groups_of_chunks_are_merged_into_the_bits_of_all_chunks() {
    let folder = tempfile::tempdir().unwrap();
    let scene = common::root().join("scenes/glossy-metal/scene.xml");
    let run = |arguments: &[&str]| fluxion(folder.path()).args(arguments).assert().success();
    let name = |k: usize| format!("{k:02}.ckpt");
    for k in 0..11 {
        let (first, scene) = ((8 * k).to_string(), scene.display().to_string());
        let extra = ["--spp", "8", "--first", &first, "--checkpoint", &name(k), "--method", "l2", "--size", "20x17"];
        run(&[&["render", &scene, "-q"], &extra[..]].concat());
    }
    let merge = |output: &str, films: &[String]| {
        let films: Vec<_> = films.iter().rev().map(String::as_str).collect();
        run(&[&["merge", "-o", output], &films[..]].concat());
    };
    let all: Vec<_> = (0..11).map(name).collect();
    merge("all.ckpt", &all);
    merge("a.ckpt", &all[..4]);
    merge("b.ckpt", &all[4..8]);
    merge("ab.ckpt", &["a.ckpt".into(), "b.ckpt".into()]);
    merge("c.ckpt", &all[8..10]);
    merge("groups.ckpt", &["ab.ckpt".into(), "c.ckpt".into(), all[10].clone()]);
    let film = |name: &str| checkpoint::load(&folder.path().join(name)).unwrap().outcome.film;
    assert!(film("all.ckpt") == film("groups.ckpt"));
    merge("all.exr", &all);
    let frame = fluxion::exr::load(&folder.path().join("all.exr")).unwrap();
    for (layer, image) in film("all.ckpt").develop().present() {
        assert_eq!(frame.get(layer), Some(image), "{}", layer.name());
    }
    // One render of all samples, up to rounding.
    let whole = film_of_all(&bundled("glossy-metal", (20, 17)));
    for (layer, image) in whole.develop().present() {
        let merged = frame.get(layer).unwrap();
        let most = image.data.iter().fold(0.0f32, |most, value| most.max(value.abs()));
        assert!(image.data.iter().zip(&merged.data).all(|(a, b)| (a - b).abs() <= 1e-5 * most), "{}", layer.name());
    }
    // A damaged chunk is named.
    let path = folder.path().join(&all[3]);
    let mut bytes = fs::read(&path).unwrap();
    let middle = bytes.len() / 2;
    bytes[middle] ^= 1;
    fs::write(&path, bytes).unwrap();
    let films: Vec<_> = all.iter().map(String::as_str).collect();
    let error = refused(fluxion(folder.path()).args([&["merge", "-o", "x.ckpt"], &films[..]].concat()));
    assert!(
        error.contains("03.ckpt") && error.contains("damaged") && !folder.path().join("x.ckpt").exists(),
        "{error}"
    );
}

fn film_of_all(scene: &Scene) -> Film {
    let settings = RenderSettings { seed: 0, ..settings(88, reconstruct::parse("l2").unwrap().needs()) };
    render(scene, settings, &Control::QUIET).film
}

#[test]
fn progress_is_told_in_the_words_that_are_asked_for() {
    let folder = tempfile::tempdir().unwrap();
    let scene = common::root().join("scenes/cornell-box/scene.xml").display().to_string();
    for (style, out, err) in
        [("json", "", "\"stage\":\"rendering\""), ("openjd", "openjd_progress: ", ""), ("alf", "ALF_PROGRESS ", "")]
    {
        let output = fluxion(folder.path())
            .args([
                "render",
                &scene,
                "-o",
                "a.exr",
                "--size",
                "64x64",
                "--time",
                "3s",
                "--method",
                "primal",
                "--adaptive",
                "uniform",
            ])
            .args(["--progress", style])
            .output()
            .unwrap();
        let [found, noted] = [&output.stdout, &output.stderr].map(|bytes| String::from_utf8_lossy(bytes).into_owned());
        assert!(output.status.success() && found.contains(out) && noted.contains(err), "{style}: {found} {noted}");
    }
}

#[test]
fn a_killed_program_goes_on_where_it_was() {
    let folder = tempfile::tempdir().unwrap();
    let arguments = ["-o", "a.exr", "--spp", "200", "--resume"];
    for milliseconds in [150, 400, 700] {
        signalled(folder.path(), "-KILL", milliseconds, &arguments);
    }
    // Never: this one ends by itself.
    let code = signalled(folder.path(), "-0", 0, &arguments);
    assert_eq!(code, Some(0));
    let scene = bundled("cornell-box", (64, 64));
    let needs = reconstruct::parse(reconstruct::DEFAULT).unwrap().needs();
    let kept = checkpoint::load(&folder.path().join("a.ckpt")).unwrap().outcome.film;
    assert!(kept == film(&scene, 200, 0, needs));
}

#[test]
fn out_of_memory_is_an_error() {
    let folder = tempfile::tempdir().unwrap();
    scene_with_mesh(folder.path());
    let program = assert_cmd::cargo::cargo_bin("fluxion");
    let render = format!(
        "ulimit -v 1500000; {} render scene.xml -o a.exr -q --spp 1 --threads 1 --size 6000x6000",
        program.display()
    );
    let error = refused(Command::new("sh").current_dir(folder.path()).args(["-c", &render]));
    assert!(error.contains("error: out of memory"), "{error}");
}

#[test]
fn textures_that_vanish_while_rendering_are_reported() {
    let folder = tempfile::tempdir().unwrap();
    let image = Image::from_rgb(512, 512, |x, y| fluxion::internals::math::vec3(x as f32, y as f32, 1.0) / 512.0);
    let texture = folder.path().join("a.exr");
    fluxion::image::io::write_color(&texture, &image, &Default::default()).unwrap();
    let body = format!(
        r#"<emitter type="constant"/><shape type="rectangle"><bsdf type="diffuse"><texture type="bitmap" name="reflectance">
        <string name="filename" value="{}"/></texture></bsdf></shape>{}"#,
        texture.display(),
        common::sensor("0,0,4", 16, 16)
    );
    let text = format!("<scene version=\"3.0.0\">{body}</scene>");
    let options = fluxion::mitsuba::Options { texture_memory: 0, ..Default::default() };
    let scene = fluxion::mitsuba::load_text(&text, &options).unwrap();
    // Opened and looked at, but most of it not read yet.
    let length = fs::metadata(&texture).unwrap().len();
    fs::OpenOptions::new().write(true).open(&texture).unwrap().set_len(length / 8).unwrap();
    let frame = film(&scene, 4, 1, Needs::default()).develop();
    assert!(frame.get(Layer::Color).unwrap().not_finite().is_none());
    let (path, count) = fluxion::image::io::failed_lookups().unwrap();
    assert!(path == texture && count > 0);
}

#[test]
fn samples_of_a_first_number_are_those_of_the_whole() {
    let scene = bundled("unit/diffuse", (16, 16));
    let control = Control::QUIET;
    let late = render(&scene, RenderSettings { first: 3, ..settings(1, Needs::default()) }, &control).film.develop();
    let id = render::SampleId { seed: 7, x: 5, y: 9, index: 3 };
    let one = render::sample(&scene, id, Shift::default());
    assert_eq!(late.get(Layer::Color).unwrap().rgb(5, 9), one.sample.color);
}
