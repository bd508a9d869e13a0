//! Who may use whom, by scanning the paths that start with `crate::`.

use std::fs;
use std::path::{Path, PathBuf};

/// Module, and the modules that it may use besides itself and `error`.
const ALLOWED: &[(&str, &[&str])] = &[
    ("error", &[]),
    ("files", &[]),
    ("math", &[]),
    ("ffi", &[]),
    ("image", &["math", "ffi", "files"]),
    ("scene", &["math", "image", "ffi"]),
    ("film", &["math", "image"]),
    ("solve", &["math", "film"]),
    ("synthetic", &["math", "image", "film"]),
    ("plan", &["scene", "film"]),
    ("render", &["scene", "film", "plan", "image", "math"]),
    ("reconstruct", &["film", "image", "solve", "math"]),
    ("adaptive", &["scene", "render", "film", "reconstruct", "image", "math"]),
    ("checkpoint", &["scene", "render", "film", "adaptive", "image", "math", "files"]),
    ("metrics", &["image", "math"]),
    ("reference", &["scene", "film", "render", "image", "math"]),
    ("validate", &["scene", "reference", "render", "image"]),
    ("stress", &["scene", "render", "film", "image", "reconstruct", "solve", "synthetic", "math", "files"]),
    (
        "bench",
        &[
            "scene",
            "plan",
            "film",
            "render",
            "image",
            "math",
            "reconstruct",
            "adaptive",
            "reference",
            "metrics",
            "files",
        ],
    ),
    ("report", &["bench", "stress", "image", "math", "metrics"]),
];

/// Files that may use `ffi`; everything else goes through them.
const FFI_USERS: &[&str] = &[
    "src/image/io.rs",
    "src/image/oidn.rs",
    "src/scene/accel.rs",
    "src/scene/ray_log.rs",
    "src/scene/packet/rays.rs",
    "src/scene/packet/surfaces.rs",
    "src/scene/shape/mod.rs",
    "src/scene/shape/mesh.rs",
    "src/scene/shape/sphere.rs",
    "src/scene/shape/disk.rs",
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
    let mut wrong = Vec::new();
    for (name, text) in sources() {
        let module = name.trim_start_matches("src/").split(['/', '.']).next().unwrap().to_owned();
        let Some((_, allowed)) = ALLOWED.iter().find(|(known, _)| *known == module) else {
            assert!(["lib", "main", "cli"].contains(&module.as_str()), "{name} belongs to no module of the table");
            continue;
        };
        for (_, rest) in text.match_indices("crate::").map(|(at, _)| text[at..].split_once("::").unwrap()) {
            let used: String = rest.chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect();
            if used != module && used != "error" && !allowed.contains(&used.as_str()) {
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
fn unsafe_code_is_in_ffi_and_files_are_short() {
    for (name, text) in sources() {
        assert!(name.starts_with("src/ffi/") || !text.contains("unsafe {"), "{name} holds unsafe code");
        assert!(text.lines().count() <= 700, "{name} has more than 700 lines");
    }
}
