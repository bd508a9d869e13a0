//! Who may use whom, by scanning the paths that start with `crate::`.

use std::fs;
use std::path::{Path, PathBuf};

/// Modules, and the modules that each may use besides itself and [`EVERYBODYS`], as docs/design/architecture.md says.
fn allowed() -> Vec<(String, Vec<String>)> {
    let text = fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/design/architecture.md")).unwrap();
    let rows = text.lines().filter_map(|line| line.strip_prefix("| `src/")?.strip_suffix('|'));
    let row = |row: &str| {
        let cells: Vec<_> = row.split('|').map(str::trim).collect();
        let module = cells[0].trim_end_matches('`').trim_end_matches(".rs").to_owned();
        (module, cells[2].split(", ").filter(|used| !used.is_empty()).map(str::to_owned).collect())
    };
    let found: Vec<_> = rows.map(row).collect();
    assert!(found.len() > 20, "the table of docs/design/architecture.md was not found");
    found
}

/// Modules that everybody may use.
const EVERYBODYS: [&str; 2] = ["error", "sync"];

/// Files that may use `ffi`; everything else goes through them.
const FFI_USERS: &[&str] = &[
    "src/nn/convolution.rs",
    "src/image/io.rs",
    "src/reconstruct/oidn/library.rs",
    "src/scene/accel.rs",
    "src/scene/ray_log.rs",
    "src/scene/packet/rays.rs",
    "src/scene/packet/surfaces.rs",
    "src/scene/texture/texels.rs",
    "src/scene/shape/mod.rs",
    "src/scene/shape/mesh.rs",
    "src/scene/shape/sphere.rs",
    "src/scene/shape/disk.rs",
    "src/scene/shape/curves.rs",
    "src/scene/shape/cylinder.rs",
];

/// Files with an extension in a folder and those below it.
pub fn files_below(folder: &Path, extension: &str) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            found.extend(files_below(&path, extension));
        } else if path.extension().is_some_and(|other| other == extension) {
            found.push(path);
        }
    }
    found
}

/// Names and texts of all source files.
pub fn sources() -> Vec<(String, String)> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let name = |path: &Path| path.strip_prefix(root).unwrap().display().to_string();
    let found = files_below(&root.join("src"), "rs");
    found.iter().map(|path| (name(path), fs::read_to_string(path).unwrap())).collect()
}

#[test]
fn modules_use_only_what_they_may() {
    let rows = allowed();
    let mut wrong = Vec::new();
    for (name, text) in sources() {
        let module = name.trim_start_matches("src/").split(['/', '.']).next().unwrap().to_owned();
        let Some((_, allowed)) = rows.iter().find(|(known, _)| *known == module) else {
            assert!(["lib", "main", "cli"].contains(&module.as_str()), "{name} belongs to no module of the table");
            continue;
        };
        // Tests may use everything.
        let tests = text.lines().position(|line| line == "mod tests {").unwrap_or(usize::MAX);
        let text = text.lines().take(tests).collect::<Vec<_>>().join("\n");
        for (_, rest) in text.match_indices("crate::").map(|(at, _)| text[at..].split_once("::").unwrap()) {
            let used: String = rest.chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect();
            if used != module && !EVERYBODYS.contains(&used.as_str()) && !allowed.contains(&used) {
                wrong.push(format!("{name} uses {used}"));
            }
            if used == "ffi" && module != "ffi" && !FFI_USERS.contains(&name.as_str()) {
                wrong.push(format!("{name} uses ffi directly"));
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn no_grant_is_stale() {
    let sources = sources();
    for (module, allowed) in &allowed() {
        let own = sources
            .iter()
            .filter(|(name, _)| name.starts_with(&format!("src/{module}/")) || *name == format!("src/{module}.rs"));
        let text: String = own.map(|(_, text)| text.as_str()).collect();
        for used in allowed {
            assert!(text.contains(&format!("crate::{used}")), "{module} may use {used}, and does not");
        }
    }
}

#[test]
fn unsafe_code_is_in_ffi_and_files_are_short() {
    for (name, text) in sources() {
        assert!(name.starts_with("src/ffi/") || !text.contains("unsafe {"), "{name} holds unsafe code");
        assert!(text.lines().count() <= 400, "{name} has more than 400 lines");
    }
}

/// Lines of every function, by the line that it starts on. Formatted code ends it by a brace at its own indentation.
fn functions(text: &str) -> Vec<(usize, usize)> {
    let lines: Vec<&str> = text.lines().collect();
    let mut found = Vec::new();
    for (start, line) in lines.iter().enumerate() {
        let indentation = &line[..line.len() - line.trim_start().len()];
        let words = line.trim_start().split([' ', '(', '<']).take_while(|word| !word.contains(':'));
        if line.trim_end().ends_with(';')
            || !words.take(5).any(|word| word == "fn")
            || line.trim_start().starts_with("//")
        {
            continue;
        }
        let end = lines[start..].iter().position(|line| *line == format!("{indentation}}}"));
        found.extend(end.map(|length| (start + 1, length + 1)));
    }
    found
}

#[test]
fn functions_are_short() {
    let mut long = Vec::new();
    for (name, text) in sources() {
        let too_long = functions(&text).into_iter().filter(|(_, length)| *length > 60);
        long.extend(too_long.map(|(start, length)| format!("{name}:{start} has {length} lines")));
    }
    assert!(long.is_empty(), "{}", long.join("\n"));
    assert_eq!(functions("fn a() {\n    1;\n}\n"), [(1, 3)]);
}

/// The file of a module path below `src`, or of the longest part of it that is a module.
fn file_of(path: &[String], names: &[String]) -> Option<String> {
    (1..=path.len()).rev().find_map(|length| {
        let base = format!("src/{}", path[..length].join("/"));
        [format!("{base}.rs"), format!("{base}/mod.rs")].into_iter().find(|file| names.contains(file))
    })
}

/// Files that a file uses by `use` declarations.
fn used_files(name: &str, text: &str, names: &[String]) -> Vec<String> {
    let module = name.trim_start_matches("src/").trim_end_matches(".rs").trim_end_matches("/mod");
    let here: Vec<String> = module.split('/').map(str::to_owned).collect();
    let code = text.split("#[cfg(test)]").next().unwrap_or_default();
    let mut used = Vec::new();
    for declaration in code.split("use ").skip(1).filter_map(|rest| rest.split(';').next()) {
        let (prefix, items) = declaration.split_once('{').unwrap_or((declaration, ""));
        let mut path: Vec<String> = Vec::new();
        for part in prefix.split("::").map(str::trim).filter(|part| !part.is_empty()) {
            match part {
                "crate" => path.clear(),
                "self" => path = here.clone(),
                "super" if path.is_empty() => path = here[..here.len() - 1].to_vec(),
                "super" => drop(path.pop()),
                part => path.push(part.to_owned()),
            }
        }
        let starts_here = ["crate", "self", "super"].iter().any(|start| prefix.trim_start().starts_with(start));
        if !starts_here {
            continue;
        }
        used.extend(file_of(&path, names));
        for item in items.trim_end_matches('}').split(',').map(str::trim).filter(|item| !item.is_empty()) {
            let full = path.iter().cloned().chain(item.split("::").map(|part| part.trim().to_owned()));
            used.extend(file_of(&full.collect::<Vec<_>>(), names));
        }
    }
    used.retain(|file| file != name);
    used
}

/// A folder's `mod.rs` holds a trait and the table of the rows that implement it, so it and the files below it name each
/// other; every other circle of files stays within one folder.
#[test]
fn files_of_different_folders_are_in_no_circle() {
    let sources = sources();
    let names: Vec<String> = sources.iter().map(|(name, _)| name.clone()).collect();
    let folder = |name: &str| name.rsplit_once('/').unwrap().0.to_owned();
    let uses: Vec<Vec<usize>> = sources
        .iter()
        .map(|(name, text)| {
            let is_table_of = |file: &str| name.ends_with("/mod.rs") && file.starts_with(&format!("{}/", folder(name)));
            let used = used_files(name, text, &names);
            let outward = used.iter().filter(|file| !is_table_of(file));
            outward.map(|file| names.iter().position(|other| other == file).unwrap()).collect()
        })
        .collect();
    assert!(uses.iter().map(Vec::len).sum::<usize>() > 500, "hardly any file uses another: are declarations read?");
    let mut circles = Vec::new();
    for start in 0..names.len() {
        // Everything that can be reached from here; if this is among it, by way of another folder, there is a circle.
        let (mut reached, mut open) = (vec![false; names.len()], vec![start]);
        while let Some(at) = open.pop() {
            for &next in &uses[at] {
                if !std::mem::replace(&mut reached[next], true) {
                    open.push(next);
                }
            }
        }
        if reached[start] {
            let back = |&other: &usize| {
                let (mut seen, mut open) = (vec![false; names.len()], vec![other]);
                while let Some(at) = open.pop() {
                    for &next in &uses[at] {
                        if !std::mem::replace(&mut seen[next], true) {
                            open.push(next);
                        }
                    }
                }
                seen[start]
            };
            let others =
                (0..names.len()).filter(|&other| reached[other] && folder(&names[other]) != folder(&names[start]));
            circles.extend(others.filter(back).map(|other| format!("{} and {}", names[start], names[other])));
        }
    }
    assert!(circles.is_empty(), "{}", circles.join("\n"));
}
