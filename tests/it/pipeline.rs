//! Recipes: stored and read back, carried out by the library as by the program, on any host.

use std::process::Command;
use std::sync::Mutex;
use std::sync::atomic::AtomicBool;

use fluxion::film::{Layer, Needs, Recorded};
use fluxion::image::io::read_color;
use fluxion::pipeline::{Differences, Host, Outputs, RENDERING, Recipe};

use crate::common::root;

fn recipe(method: &str) -> Recipe {
    let mut recipe = Recipe { seed: 7, ..Recipe::of_method(method) };
    recipe.limits.spp = Some(8);
    recipe.scene.size = Some((32, 24));
    recipe.outputs.image = true;
    recipe
}

#[test]
fn recipes_are_read_back_and_unknown_fields_are_named() {
    let mut wanted = recipe("frgr:levels=3");
    wanted.kernel = "structure:k=6,threshold=0.2".into();
    wanted.differences = Differences::Always;
    wanted.statistics = Needs::NONE.with(Recorded::Position);
    wanted.scene.light_groups = Some("key=lamp*,rest".into());
    wanted.scene.parameters = vec![("frame".into(), "3".into())];
    wanted.outputs = Outputs { images: vec!["a.exr".into()], exposure: 1.5, ..Outputs::default() };
    let text = serde_json::to_string_pretty(&wanted).unwrap();
    assert_eq!(serde_json::from_str::<Recipe>(&text).unwrap(), wanted);
    assert_eq!(serde_json::from_str::<Recipe>("{}").unwrap(), Recipe::default());
    for wrong in [r#"{"spp": 3}"#, r#"{"limits": {"samples": 3}}"#, r#"{"statistics": {"motion": true}}"#] {
        let error = serde_json::from_str::<Recipe>(wrong).unwrap_err().to_string();
        assert!(["spp", "samples", "motion"].iter().any(|name| error.contains(name)), "{error}");
    }
}

#[test]
fn a_recipe_makes_the_bits_of_the_program() {
    let folder = tempfile::tempdir().unwrap();
    let file = root().join("scenes/glossy-metal/scene.xml");
    for (method, allocator) in [("net", None), ("apr", Some("variance"))] {
        let image = folder.path().join("image.exr");
        let mut command = Command::new(assert_cmd::cargo::cargo_bin("fluxion"));
        command
            .arg("render")
            .arg(&file)
            .args(["--size", "32x24", "--spp", "8", "--seed", "7", "-q", "--method", method]);
        command.args(allocator.iter().flat_map(|name| ["--adaptive", name])).arg("-o").arg(&image);
        assert!(command.status().unwrap().success());
        let recipe = Recipe { allocator: allocator.map(str::to_owned), ..recipe(method) };
        let scene = recipe.load(&file).unwrap();
        let rendered = recipe.prepare(&scene, &file).unwrap().run_anew(&Host::QUIET).unwrap();
        assert_eq!(rendered.solution.unwrap().image, read_color(&image).unwrap(), "{method}");
        assert_eq!(rendered.frame.provenance.method, method);
    }
}

#[test]
fn hosts_stop_runs_and_hear_of_stages_and_warnings() {
    let file = root().join("scenes/unit/diffuse/scene.xml");
    let mut recipe = recipe("l2");
    recipe.limits.spp = Some(100_000);
    let scene = recipe.load(&file).unwrap();
    let (stop, stages, warnings) = (AtomicBool::new(true), Mutex::new(Vec::new()), Mutex::new(Vec::new()));
    let host = Host {
        stop: &stop,
        progress: &|stage, _| stages.lock().unwrap().push(stage.to_owned()),
        warn: &|text| warnings.lock().unwrap().push(text.to_owned()),
        sinks: &[],
    };
    let rendered = recipe.prepare(&scene, &file).unwrap().run_anew(&host).unwrap();
    assert!(rendered.render.stopped && rendered.stats.spp < 100_000);
    assert!(warnings.lock().unwrap().iter().any(|text| text.starts_with("stopped early")));
    stop.store(false, std::sync::atomic::Ordering::Relaxed);
    recipe.limits.spp = Some(2);
    let rendered = recipe.prepare(&scene, &file).unwrap().run_anew(&host).unwrap();
    assert!(!rendered.render.stopped && rendered.frame.get(Layer::Dx).is_some());
    assert!(stages.lock().unwrap().iter().any(|stage| stage == RENDERING));
}

#[test]
fn faults_of_recipes_are_found_before_the_scene_is_read() {
    let with = |change: &dyn Fn(&mut Recipe)| {
        let mut recipe = Recipe::default();
        change(&mut recipe);
        recipe.check().unwrap_err().to_string()
    };
    assert!(with(&|recipe| recipe.method.name = "nosuch".into()).contains("method `nosuch` is not known; there are"));
    assert!(with(&|recipe| recipe.kernel = "nosuch".into()).contains("kernel `nosuch` is not known"));
    assert!(with(&|recipe| recipe.allocator = Some("nosuch".into())).contains("allocator `nosuch` is not known"));
}
