//! Rays and what they cost: `cargo bench --bench counts -- SCENE.xml@WIDTHxHEIGHT ...`, as docs/design/performance.md explains.
//!
//! Per scene a line of JSON for path tracing, for differences in every sample, for differences where they pay, and for adaptive samples:
//! nanoseconds of one thread for a sample, those of them that Embree takes by itself for every purpose of rays, and rays and packets by
//! purpose and depth. The render is deterministic; times are medians of three.

mod common;

use std::path::Path;
use std::time::{Duration, Instant};

use fluxion::Result;
use fluxion::adaptive::{self, ALLOCATORS, AdaptiveSettings, Limits};
use fluxion::film::{EdgeNeed, Needs};
use fluxion::mitsuba::{self, Options};
use fluxion::reconstruct::{self, Context};
use fluxion::render::{Budget, Control, RenderSettings, render};
use fluxion::scene::{Purpose, Scene, Tally};
use serde_json::{Value, json};

use self::common::median;

const ROUNDS: usize = 3;
const SPP: u32 = 24;
const PURPOSES: [(Purpose, &str); 6] = [
    (Purpose::Camera, "camera"),
    (Purpose::Path, "path"),
    (Purpose::Light, "light"),
    (Purpose::OffsetCamera, "offset_camera"),
    (Purpose::Connection, "connection"),
    (Purpose::Extension, "extension"),
];

/// Ways to take samples.
#[derive(Clone, Copy)]
enum Mode {
    Paths,
    Differences,
    Thinned,
    Adaptive,
}

const MODES: [(Mode, &str); 4] = [
    (Mode::Paths, "paths"),
    (Mode::Differences, "differences"),
    (Mode::Thinned, "thinned"),
    (Mode::Adaptive, "adaptive"),
];

fn main() -> Result<()> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a thread");
    // Cargo passes --bench of its own.
    for scene in std::env::args().skip(1).filter(|argument| !argument.starts_with("--")) {
        for (mode, name) in MODES {
            println!("{}", pool.install(|| measure(&scene, mode, name))?);
        }
    }
    Ok(())
}

fn measure(argument: &str, mode: Mode, name: &str) -> Result<Value> {
    let (path, size) = argument.split_once('@').unwrap_or((argument, ""));
    let size = size.split_once('x').and_then(|(width, height)| Some((width.parse().ok()?, height.parse().ok()?)));
    let load = |log_rays| mitsuba::load(Path::new(path), &Options { size, log_rays, ..Options::default() });
    let (scene, logged) = (load(false)?, load(true)?);
    let samples = f64::from(SPP) * (scene.sensor().width * scene.sensor().height) as f64;
    run(&scene, mode)?;
    let mut times = Vec::new();
    for _ in 0..ROUNDS {
        times.push(run(&scene, mode)?.as_secs_f64());
    }
    run(&logged, mode)?;
    let embree = PURPOSES.map(|(purpose, name)| {
        let replay = || {
            let start = Instant::now();
            logged.replay_rays(Some(purpose));
            start.elapsed().as_secs_f64()
        };
        (name.to_owned(), json!(1e9 * median((0..ROUNDS).map(|_| replay()).collect()) / samples))
    });
    let tally = |Tally { purpose, depth, packets, rays }: Tally| {
        let name = PURPOSES.iter().find(|(known, _)| *known == purpose).map(|(_, name)| name);
        json!({ "purpose": name, "depth": depth, "packets": packets as f64 / samples, "rays": rays as f64 / samples })
    };
    Ok(json!({
        "scene": Path::new(path).parent().and_then(Path::file_name).map(|name| name.to_string_lossy()),
        "mode": name,
        "nanoseconds": 1e9 * median(times) / samples,
        "embree": serde_json::Map::from_iter(embree),
        "rays": logged.logged_rays().into_iter().map(tally).collect::<Vec<_>>(),
    }))
}

/// Takes the samples; returns the time of rendering alone.
fn run(scene: &Scene, mode: Mode) -> Result<Duration> {
    let method = reconstruct::parse("frgr")?;
    let edges = match mode {
        Mode::Paths => EdgeNeed::Off,
        Mode::Differences => EdgeNeed::Sampled,
        Mode::Thinned | Mode::Adaptive => EdgeNeed::Thinned,
    };
    let needs = Needs { edges, ..method.needs() };
    let settings = RenderSettings { seed: 1, ..RenderSettings::new(Budget::Spp(SPP), needs) };
    if !matches!(mode, Mode::Adaptive) {
        return Ok(render(scene, settings, &Control::QUIET).elapsed);
    }
    let settings = AdaptiveSettings {
        render: settings,
        method: method.as_ref(),
        allocator: ALLOCATORS[0],
        limits: Limits { spp: Some(SPP), ..Limits::default() },
        reconstruction: None,
    };
    Ok(adaptive::run(scene, &settings, &Control::QUIET, &Context::QUIET)?.render.elapsed)
}
