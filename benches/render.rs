//! What rendering costs: `cargo bench --bench render -- SCENE.xml ...`, as docs/design/performance.md explains.
//!
//! Per scene, medians of five rounds in which everything that is compared takes its turn: samples a second of paths, the
//! cost of a sample with gradients in path samples, the share of the time that the same rays take in Embree alone, what a
//! second thread gives, how far time is from linear in samples and in pixels (1 is linear), and what leaving out saves. Needs two cores
//! and nothing else running.

mod common;

use std::path::Path;
use std::sync::atomic::AtomicBool;
use std::time::{Duration, Instant};

use fluxion::film::Needs;
use fluxion::internals::plan::Plan;
use fluxion::mitsuba;
use fluxion::render::{Budget, Control, RenderSettings, render};
use fluxion::scene::Scene;

use self::common::median;

const ROUNDS: usize = 5;
const SPP: u32 = 4;
/// Scenes that are wide are rendered so, others square.
const SIZES: [(usize, usize); 2] = [(640, 360), (512, 512)];

fn main() {
    // Cargo passes --bench of its own.
    let scenes: Vec<String> = std::env::args().skip(1).filter(|argument| !argument.starts_with("--")).collect();
    println!(
        "| scene | M samples/s | M rays/s | Embree's share | gradient sample | two threads | twice the samples | \
         four times the pixels | plan all: time | memory |"
    );
    println!("|---|---|---|---|---|---|---|---|---|---|");
    let pools = [1, 2].map(|threads| rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads"));
    let mut products = Figures::default();
    for path in &scenes {
        let figures = measure(Path::new(path), &pools);
        let name =
            Path::new(path).parent().and_then(Path::file_name).unwrap_or_default().to_string_lossy().into_owned();
        figures.print(&name);
        products.multiply(&figures);
    }
    products.root(scenes.len()).print("geometric mean");
}

/// Figures of a scene.
struct Figures([f64; 9]);

impl Default for Figures {
    fn default() -> Self {
        Self([1.0; 9])
    }
}

impl Figures {
    fn print(&self, name: &str) {
        let [samples, rays, share, gradient, threads, spp, pixels, time, memory] = self.0;
        println!(
            "| {name} | {samples:.3} | {rays:.2} | {:.0} % | {gradient:.2} | {threads:.2} | {spp:.3} | {pixels:.3} | \
             {time:.2} | {memory:.1} |",
            100.0 * share
        );
    }

    fn multiply(&mut self, other: &Self) {
        self.0.iter_mut().zip(other.0).for_each(|(product, figure)| *product *= figure);
    }

    fn root(&self, n: usize) -> Self {
        Self(self.0.map(|product| product.powf(1.0 / n as f64)))
    }
}

fn measure(path: &Path, pools: &[rayon::ThreadPool; 2]) -> Figures {
    let own = load_at(path, None);
    let wide = own.sensor().width > own.sensor().height;
    let size = SIZES[usize::from(!wide)];
    let scene = load_at(path, Some(size));
    let half = load_at(path, Some((size.0 / 2, size.1 / 2)));
    let general = load_with(path, mitsuba::Options { size: Some(size), fast_paths: false, ..Default::default() });
    let logged_size = Some((size.0 / 2, size.1 / 2));
    let logged = load_with(path, mitsuba::Options { size: logged_size, log_rays: true, ..Default::default() });
    let paths = Needs::default();
    let gradients = Needs::EDGES;
    let planned = Plan::new(&scene, gradients, paths).needs;
    let on = |pool: usize, scene: &Scene, spp: u32, needs: Needs| pools[pool].install(|| seconds(scene, spp, needs));

    // The rays are those of a smaller film: a log of all would not fit.
    let unlogged = median((0..ROUNDS).map(|_| on(0, &half, 4, paths)).collect());
    on(0, &logged, 4, paths);
    let mut rays = 0;
    let replays = (0..ROUNDS).map(|_| {
        let start = Instant::now();
        (rays, _) = logged.replay_rays(None);
        start.elapsed().as_secs_f64()
    });
    let replayed = median(replays.collect());

    let mut runs: [Vec<f64>; 7] = Default::default();
    for _ in 0..ROUNDS {
        let [path, gradient, single, spp, quarter, needed, all] = &mut runs;
        path.push(on(1, &scene, SPP, paths));
        gradient.push(on(1, &scene, SPP, gradients));
        single.push(on(0, &scene, SPP, paths));
        spp.push(on(1, &scene, 2 * SPP, paths));
        quarter.push(on(1, &half, SPP, paths));
        needed.push(on(1, &scene, SPP, planned));
        all.push(on(1, &general, SPP, Plan::all(&general).needs));
    }
    let [path, gradient, single, spp, quarter, needed, all] = runs.map(median);
    let samples = (size.0 * size.1) as f64 * f64::from(SPP);
    Figures([
        samples / path / 1e6,
        rays as f64 / replayed / 1e6,
        replayed / unlogged,
        gradient / path,
        single / path,
        spp / path / 2.0,
        path / quarter / 4.0,
        all / needed,
        bytes(Needs::ALL) / bytes(planned),
    ])
}

fn load_at(path: &Path, size: Option<(usize, usize)>) -> Scene {
    load_with(path, mitsuba::Options { size, ..Default::default() })
}

fn load_with(path: &Path, options: mitsuba::Options) -> Scene {
    mitsuba::load(path, &options).expect("a scene")
}

fn seconds(scene: &Scene, spp: u32, needs: Needs) -> f64 {
    let settings = RenderSettings { seed: 1, ..RenderSettings::new(Budget::Spp(spp), needs) };
    let control = Control { stop: &AtomicBool::new(false), ..Control::QUIET };
    let elapsed: Duration = render(scene, settings, &control).elapsed;
    elapsed.as_secs_f64()
}

fn bytes(needs: Needs) -> f64 {
    needs.bytes_per_pixel() as f64
}
