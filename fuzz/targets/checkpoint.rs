//! Any bytes as a checkpoint, with the checksum that they ought to have: without it hardly anything would get past it.
#![no_main]

use fluxion::checkpoint;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    let folder = tempfile::tempdir().expect("a folder for the file");
    let path = folder.path().join("a.ckpt");
    let mut sum = crc32fast::Hasher::new();
    sum.update(bytes);
    std::fs::write(&path, [bytes, &sum.finalize().to_le_bytes()].concat()).expect("room for the file");
    if let Ok(found) = checkpoint::load(&path) {
        found.outcome.film.develop();
    }
});
