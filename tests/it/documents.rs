//! Documents: tables are what their figures say, examples run, links lead somewhere, and sentences do without figures.

use std::path::{Path, PathBuf};
use std::process::Command;

use crate::architecture::files_below;
use crate::cli::{fluxion, scene};

/// Longest README and pages of the guide, in lines.
const README: usize = 80;
const PAGE: usize = 120;

/// Mark before a block of commands that is tried.
const RUNS: &str = "<!-- runs -->";

/// Words before numbers that are versions.
const VERSIONED: [&str; 8] = ["Mitsuba", "Embree", "Rust", "OpenImageIO", "Debian", "Python", "version", "versions"];

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// Pages at the top and in folders of their own, and everything below docs.
fn documents() -> Vec<(PathBuf, String)> {
    let tops = ["README.md", "CONTRIBUTING.md", "CHANGELOG.md"];
    let tops = tops.into_iter().chain(["figures/README.md", "python/README.md", "scenes/README.md", "tools/README.md"]);
    let paths = tops.map(|name| root().join(name)).chain(files_below(&root().join("docs"), "md"));
    paths.map(|path| (path.clone(), std::fs::read_to_string(path).unwrap())).collect()
}

fn guide() -> Vec<(PathBuf, String)> {
    documents().into_iter().filter(|(path, _)| path.starts_with(root().join("docs/guide"))).collect()
}

#[test]
fn tables_are_what_their_figures_say() {
    for arguments in [&["tools/figures", "check"][..], &["-m", "unittest", "discover", "-s", "tools/figures"]] {
        let output = Command::new("python3").current_dir(root()).args(arguments).output().unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    }
}

#[test]
fn pages_are_short_and_have_an_example_that_runs() {
    let readme = std::fs::read_to_string(root().join("README.md")).unwrap();
    assert!(readme.lines().count() <= README, "README.md has {} lines", readme.lines().count());
    for (path, text) in guide() {
        let lines = text.lines().count();
        assert!(lines <= PAGE, "{} has {lines} lines", path.display());
        assert!(text.contains(RUNS) || path.ends_with("README.md"), "{} has no example that runs", path.display());
    }
}

/// Commands of the blocks that are marked to be tried.
fn commands(text: &str) -> Vec<&str> {
    let blocks = text.split(RUNS).skip(1).map(|rest| rest.trim_start_matches('\n'));
    let lines = blocks.flat_map(|block| block.lines().take_while(|line| line.starts_with("    ")));
    lines.map(|line| line.split(" #").next().unwrap().trim()).collect()
}

#[test]
fn examples_of_the_guide_run() {
    let small = std::fs::read_to_string(scene("cornell-box")).unwrap().replace("value=\"128\"", "value=\"32\"");
    assert!(small.matches("value=\"32\"").count() == 2, "the scene has another size than this test knows of");
    let mut tried = 0;
    for (path, text) in guide() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("scene.xml"), &small).unwrap();
        // Examples in Python are tested with the module.
        let found = commands(&text);
        assert!(!found.is_empty() || text.contains("```python"), "{}: no command below {RUNS}", path.display());
        for line in found {
            let words: Vec<&str> = line.split_whitespace().collect();
            assert_eq!(words[0], "fluxion", "{}: {line}", path.display());
            let output = fluxion(folder.path()).args(&words[1..]).output().unwrap();
            let error = String::from_utf8_lossy(&output.stderr);
            assert!(output.status.success(), "{}: {line}: {error}", path.display());
            tried += 1;
        }
    }
    assert!(tried > 15, "{tried} examples");
}

#[test]
fn links_lead_to_files() {
    let mut wrong = Vec::new();
    for (path, text) in documents() {
        for (_, rest) in text.match_indices("](").map(|(at, _)| text.split_at(at + 2)) {
            let link = rest.split(')').next().unwrap();
            let file = link.split('#').next().unwrap();
            if !link.contains("://") && !file.is_empty() && !path.parent().unwrap().join(file).exists() {
                wrong.push(format!("{}: {link}", path.display()));
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// Whether a word is a number with decimals, such as 0.71, 3e-5 or 4.5.
fn is_decimal(word: &str) -> bool {
    let plain = word.trim_matches(|c: char| !c.is_ascii_digit());
    let number = plain.parse::<f64>().is_ok() && (plain.contains('.') || plain.contains("e-"));
    number && plain.starts_with(|c: char| c.is_ascii_digit())
}

/// A line without what is between backticks.
fn without_code(line: &str) -> String {
    line.split('`').step_by(2).collect::<Vec<_>>().join(" ")
}

#[test]
fn sentences_and_tables_by_hand_have_no_decimals() {
    // Experiments are history, and figures are printed.
    let printed = ["docs/experiments.md", "docs/figures", "CHANGELOG.md"].map(|name| root().join(name));
    let mut found = Vec::new();
    for (path, text) in documents().into_iter().filter(|(path, _)| !printed.iter().any(|top| path.starts_with(top))) {
        let (mut in_figure, mut in_block) = (false, false);
        for (number, line) in text.lines().enumerate() {
            in_figure = (in_figure || line.starts_with("<!-- figure")) && !line.starts_with("<!-- end");
            in_block ^= line.trim_start().starts_with("```");
            if in_figure || in_block || line.starts_with("    ") {
                continue;
            }
            let line = without_code(line);
            let words: Vec<&str> = line.split_whitespace().collect();
            for (k, word) in words.iter().enumerate().filter(|(_, word)| is_decimal(word)) {
                let before = k.checked_sub(1).map_or("", |k| words[k].trim_matches(|c: char| !c.is_alphanumeric()));
                if !VERSIONED.contains(&before) {
                    found.push(format!("{}:{}: {word}", path.display(), number + 1));
                }
            }
        }
    }
    assert!(found.is_empty(), "{}", found.join("\n"));
}
