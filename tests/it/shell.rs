//! What other programs see: completions, manual pages, schemas of JSON, and the viewer's protocol.

use std::io::Read;
use std::net::{TcpListener, TcpStream};
use std::path::Path;
use std::process::Command as Process;

use fluxion::image::io::read_color;
use serde_json::Value;

use crate::cli::{fluxion, scene};

fn output(folder: &Path, arguments: &[&str]) -> String {
    let output = fluxion(folder).args(arguments).output().unwrap();
    assert!(output.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap()
}

#[test]
fn completions_are_scripts_that_know_the_options() {
    let folder = tempfile::tempdir().unwrap();
    for shell in ["bash", "elvish", "fish", "powershell", "zsh"] {
        let script = output(folder.path(), &["completions", shell]);
        for word in ["reconstruct", "target-error", "display"] {
            assert!(script.contains(word), "{shell}: {word}");
        }
    }
    // Bash itself completes by it.
    std::fs::write(folder.path().join("script"), output(folder.path(), &["completions", "bash"])).unwrap();
    let complete = "source ./script; COMP_WORDS=(fluxion render --target); COMP_CWORD=2; _fluxion fluxion --target render; \
                    echo ${COMPREPLY[@]}";
    let found = Process::new("bash").current_dir(folder.path()).args(["-c", complete]).output().unwrap();
    assert_eq!(String::from_utf8_lossy(&found.stdout).trim(), "--target-error", "{found:?}");
}

#[test]
fn every_command_has_a_manual_page() {
    let folder = tempfile::tempdir().unwrap();
    output(folder.path(), &["man", "-o", "man"]);
    let help = output(folder.path(), &["--help"]);
    let commands = help.lines().skip_while(|line| *line != "Commands:").skip(1).take_while(|line| !line.is_empty());
    let names: Vec<_> = commands.filter_map(|line| line.strip_prefix("  ")?.split(' ').next()).collect();
    assert!(names.len() > 12, "{names:?}");
    for name in names.iter().filter(|name| !name.is_empty() && **name != "help") {
        let page = std::fs::read_to_string(folder.path().join(format!("man/fluxion-{name}.1"))).unwrap();
        assert!(page.contains(".SH NAME") && page.contains(".SH OPTIONS"), "{name}");
    }
    let page = std::fs::read_to_string(folder.path().join("man/fluxion-job-plan.1")).unwrap();
    assert!(page.contains("chunks"));
}

/// Fails where a value is not what a schema says: of another type, with names that it does not know or without those that it asks for.
fn check(value: &Value, schema: &Value, whole: &Value, at: &str) {
    if let Some(name) = schema.get("$ref").and_then(Value::as_str) {
        let name = name.strip_prefix("#/$defs/").unwrap();
        return check(value, &whole["$defs"][name], whole, at);
    }
    let kind = match value {
        Value::Null => "null",
        Value::Bool(_) => "boolean",
        Value::Number(number) if number.is_f64() => "number",
        Value::Number(_) => "integer",
        Value::String(_) => "string",
        Value::Array(_) => "array",
        Value::Object(_) => "object",
    };
    let allows = |allowed: &Value| allowed == kind || (allowed == "number" && kind == "integer");
    match &schema["type"] {
        Value::Array(kinds) => assert!(kinds.iter().any(allows), "{at}: {kind} instead of {kinds:?}"),
        Value::Null => {}
        allowed => assert!(allows(allowed), "{at}: {kind} instead of {allowed}"),
    }
    if let (Some(values), Some(items)) = (value.as_array(), schema.get("items")) {
        values.iter().for_each(|value| check(value, items, whole, at));
    }
    let (Some(object), Some(properties)) = (value.as_object(), schema["properties"].as_object()) else { return };
    for (name, value) in object {
        let at = format!("{at}.{name}");
        check(value, properties.get(name).unwrap_or_else(|| panic!("{at} is not in the schema")), whole, &at);
    }
    for name in schema["required"].as_array().into_iter().flatten() {
        assert!(object.contains_key(name.as_str().unwrap()), "{at} lacks {name}");
    }
}

#[test]
fn schemas_are_those_of_what_is_written() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let (cornell, small) = (scene("cornell-box"), ["--size", "24x18", "--spp", "8", "-q"]);
    let adaptive =
        ["render", &cornell, "-o", "a.exr", "--size", "24x18", "--spp", "32", "-q", "--adaptive", "--json", "-"];
    let adaptive = output(at, &adaptive);
    output(at, &[&["render", &cornell, "--samples", "s", "--method", "l2"][..], &small].concat());
    output(at, &["dataset", &cornell, "-o", "d", "--spp", "2,4", "--reference", "8", "--size", "16x12", "-q"]);
    output(at, &["job", "plan", &cornell, "--spp", "32", "--chunks", "2", "--adaptive", "variance", "-o", "j"]);
    let bench = ["bench", &cornell, "--spp", "2", "--seeds", "1", "--methods", "primal", "-o", "b", "-q"];
    output(at, &bench);
    output(at, &["stress", "--filter", "frames/black", "--json", "stress.json"]);
    let file = |path: &str| std::fs::read_to_string(at.join(path)).unwrap();
    // Long enough for a line, which comes every second, on any machine.
    let timed = ["render", &cornell, "-o", "p.exr", "--size", "24x18", "--time", "3s", "--progress", "json"];
    let progress = String::from_utf8(fluxion(at).args(timed).output().unwrap().stderr).unwrap();
    let line = progress.lines().find(|line| line.starts_with('{')).unwrap_or_else(|| panic!("no line: {progress}"));
    for (kind, text) in [
        ("render", adaptive),
        ("compare", output(at, &["compare", "a.exr", "a.exr", "--json", "-"])),
        ("bench", file("b/results.json")),
        ("stress", file("stress.json")),
        ("job", file("j/job.json")),
        ("status", output(at, &["job", "status", "j", "--json", "-"])),
        ("dataset", file("d/cornell-box.json")),
        ("samples", file("s/samples.json")),
        ("progress", line.to_owned()),
    ] {
        let schema: Value = serde_json::from_str(&output(at, &["schema", kind])).unwrap();
        let value: Value = serde_json::from_str(&text).unwrap_or_else(|error| panic!("{kind}: {error}: {text}"));
        check(&value, &schema, &schema, kind);
    }
}

/// Reads a packet: the length of all of it, and the rest.
fn packet(stream: &mut TcpStream) -> Option<Vec<u8>> {
    let mut length = [0; 4];
    stream.read_exact(&mut length).ok()?;
    let mut rest = vec![0; u32::from_le_bytes(length) as usize - 4];
    stream.read_exact(&mut rest).ok()?;
    Some(rest)
}

#[test]
fn the_viewer_is_shown_the_image_while_it_is_rendered() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path().to_path_buf();
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = format!("tev:127.0.0.1:{}", listener.local_addr().unwrap().port());
    let render = ["-o", "a.exr", "--size", "24x18", "--spp", "8", "--method", "l2", "-q", "--display", &address];
    let mut child = Process::new(assert_cmd::cargo::cargo_bin("fluxion"));
    let mut child = child.current_dir(&at).args(["render", &scene("cornell-box")]).args(render).spawn().unwrap();
    let (mut stream, _) = listener.accept().unwrap();
    let packets: Vec<_> = std::iter::from_fn(|| packet(&mut stream)).collect();
    assert!(child.wait().unwrap().success());
    // A picture is made (4) and then changed (6): whether it is brought forward, its name, and numbers.
    let head = |kind: u8, front: u8, numbers: &[u32]| {
        let numbers: Vec<u8> = numbers.iter().flat_map(|number| number.to_le_bytes()).collect();
        [&[kind, front][..], b"a.exr\0", &numbers].concat()
    };
    let made = [head(4, 1, &[24, 18, 3]), b"R\0G\0B\0".to_vec()].concat();
    assert_eq!(packets[0], made);
    assert!(packets.len() >= 3, "the samples and the result");
    let area: Vec<u8> = [0u32, 0, 24, 18].iter().flat_map(|number| number.to_le_bytes()).collect();
    let strides: Vec<u8> = [0u64, 1, 2, 3, 3, 3].iter().flat_map(|number| number.to_le_bytes()).collect();
    let changed = [head(6, 0, &[3]), b"R\0G\0B\0".to_vec(), area, strides].concat();
    for packet in &packets[1..] {
        assert_eq!(packet[..changed.len()], changed);
        assert_eq!(packet.len() - changed.len(), 24 * 18 * 3 * 4);
    }
    // The last picture is the image.
    let shown: Vec<f32> = packets.last().unwrap()[changed.len()..]
        .chunks_exact(4)
        .map(|bytes| f32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]))
        .collect();
    assert_eq!(shown, read_color(&at.join("a.exr")).unwrap().data);

    let (code, text) = crate::cli::stderr(fluxion(&at).args([
        "render",
        &scene("cornell-box"),
        "-o",
        "b.exr",
        "--display",
        "tev:127.0.0.1:1",
    ]));
    assert!(code == 1 && text.contains("no tev at 127.0.0.1:1"), "{text}");
    let (code, text) =
        crate::cli::stderr(fluxion(&at).args(["render", &scene("cornell-box"), "-o", "b.exr", "--display", "vlc"]));
    assert!(code == 2 && text.contains("tev:HOST:PORT"), "{text}");
}
