//! Packets of rays and waves of paths by themselves, on bundled scenes: `cargo bench --bench trace`.

use std::path::Path;

use divan::Bencher;
use divan::counter::ItemsCount;
use fluxion::film::TILE;
use fluxion::internals::math::lanes::{LANES, Lanes, Lanes3, Mask};
use fluxion::mitsuba;
use fluxion::render::{SHIFTS, Shift};
use fluxion::render::{SampleId, sample};
use fluxion::scene::packet::{Rays, ShadowRays, Surfaces};
use fluxion::scene::{Purpose, Scene};

const SCENES: [&str; 3] = ["cornell-box", "glossy-metal", "door-ajar"];

fn main() {
    divan::main();
}

fn bundled(name: &str) -> Scene {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes").join(name).join("scene.xml");
    mitsuba::load(&path, &mitsuba::Options::default()).expect("a bundled scene")
}

/// Rays through sixteen neighbouring pixels of the middle row.
fn camera(scene: &Scene) -> Rays {
    let (x, y) = (scene.sensor().width as f32 / 2.0, scene.sensor().height as f32 / 2.0);
    let columns = Lanes(std::array::from_fn(|lane| x - 8.0 + lane as f32));
    scene.sensor().rays([columns, Lanes::splat(y)], [Lanes::splat(0.5); 2])
}

/// Rays that leave what the camera sees in sixteen directions.
fn bounced(scene: &Scene) -> (Surfaces, Mask, Rays) {
    let mut surfaces = Surfaces::default();
    let met = scene.intersect_packet(&camera(scene), Mask::first(LANES), Purpose::Camera, &mut surfaces);
    let around = |lane: usize| (lane as f32 * 2.4).sin_cos();
    let wo = Lanes3 {
        x: Lanes(std::array::from_fn(|lane| 0.8 * around(lane).0)),
        y: Lanes(std::array::from_fn(|lane| 0.8 * around(lane).1)),
        z: Lanes::splat(0.6),
    };
    let direction = surfaces.frame.to_world(wo);
    let rays = Rays { origin: surfaces.leave(direction), direction, t_far: Lanes::splat(f32::INFINITY) };
    (surfaces, met, rays)
}

#[divan::bench(args = SCENES)]
fn camera_packet(bencher: Bencher, name: &str) {
    let scene = bundled(name);
    let (rays, mut surfaces) = (camera(&scene), Surfaces::default());
    bencher
        .counter(ItemsCount::new(LANES))
        .bench_local(|| scene.intersect_packet(&rays, Mask::first(LANES), Purpose::Camera, &mut surfaces));
}

#[divan::bench(args = SCENES)]
fn bounce_packet(bencher: Bencher, name: &str) {
    let scene = bundled(name);
    let (_, met, rays) = bounced(&scene);
    let mut surfaces = Surfaces::default();
    bencher
        .counter(ItemsCount::new(met.lanes().count()))
        .bench_local(|| scene.intersect_packet(&rays, met, Purpose::Path, &mut surfaces));
}

#[divan::bench(args = SCENES)]
fn visibility_packet(bencher: Bencher, name: &str) {
    let scene = bundled(name);
    let (from, met, rays) = bounced(&scene);
    let mut to = Surfaces::default();
    let both = scene.intersect_packet(&rays, met, Purpose::Path, &mut to);
    let mut shadows = ShadowRays::default();
    bencher.counter(ItemsCount::new(both.lanes().count())).bench_local(|| {
        shadows.clear();
        let request = shadows.between(&from, &to, both);
        shadows.trace(&scene, Purpose::Connection);
        shadows.unoccluded(&request)
    });
}

/// A sample of every pixel of a tile, with all differences and layers.
#[divan::bench(args = SCENES, consts = [0, 1])]
fn shifted_wave<const SHIFT: usize>(bencher: Bencher, name: &str) {
    let scene = bundled(name);
    let shift = Shift::named(SHIFTS[SHIFT].id).expect("a row of the table");
    let (x, y) = (scene.sensor().width / 2, scene.sensor().height / 2);
    let mut index = 0;
    bencher.counter(ItemsCount::new(TILE * TILE)).bench_local(|| {
        index += 1;
        sample(&scene, SampleId { seed: 0, x, y, index }, shift)
    });
}
