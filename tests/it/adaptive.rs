//! Adaptive sampling: budgets are met to the sample, unequal counts leave every layer unbiased, needs are followed.

use std::sync::atomic::{AtomicBool, Ordering};

use crate::common::{bundled, check_zero, film};
use fluxion::adaptive::{self, ALLOCATORS, AdaptiveSettings, Allocator, Limits};
use fluxion::error::Result;
use fluxion::film::{Frame, Layer, Needs, Recorded};
use fluxion::internals::math::rng;
use fluxion::internals::plan::Plan;
use fluxion::reconstruct::{self, Context, METHODS, Solution};
use fluxion::render::{self, Budget, Control};
use fluxion::scene::Scene;

fn samples(needs: Needs, seed: u64) -> render::RenderSettings {
    render::RenderSettings { seed, ..render::RenderSettings::new(Budget::Spp(1), needs) }
}

fn run(scene: &Scene, method: &str, allocator: &dyn Allocator, limits: Limits) -> Result<adaptive::AdaptiveOutcome> {
    let method = reconstruct::parse(method)?;
    let needs = Plan::new(scene, method.needs(), Needs::default()).needs;
    let settings = AdaptiveSettings {
        render: samples(needs, 3),
        method: method.as_ref(),
        allocator,
        limits,
        reconstruction: None,
    };
    adaptive::run(scene, &settings, &Control::QUIET, &Context::QUIET)
}

fn spp(spp: u32) -> Limits {
    Limits { spp: Some(spp), ..Limits::default() }
}

#[test]
fn budgets_are_met_to_the_sample_by_every_method_and_allocator() {
    let scene = bundled("cornell-box", (33, 21));
    for method in METHODS.iter().filter(|method| method.id != "oidn") {
        let estimates = reconstruct::parse(method.id).unwrap().estimates_error();
        for &allocator in ALLOCATORS {
            let outcome = run(&scene, method.id, allocator, spp(20));
            if allocator.needs_error() && !estimates {
                assert!(outcome.err().unwrap().to_string().contains("--adaptive variance"), "{}", method.id);
                continue;
            }
            let outcome = outcome.unwrap();
            assert_eq!(outcome.render.film.samples(), 20 * 33 * 21, "{} {}", method.id, allocator.id());
            assert_eq!(outcome.solution.error.is_some(), estimates, "{}", method.id);
            let even = outcome.render.film.counts().iter().all(|&count| count == 20);
            assert_eq!(even, allocator.id() == "uniform", "{} {}", method.id, allocator.id());
            // Nobody is left with the first pass's samples.
            assert!(outcome.render.film.counts().iter().all(|&count| count > 8));
        }
    }
}

#[test]
fn a_guide_decides_and_the_image_is_the_methods() {
    let scene = bundled("cornell-box", (32, 24));
    let net = reconstruct::parse("net").unwrap();
    let outcome = run(&scene, "net", ALLOCATORS[0], spp(24)).unwrap();
    let whole = |method| reconstruct::solve(method, &outcome.frame, &Context::QUIET).unwrap();
    let (own, guide) = (whole(net.as_ref()), whole(net.guide().unwrap()));
    assert_eq!(outcome.solution.image, own.image);
    assert_ne!(own.image, guide.image);
    // The error of the safe image is the guide's to the bit, that of the filtered one much the same.
    assert_eq!(whole(reconstruct::parse("net:image=safe").unwrap().as_ref()).error, guide.error);
    let claimed = |solution: &Solution| solution.error.as_ref().unwrap().data.iter().sum::<f32>();
    let ratio = claimed(&own) / claimed(&guide);
    assert!((0.25..4.0).contains(&ratio), "{ratio}");
    // The guide's needs are the method's.
    assert_eq!(net.needs().union(net.guide().unwrap().needs()), net.needs());
    let guided = run(&scene, "frgr", ALLOCATORS[0], spp(24)).unwrap();
    assert_eq!(outcome.render.film.counts(), guided.render.film.counts());
}

#[test]
fn small_budgets_are_shared_evenly() {
    let scene = bundled("unit/diffuse", (9, 7));
    for n in [1, 2, 8] {
        let counts = run(&scene, "frgr", ALLOCATORS[0], spp(n)).unwrap().render.film.counts();
        assert!(counts.iter().all(|&count| count == n), "{n} {counts:?}");
    }
}

#[test]
fn samples_go_where_errors_are() {
    // Shadows and reflections of a lamp's edge are harder than a wall.
    let scene = bundled("cornell-box", (48, 48));
    for allocator in &ALLOCATORS[..2] {
        let outcome = run(&scene, "frgr", *allocator, spp(32)).unwrap();
        let uniform = film(&scene, 512, 9, Needs::default()).develop();
        let (color, variance) = (uniform.get(Layer::Color).unwrap(), uniform.get(Layer::ColorVariance).unwrap());
        let hardness = |i: usize| variance.data[3 * i + 1] / (color.data[3 * i + 1].powi(2) + 0.01);
        let mut order: Vec<usize> = (0..48 * 48).collect();
        order.sort_by(|&a, &b| hardness(a).total_cmp(&hardness(b)));
        let counts = outcome.render.film.counts();
        let mean = |part: &[usize]| part.iter().map(|&i| f64::from(counts[i])).sum::<f64>() / part.len() as f64;
        let (easy, hard) = (mean(&order[..48 * 12]), mean(&order[48 * 36..]));
        assert!(hard > 1.2 * easy, "{}: {easy} {hard}", allocator.id());
    }
}

#[test]
fn the_same_seed_gives_the_same_bits() {
    let scene = bundled("glossy-metal", (24, 20));
    let image = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| run(&scene, "apr", ALLOCATORS[0], spp(24)).unwrap().solution.image)
    };
    assert!(image(1) == image(2));
}

#[test]
fn an_error_stops_the_render_or_the_limit_does() {
    let scene = bundled("unit/diffuse", (40, 30));
    let limits = |error, spp| Limits { error: Some(error), spp: Some(spp), time: None };
    let outcome = run(&scene, "frgr", ALLOCATORS[2], limits(1e-2, 4096)).unwrap();
    let passes: Vec<_> = outcome.passes.iter().map(|pass| pass.error.unwrap()).collect();
    assert!(passes.len() > 1 && *passes.last().unwrap() <= 1e-2, "{passes:?}");
    assert!(outcome.render.spp < 4096);
    let outcome = run(&scene, "frgr", ALLOCATORS[2], limits(1e-12, 40)).unwrap();
    assert_eq!(outcome.render.film.samples(), 40 * 1200);
    let unknown = run(&scene, "l1", ALLOCATORS[2], limits(1e-2, 40)).err().unwrap();
    assert!(unknown.to_string().contains("estimate its error"), "{unknown}");
}

#[test]
fn a_stop_leaves_an_image_of_what_there_is() {
    let scene = bundled("cornell-box", (40, 30));
    let method = reconstruct::parse("frgr").unwrap();
    let settings = AdaptiveSettings {
        render: samples(method.needs(), 3),
        method: method.as_ref(),
        allocator: ALLOCATORS[0],
        limits: spp(1 << 20),
        reconstruction: None,
    };
    let stop = AtomicBool::new(false);
    let progress = |_| stop.store(true, Ordering::Relaxed);
    let outcome = adaptive::run(
        &scene,
        &settings,
        &Control { stop: &stop, progress: &progress, ..Control::QUIET },
        &Context::QUIET,
    )
    .unwrap();
    assert!(outcome.render.stopped && outcome.render.film.samples() < 40 * 30 * 64);
    assert!(outcome.solution.image.data.iter().all(|value| value.is_finite()));
}

/// Independent pairs of renders.
const RUNS: u64 = 16;

/// A map in which neighbours have between 4 and 60 samples.
fn skewed(x: usize, y: usize) -> u32 {
    let random = rng::unit(rng::combine(x as u64, 7 * y as u64 + 1));
    4 + (random * random * 56.0) as u32
}

fn unequal(scene: &Scene, seed: u64, needs: Needs) -> Frame {
    let mut outcome = render::RenderOutcome::new(scene, needs);
    let width = outcome.film.width;
    let counts: Vec<u32> = (0..width * outcome.film.height).map(|i| skewed(i % width, i / width)).collect();
    let control = Control::QUIET;
    // In two parts, which do not end at a whole number of bins.
    let first: Vec<u32> = counts.iter().map(|&n| n / 3).collect();
    render::render_to_counts(scene, samples(needs, seed), &control, &mut outcome, &first);
    render::render_to_counts(scene, samples(needs, seed), &control, &mut outcome, &counts);
    assert_eq!(outcome.film.counts(), counts);
    outcome.film.develop()
}

/// A layer minus the differences along `step` of a layer of another frame; with no step, minus the layer.
fn apart(frame: &Frame, layer: Layer, colors: &Frame, of: Layer, step: (usize, usize)) -> Vec<f64> {
    let (values, colors) = (frame.get(layer).unwrap(), colors.get(of).unwrap());
    let mut apart = Vec::new();
    for (x, y) in (0..values.height - step.1).flat_map(|y| (0..values.width - step.0).map(move |x| (x, y))) {
        let expected = match step {
            (0, 0) => colors.rgb(x, y),
            _ => colors.rgb(x + step.0, y + step.1) - colors.rgb(x, y),
        };
        apart.extend((values.rgb(x, y) - expected).to_array().map(f64::from));
    }
    apart
}

#[test]
fn colours_and_differences_are_unbiased_whatever_the_counts() {
    for name in ["unit/occluder", "unit/rough-conductor"] {
        let scene = bundled(name, (24, 18));
        let edges = Needs::EDGES;
        let pairs: Vec<[Frame; 2]> = (0..RUNS)
            .map(|run| {
                let even = film(&scene, 64, 2 * run + 1, Needs::default()).develop();
                [unequal(&scene, 2 * run, edges), even]
            })
            .collect();
        for (layer, step) in [(Layer::Dx, (1, 0)), (Layer::Dy, (0, 1))] {
            let runs: Vec<_> = pairs.iter().map(|[a, b]| apart(a, layer, b, Layer::Color, step)).collect();
            check_zero(&format!("{name} {layer:?}"), &runs);
        }
        // Means of few samples of a colour are skewed, and so are their t: sums over pixels of like counts are not.
        for range in [0..8, 8..20, 20..64] {
            let chosen = |i: usize| range.contains(&skewed(i / 3 % 24, i / 3 / 24));
            let sums = pairs.iter().map(|[a, b]| {
                let apart = apart(a, Layer::Color, b, Layer::Color, (0, 0));
                apart.iter().enumerate().filter(|(i, _)| chosen(*i)).map(|(_, value)| value).sum::<f64>()
            });
            let sums: Vec<f64> = sums.collect();
            let mean = sums.iter().sum::<f64>() / RUNS as f64;
            let variance = sums.iter().map(|sum| (sum - mean).powi(2)).sum::<f64>() / (RUNS - 1) as f64 / RUNS as f64;
            assert!(variance > 0.0 && mean.abs() < 4.5 * variance.sqrt(), "{name}, {range:?}: {mean} {variance}");
        }
    }
}

#[test]
fn differences_of_the_ambient_light_are_those_of_its_colour() {
    let needs = Needs::EDGES.with(Recorded::Ambient);
    for name in ["unit/diffuse", "unit/rough-conductor", "unit/dielectric", "unit/rough-plastic"] {
        let scene = bundled(name, (24, 18));
        let pairs: Vec<[Frame; 2]> =
            (0..RUNS).map(|run| [0, 1].map(|k| film(&scene, 64, 2 * run + k, needs).develop())).collect();
        for (layer, step) in [(Layer::BinAmbientDx(3), (1, 0)), (Layer::BinAmbientDy(3), (0, 1))] {
            let runs: Vec<_> = pairs.iter().map(|[a, b]| apart(a, layer, b, Layer::BinAmbient(3), step)).collect();
            check_zero(&format!("{name} {layer:?}"), &runs);
        }
    }
}
