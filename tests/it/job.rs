//! Renders in chunks: idempotent commands, a folder as the only state, and the image of one render.

use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::path::Path;
use std::process::Command;
use std::time::Duration;

use fluxion::checkpoint;
use fluxion::film::{Frame, Layer};

use crate::common::{self, root};

fn fluxion(folder: &Path, arguments: &[&str]) -> (Option<i32>, String) {
    let mut command = Command::new(assert_cmd::cargo::cargo_bin("fluxion"));
    let output = command.current_dir(folder).args(arguments).output().unwrap();
    let text = [&output.stdout, &output.stderr].map(|bytes| String::from_utf8_lossy(bytes).into_owned()).concat();
    (output.status.code(), text)
}

fn expect(folder: &Path, arguments: &[&str], code: i32, part: &str) {
    let (found, text) = fluxion(folder, arguments);
    assert!(found == Some(code) && text.contains(part), "{arguments:?} ended with {found:?}: {text}");
}

fn scene(name: &str) -> String {
    root().join("scenes").join(name).join("scene.xml").display().to_string()
}

fn developed(path: &Path) -> Frame {
    checkpoint::load(path).unwrap().develop()
}

/// Every layer is the same, up to rounding.
fn assert_close(merged: &Frame, whole: &Frame, name: &str) {
    for (layer, image) in whole.present() {
        let most = image.data.iter().fold(0.0f32, |most, value| most.max(value.abs()));
        let close = |(a, b): (&f32, &f32)| (a - b).abs() <= 1e-5 * most;
        assert!(merged.get(layer).unwrap().data.iter().zip(&image.data).all(close), "{name}: {}", layer.name());
    }
}

#[test]
fn chunks_make_the_image_of_one_render() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let (cornell, metal) = (scene("cornell-box"), scene("glossy-metal"));
    let options = ["--size", "33x18", "--method", "l2", "-q"];
    expect(
        at,
        &[&["job", "plan", &cornell, &metal, "--spp", "44", "--chunks", "4", "-o", "j", "--"], &options[..]].concat(),
        0,
        "8 chunks",
    );
    expect(at, &["job", "plan", &cornell, "--spp", "8", "-o", "j"], 2, "has a job already");
    expect(at, &["job", "status", "j", "--missing"], 0, "0-7");
    expect(at, &["job", "merge", "j"], 2, "chunks 0-3 of cornell-box are not complete");
    // The list of commands, by a shell that finds the program.
    let program = assert_cmd::cargo::cargo_bin("fluxion");
    let path = format!("{}:{}", program.parent().unwrap().display(), std::env::var("PATH").unwrap());
    let commands = fs::read_to_string(at.join("j/commands.txt")).unwrap();
    let lines: Vec<_> = commands.lines().collect();
    assert_eq!(lines.len(), 8);
    for line in &lines[..7] {
        assert!(Command::new("sh").args(["-c", line]).env("PATH", &path).status().unwrap().success(), "{line}");
    }
    expect(at, &["job", "run", "j", "2"], 0, "chunk 2 is complete");
    expect(at, &["job", "run", "j", "8"], 2, "there are 8, from 0 on");
    for wrong in ["2-", "6-5"] {
        expect(at, &["job", "run", "j", wrong], 2, "chunks are written as in 7 or 3,17,200-203");
    }
    expect(at, &["job", "run", "j", "2,5-6,8"], 2, "there are 8, from 0 on");
    expect(at, &["job", "status", "j"], 0, "missing: 7");
    expect(at, &["job", "merge", "j", "--no-image"], 2, "chunks 7 of glossy-metal");
    expect(at, &["job", "merge", "j", "--partial"], 0, "3 chunks");
    expect(at, &["job", "run", "j", "6-7"], 0, "");
    expect(at, &["job", "merge", "j"], 0, "glossy-metal.exr");
    expect(
        at,
        &["merge", "j/glossy-metal.ckpt", "-o", "layers.exr"],
        0,
        "layers.exr: 44.0 samples per pixel of 4 runs",
    );
    for (name, scene) in [("cornell-box", &cornell), ("glossy-metal", &metal)] {
        let all = ["render", scene, "--spp", "44", "--checkpoint", "all.ckpt"];
        expect(at, &[&all[..], &options[..]].concat(), 0, "");
        assert_close(&developed(&at.join(format!("j/{name}.ckpt"))), &developed(&at.join("all.ckpt")), name);
        assert!(at.join(format!("j/{name}.exr")).exists());
        fs::remove_file(at.join("all.ckpt")).unwrap();
    }
    // The same bits by groups.
    let chunk = |k: usize| format!("j/{k:04}.ckpt");
    for k in [0, 2] {
        expect(at, &["merge", &chunk(k), &chunk(k + 1), "-o", &format!("{k}.ckpt")], 0, "2 runs");
    }
    expect(at, &["merge", "2.ckpt", "0.ckpt", "-o", "groups.ckpt"], 0, "4 runs");
    let film = |path: &str| checkpoint::load(&at.join(path)).unwrap().outcome.film;
    assert!(film("groups.ckpt") == film("j/cornell-box.ckpt"));
}

#[test]
fn chunks_that_are_stopped_killed_damaged_or_foreign_are_told_and_healed() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let cornell = scene("cornell-box");
    let plan = ["job", "plan", &cornell, "--spp", "4000", "--chunks", "2", "-o", "j", "--"];
    let options = ["--size", "24x18", "--method", "l2", "-q", "--checkpoint-every", "0.02s"];
    expect(at, &[&plan[..], &options[..]].concat(), 0, "2 chunks");
    for (signal, expected) in [("-TERM", Some(75)), ("-KILL", None), ("-TERM", Some(75))] {
        let mut command = Command::new(assert_cmd::cargo::cargo_bin("fluxion"));
        let mut child = command.current_dir(at).args(["job", "run", "j", "0"]).spawn().unwrap();
        common::signal(&child, signal, Duration::from_millis(200));
        let code = child.wait().unwrap().code();
        assert!(code == expected || code == Some(0), "{signal}: {code:?}");
    }
    expect(at, &["job", "run", "j", "0"], 0, "");
    expect(at, &["job", "run", "j", "1"], 0, "");
    expect(at, &["job", "status", "j", "--json", "-"], 0, "\"complete\": 2");
    let (zero, one) = (at.join("j/0000.ckpt"), at.join("j/0001.ckpt"));
    let kept = fs::read(&one).unwrap();
    // A copy of another chunk, half a file, and a flipped bit, which only its bytes tell.
    fs::copy(&zero, &one).unwrap();
    expect(at, &["job", "status", "j"], 0, "damaged or foreign: 1");
    expect(at, &["job", "run", "j", "1"], 1, "0001.ckpt: is no checkpoint of this chunk");
    fs::write(&one, &kept[..200]).unwrap();
    expect(at, &["job", "status", "j", "--missing"], 0, "1\n");
    let mut flipped = kept.clone();
    flipped[kept.len() - 100] ^= 4;
    fs::write(&one, &flipped).unwrap();
    expect(at, &["job", "status", "j", "--verify"], 0, "damaged or foreign: 1");
    expect(at, &["job", "merge", "j"], 1, "0001.ckpt: is damaged");
    fs::remove_file(&one).unwrap();
    expect(at, &["job", "run", "j", "1"], 0, "");
    let film = |path: &Path| checkpoint::load(path).unwrap().outcome.film;
    fs::write(at.join("kept.ckpt"), &kept).unwrap();
    assert!(film(&one) == film(&at.join("kept.ckpt")));
}

/// A folder of programs that do what those of Slurm do, one task after the other, without a cluster.
fn pretended_slurm(at: &Path) -> String {
    let bin = at.join("bin");
    fs::create_dir_all(&bin).unwrap();
    let program = |name: &str, text: &str| {
        fs::write(bin.join(name), format!("#!/bin/sh\n{text}\n")).unwrap();
        fs::set_permissions(bin.join(name), fs::Permissions::from_mode(0o755)).unwrap();
    };
    // Numbers of an array such as 0-2,5; the script comes on standard input.
    program(
        "sbatch",
        r#"cat > script; echo "$*" >> "$LOG"
for option; do case $option in --array=*) array=${option#*=} ;; esac; done
for part in $(echo "${array:-0}" | tr , ' '); do for task in $(seq "${part%-*}" "${part#*-}"); do
    SLURM_ARRAY_JOB_ID=7 SLURM_ARRAY_TASK_ID=$task sh script >> "$LOG" 2>&1
done; done; echo 7"#,
    );
    program("srun", "exec \"$@\"");
    program("scontrol", "echo \"$@\" >> \"$LOG\"");
    let fluxion = assert_cmd::cargo::cargo_bin("fluxion");
    format!("{}:{}:{}", bin.display(), fluxion.parent().unwrap().display(), std::env::var("PATH").unwrap())
}

#[test]
fn adaptive_jobs_allocate_the_samples_of_a_second_round() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let cornell = scene("cornell-box");
    let options = ["--size", "33x18", "--method", "l2", "-q"];
    let plan = ["job", "plan", &cornell, "--spp", "96", "--chunks", "5", "--adaptive", "variance", "-o"];
    expect(at, &[&plan[..], &["j", "--"], &options[..]].concat(), 0, "5 chunks");
    expect(at, &["job", "status", "j", "--missing"], 0, "0\n");
    expect(at, &["job", "status", "j"], 0, "waiting for `fluxion job allocate`: 1-4");
    expect(at, &["job", "run", "j", "1"], 2, "not allocated yet");
    expect(at, &["job", "allocate", "j"], 2, "chunks 0 of cornell-box are not complete");
    expect(at, &["job", "run", "j", "0"], 0, "");
    expect(at, &["job", "allocate", "j"], 0, "samples a pixel");
    expect(at, &["job", "allocate", "j"], 0, "is allocated");
    expect(at, &["job", "status", "j", "--missing"], 0, "1-4\n");
    for chunk in ["4", "1", "3", "2"] {
        expect(at, &["job", "run", "j", chunk], 0, "");
        expect(at, &["job", "run", "j", chunk], 0, "is complete");
    }
    expect(at, &["job", "merge", "j"], 0, "96.0 samples per pixel");
    // Samples are those of one render of these counts, from the first on.
    let goals = "j/cornell-box.goals.exr";
    let all = ["render", &cornell, "--goals", goals, "--spp", "9999", "--checkpoint", "all.ckpt"];
    expect(at, &[&all[..], &options[..]].concat(), 0, "");
    let merged = developed(&at.join("j/cornell-box.ckpt"));
    assert_close(&merged, &developed(&at.join("all.ckpt")), "cornell-box");
    let counts = &merged.get(Layer::Samples).unwrap().data;
    assert!(counts.iter().any(|&count| count > 120.0) && counts.iter().all(|&count| count >= 24.0 + 35.0));
    // An image's counts will do, and those of another size will not.
    let again = ["render", &cornell, "--goals", "j/cornell-box.exr", "--checkpoint", "again.ckpt"];
    expect(at, &[&again[..], &options[..]].concat(), 0, "");
    let film = |path: &str| checkpoint::load(&at.join(path)).unwrap().outcome.film;
    assert!(film("again.ckpt").counts() == film("all.ckpt").counts());
    let other = ["render", &cornell, "--goals", goals, "--size", "16x12", "-o", "a.exr"];
    expect(at, &other, 1, "is of 33x18 pixels, the film of 16x12");

    // By a scheduler, in one go.
    expect(at, &[&plan[..], &["k", "--"], &options[..]].concat(), 0, "commands-2.txt");
    let submit = |expected: &str| {
        let mut command = Command::new("sh");
        command.current_dir(at).arg("k/slurm.sh").env("PATH", pretended_slurm(at)).env("LOG", at.join("log"));
        let output = command.output().unwrap();
        let text = [&output.stdout, &output.stderr].map(|bytes| String::from_utf8_lossy(bytes).into_owned()).concat();
        assert!(output.status.success() && text.contains(expected), "{text}");
    };
    submit("array 7, merge 7");
    let log = fs::read_to_string(at.join("log")).unwrap();
    for part in ["--array=0 ", "--array=1-4 ", "--dependency=afterok:7", "fluxion-allocate", "--dependency=afterany:7"]
    {
        assert!(log.contains(part), "{part}: {log}");
    }
    assert!(film("k/cornell-box.ckpt") == film("j/cornell-box.ckpt"));
    submit("all chunks are complete");
    let template: serde_json::Value = serde_json::from_slice(&fs::read(at.join("k/openjd.yaml")).unwrap()).unwrap();
    let steps = template["steps"].as_array().unwrap();
    let names: Vec<_> = steps.iter().map(|step| step["name"].as_str().unwrap()).collect();
    assert_eq!(names, ["Render", "Allocate", "RenderSecond", "Merge"]);
    assert_eq!(steps[3]["dependencies"][0]["dependsOn"], "RenderSecond");
}

#[test]
fn scripts_for_schedulers_carry_out_the_plan() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let plan = ["job", "plan", &scene("cornell-box"), "--spp", "32", "--chunks", "4", "-o", "it's", "--"];
    expect(at, &[&plan[..], &["--size", "16x12", "--method", "l2", "-q"]].concat(), 0, "4 chunks");
    expect(at, &["job", "run", "it's", "1"], 0, "");
    let path = pretended_slurm(at);
    let submit = || {
        let mut command = Command::new("sh");
        command
            .current_dir(at)
            .args(["it's/slurm.sh", "--partition=low"])
            .env("PATH", &path)
            .env("LOG", at.join("log"));
        let output = command.output().unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        String::from_utf8(output.stdout).unwrap()
    };
    assert_eq!(submit(), "array 7, merge 7\n");
    let log = fs::read_to_string(at.join("log")).unwrap();
    assert!(log.contains("--array=0,2-3") && log.contains("--partition=low") && log.contains("afterany:7"), "{log}");
    assert!(at.join("it's/cornell-box.exr").exists(), "{log}");
    assert!(submit().contains("all chunks are complete"));
    // Every task of the template runs one of the chunks, and the last step is the merge.
    let template: serde_json::Value = serde_json::from_slice(&fs::read(at.join("it's/openjd.yaml")).unwrap()).unwrap();
    let steps = template["steps"].as_array().unwrap();
    assert_eq!(steps[0]["parameterSpace"]["taskParameterDefinitions"][0]["range"], "0-3");
    let words = |step: usize| steps[step]["script"]["actions"]["onRun"]["args"].as_array().unwrap();
    assert!(
        words(0)[..3] == ["job", "run", "--quiet"] && words(1)[..2] == ["job", "merge"] && words(0)[3] == words(1)[2]
    );
}

#[test]
fn frames_are_images_of_their_own_and_scenes_must_not_change() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let text = format!(
        "<scene version=\"3.0.0\"><default name=\"frame\" value=\"1\"/>{}<shape type=\"sphere\"><emitter type=\"area\">\
         <rgb name=\"radiance\" value=\"$frame\"/></emitter></shape></scene>",
        common::sensor("0,0,4", 8, 6)
    );
    fs::write(at.join("lamp.xml"), &text).unwrap();
    let plan = |frames: &str, to: &str, code: i32, part: &str| {
        let line = ["job", "plan", "lamp.xml", "--frames", frames, "--spp", "16", "--chunks", "2", "-o", to];
        expect(at, &[&line[..], &["--", "--method", "primal", "-q"]].concat(), code, part);
    };
    plan("3-1", "none", 2, "not a range such as 1-250");
    plan("9-11", "j", 0, "6 chunks");
    for chunk in ["0", "1", "2", "3", "4"] {
        expect(at, &["job", "run", "j", chunk], 0, "");
    }
    expect(at, &["job", "merge", "j"], 2, "chunks 5 of lamp_0011");
    expect(at, &["job", "run", "j", "5"], 0, "");
    expect(at, &["job", "merge", "j"], 0, "lamp_0011.exr");
    for frame in [9, 10, 11] {
        let image = fluxion::image::io::read_color(&at.join(format!("j/lamp_{frame:04}.exr"))).unwrap();
        assert_eq!(image.rgb(4, 3).x, frame as f32);
    }
    plan("1", "k", 0, "2 chunks");
    fs::write(at.join("lamp.xml"), text.replace("sphere", "rectangle")).unwrap();
    expect(at, &["job", "run", "k", "0"], 1, "lamp.xml: has changed since the plan");
}

#[test]
fn plans_that_cannot_be_carried_out_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let cornell = scene("cornell-box");
    for (extra, expected) in [
        (&["--spp", "16", "--chunks", "3"][..], "at most 2 chunks of eight"),
        (&["--spp", "16", "--", "--no-such-option"], "--no-such-option"),
        (&["--spp", "16", "--", "--spp", "4"], "--spp"),
        (&["--spp", "16", "--", "--method", "l2", "--kernel", "structure"], "pilots of their own"),
        (&["--spp", "16", "--chunks", "0"], "--chunks"),
        (&["--spp", "64", "--adaptive"], "two rounds take --chunks 2"),
        (&["--spp", "64", "--", "--adaptive"], "give --adaptive before the --"),
        (&["--spp", "64", "--", "--target-error", "0.01"], "neither --target-error nor --goals"),
        (&["--spp", "64", "--chunks", "4", "--adaptive", "--", "--method", "l1"], "does not estimate its error"),
    ] {
        expect(at, &[&["job", "plan", &cornell, "-o", "j"], extra].concat(), 2, expected);
    }
    expect(at, &["job", "plan", &cornell, &cornell, "--spp", "8", "-o", "j"], 2, "two scenes are called cornell-box");
    expect(at, &["job", "plan", "nowhere.xml", "--spp", "8", "-o", "j"], 1, "nowhere.xml");
    expect(at, &["job", "status", "j"], 1, "job.json");
    assert!(!at.join("j/job.json").exists());
}
