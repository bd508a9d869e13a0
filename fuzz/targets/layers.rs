//! Any bytes as an EXR file of layers, ours or another program's.
#![no_main]

use fluxion::film::exr;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    let folder = tempfile::tempdir().expect("a folder for the file");
    let path = folder.path().join("layers.exr");
    std::fs::write(&path, bytes).expect("room for the file");
    if let Ok((frame, _)) = exr::load_other(&path, exr::Reading { spp: Some(4), view_layer: None }) {
        assert!(frame.present().all(|(_, image)| image.width == frame.width && image.height == frame.height));
    }
});
