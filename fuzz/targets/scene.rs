//! Any text as a scene file.
#![no_main]

use fluxion::scene::load;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    let folder = tempfile::tempdir().expect("a folder for the scene");
    let path = folder.path().join("scene.xml");
    std::fs::write(&path, bytes).expect("room for the scene");
    let options = load::Options { threads: 1, size: Some((4, 4)), ..load::Options::default() };
    let _ = load::load(&path, &options);
});
