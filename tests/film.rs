//! Films and files: threads do not matter, nothing is lost on disk, an independent reader sees the same.

mod common;

use common::{ALL, bundled, film};
use fluxion::film::{Layer, exr as layers};

fn on_threads(threads: usize) -> fluxion::film::Film {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
    pool.install(|| film(&bundled("glossy-metal", (37, 21)), 10, 3, ALL))
}

#[test]
fn one_thread_and_two_give_the_same_bits() {
    assert!(on_threads(1) == on_threads(2));
}

#[test]
fn every_layer_survives_a_file_bit_for_bit() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("layers.exr");
    let mut frame = film(&bundled("glossy-metal", (19, 23)), 9, 3, ALL).develop();
    frame.attributes = vec![("fluxion:seed".into(), "3".into())];
    layers::save(&path, &frame).unwrap();
    let back = layers::load(&path).unwrap();
    assert_eq!(back.present().count(), Layer::COUNT);
    assert!(back == frame);
}

/// The `exr` crate knows nothing of OpenImageIO.
#[test]
fn an_independent_reader_finds_the_channels_by_name() {
    use exr::prelude::*;
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("layers.exr");
    let frame = film(&bundled("unit/diffuse", (8, 6)), 4, 3, ALL).develop();
    layers::save(&path, &frame).unwrap();
    let image = read_first_flat_layer_from_file(&path).unwrap();
    assert_eq!(image.layer_data.size, Vec2(8, 6));
    for (layer, values) in frame.present() {
        for (c, name) in layer.channel_names().iter().enumerate() {
            let channel = image.layer_data.channel_data.list.iter().find(|channel| channel.name.to_string() == *name);
            let FlatSamples::F32(samples) = &channel.unwrap_or_else(|| panic!("no {name}")).sample_data else {
                panic!("{name} is not stored in full")
            };
            let expected: Vec<_> = values.data.iter().skip(c).step_by(values.channels).copied().collect();
            assert_eq!(samples, &expected, "{name}");
        }
    }
}
