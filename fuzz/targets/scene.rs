//! Any text as a scene file.
#![no_main]

use fluxion::mitsuba;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    let folder = tempfile::tempdir().expect("a folder for the scene");
    let path = folder.path().join("scene.xml");
    std::fs::write(&path, bytes).expect("room for the scene");
    let options = mitsuba::Options { threads: 1, size: Some((4, 4)), ..mitsuba::Options::default() };
    let _ = mitsuba::load(&path, &options);
});
