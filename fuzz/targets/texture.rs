//! Any bytes as an image file of a texture: the first one chooses format, channel and memory.
#![no_main]

use fluxion::image::channels::Integers;
use fluxion::scene::texture::{Memory, Selection, Texels};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    let Some((choice, rest)) = bytes.split_first() else { return };
    let folder = tempfile::tempdir().expect("a folder for the file");
    let extension = ["exr", "png", "tif", "hdr"][usize::from(choice % 4)];
    let path = folder.path().join("texture").with_extension(extension);
    std::fs::write(&path, rest).expect("room for the file");
    let channel = [None, Some("a".to_owned())][usize::from(choice / 4 % 2)].clone();
    let integers = if choice & 8 == 0 { Integers::Raw } else { Integers::Gamma(2.2) };
    let selection = Selection { integers, channel };
    let room = if choice & 16 == 0 { 1 << 30 } else { 0 };
    if let Ok((texels, _)) = Texels::read(&path, &selection, &mut Memory::new(room)) {
        for (x, y) in [(0, 0), (texels.width - 1, texels.height - 1), (texels.width / 2, texels.height / 2)] {
            assert!(texels.texel(x, y).is_finite());
        }
    }
});
