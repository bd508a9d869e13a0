//! FRGR on frames whose truth is known.

use fluxion::film::{Frame, Layer};
use fluxion::image::Image;
use fluxion::internals::math::{Rgb, rng, vec3};
use fluxion::metrics;
use fluxion::reconstruct::{Context, Solution, parse, solve};

const WIDTH: usize = 96;
const HEIGHT: usize = 72;

/// A checkered floor under soft light, a box with an edge of its own, and a shadow that no feature shows.
fn truth(x: usize, y: usize) -> Rgb {
    albedo(x, y) * (0.4 + 0.01 * x as f32 + 0.3 * (y as f32 * 0.07).sin()) * if shadow(x, y) { 0.3 } else { 1.0 }
}

fn shadow(x: usize, y: usize) -> bool {
    x > 60 && y > 30 && x + y < 130
}

fn albedo(x: usize, y: usize) -> Rgb {
    match (x / 16 + y / 16) % 2 {
        _ if boxed(x, y) => vec3(0.7, 0.2, 0.2),
        0 => vec3(0.8, 0.8, 0.7),
        _ => vec3(0.2, 0.3, 0.5),
    }
}

fn boxed(x: usize, y: usize) -> bool {
    (10..34).contains(&x) && (20..50).contains(&y)
}

/// A normal variate from hashes (Box and Muller 1958).
fn normal(seed: u64, i: usize) -> f32 {
    let u = |k: u64| rng::unit(rng::combine(rng::combine(seed, k), i as u64));
    (-2.0 * u(1).max(1e-7).ln()).sqrt() * (std::f32::consts::TAU * u(2)).cos()
}

fn image(pixel: impl Fn(usize, usize) -> Rgb) -> Image {
    Image::from_rgb(WIDTH, HEIGHT, pixel)
}

/// A frame of `spp` samples with independent normal noise: colours of relative deviation `noise` for one sample,
/// differences of a third of it.
fn frame(seed: u64, spp: f32, noise: f32) -> Frame {
    let mut frame = Frame::new(WIDTH, HEIGHT);
    let deviation = |x: usize, y: usize| noise * truth(x, y) / spp.sqrt();
    let random = |layer: u64, x: usize, y: usize| {
        let i = 3 * (y * WIDTH + x);
        let value = |c| normal(rng::combine(seed, layer), i + c);
        vec3(value(0), value(1), value(2))
    };
    frame.set(Layer::Color, image(|x, y| truth(x, y) + deviation(x, y) * random(1, x, y)));
    frame.set(Layer::ColorVariance, image(|x, y| deviation(x, y) * deviation(x, y)));
    for (mean, variance, step) in [(Layer::Dx, Layer::DxVariance, (1, 0)), (Layer::Dy, Layer::DyVariance, (0, 1))] {
        let inside = |x: usize, y: usize| x + step.0 < WIDTH && y + step.1 < HEIGHT;
        let difference = |x: usize, y: usize| {
            if !inside(x, y) {
                return Rgb::ZERO;
            }
            let exact = truth(x + step.0, y + step.1) - truth(x, y);
            exact + deviation(x, y) / 3.0 * random(2 + step.0 as u64, x, y)
        };
        frame.set(mean, image(difference));
        let square = |x: usize, y: usize| (deviation(x, y) / 3.0) * (deviation(x, y) / 3.0);
        frame.set(variance, image(|x, y| if inside(x, y) { square(x, y) } else { Rgb::ZERO }));
    }
    frame.set(Layer::Albedo, image(albedo));
    frame.set(Layer::Normal, image(|x, y| if boxed(x, y) { vec3(0.0, 0.0, 1.0) } else { vec3(0.0, 1.0, 0.0) }));
    for layer in [Layer::AlbedoVariance, Layer::NormalVariance] {
        frame.set(layer, image(|_, _| Rgb::ZERO));
    }
    frame.set(Layer::Samples, Image { data: vec![spp; WIDTH * HEIGHT], ..Image::new(WIDTH, HEIGHT, 1) });
    frame
}

fn run(method: &str, frame: &Frame) -> Solution {
    let context = Context::QUIET;
    solve(parse(method).unwrap().as_ref(), frame, &context).unwrap()
}

fn error(method: &str, frame: &Frame) -> f64 {
    let metric = metrics::METRICS.iter().find(|metric| metric.id == "relmse").unwrap();
    metric.measure(&run(method, frame).image, &image(truth)).unwrap().mean
}

#[test]
fn every_form_and_switch_is_far_below_the_samples() {
    let frame = frame(1, 16.0, 2.0);
    let primal = error("primal", &frame);
    let methods = [
        "frgr",
        "frgr:form=paper",
        "frgr:form=code",
        "frgr:levels=1",
        "frgr:levels=4",
        "frgr:solver=exact",
        "frgr:resample=bilinear",
        "frgr:albedo=off,normal=off",
        "frgr:denoised=off",
        "frgr:enhance=off",
        "frgr:filter=off",
        "frgr:radius=7",
    ];
    for method in methods {
        let ours = error(method, &frame);
        assert!(ours < 0.2 * primal, "{method}: {ours} of {primal}");
    }
    assert!(error("frgr", &frame) < error("l2", &frame));
}

#[test]
fn without_the_filter_the_enhanced_image_is_the_result() {
    let frame = frame(1, 16.0, 2.0);
    let filtered = solve(parse("frgr").unwrap().as_ref(), &frame, &Context { notes: true, ..Context::QUIET }).unwrap();
    assert_eq!(&run("frgr:filter=off", &frame).image, filtered.note("level0_enhanced").unwrap());
    assert_eq!(run("frgr:filter=off,levels=3", &frame).image, run("frgr:filter=off", &frame).image);
}

#[test]
fn the_error_falls_as_samples_are_added() {
    let errors: Vec<f64> = [16.0, 128.0, 1024.0].iter().map(|&spp| error("frgr", &frame(2, spp, 2.0))).collect();
    for pair in errors.windows(2) {
        let slope = (pair[1] / pair[0]).log2() / 3.0;
        assert!(slope < -0.8, "slope {slope} of {errors:?}");
    }
}

#[test]
fn shadows_that_no_feature_shows_are_kept() {
    let frame = frame(3, 64.0, 1.0);
    let solved = run("frgr", &frame).image;
    // Between the 61st and the 60th column the shadow begins.
    let step = |picture: &dyn Fn(usize, usize) -> Rgb| -> f32 {
        (40..60).map(|y| (picture(60, y) - picture(61, y)).x).sum::<f32>() / 20.0
    };
    let (ours, exact) = (step(&|x, y| solved.rgb(x, y)), step(&truth));
    assert!((ours / exact - 1.0).abs() < 0.1, "{ours} instead of {exact}");
}

#[test]
fn the_estimated_error_is_near_the_true_one() {
    for (spp, noise) in [(16.0, 2.0), (64.0, 2.0), (256.0, 2.0)] {
        let solution = run("frgr", &frame(4, spp, noise));
        let estimate = solution.error.unwrap();
        let mean =
            |values: &mut dyn Iterator<Item = f32>| values.map(f64::from).sum::<f64>() / (WIDTH * HEIGHT * 3) as f64;
        let exact = image(truth);
        let squares = solution.image.data.iter().zip(&exact.data).map(|(a, b)| (a - b) * (a - b));
        let (true_error, expected) = (mean(&mut squares.into_iter()), mean(&mut estimate.data.iter().copied()));
        assert!((0.5..2.0).contains(&(expected / true_error)), "{spp} spp: {expected} for {true_error}");
    }
}

#[test]
fn layers_that_are_missing_are_done_without() {
    let full = frame(5, 16.0, 2.0);
    let mut bare = Frame::new(WIDTH, HEIGHT);
    let needed = [
        Layer::Color,
        Layer::ColorVariance,
        Layer::Dx,
        Layer::DxVariance,
        Layer::Dy,
        Layer::DyVariance,
        Layer::Samples,
    ];
    for layer in needed {
        bare.set(layer, full.get(layer).unwrap().clone());
    }
    assert_eq!(run("frgr", &bare).image, run("frgr:albedo=off,normal=off", &full).image);
}

#[test]
fn one_level_is_the_same_whatever_the_resampling() {
    let frame = frame(6, 16.0, 2.0);
    assert_eq!(run("frgr:levels=1", &frame).image, run("frgr:levels=1,resample=bilinear", &frame).image);
}

#[test]
fn light_that_few_samples_find_is_not_lost() {
    // A third of the pixels are hit by one sample in fifty, which then brings fifty; most of them see nothing, and
    // have no variance.
    let spp = 16u64;
    let hits = |x: usize, y: usize| -> Vec<f32> {
        let hit = |s: u64| x < WIDTH / 3 && rng::unit(rng::combine(s + 77, (y * WIDTH + x) as u64)) < 0.02;
        (0..spp).map(|s| if hit(s) { 50.0 } else { 0.0 }).collect()
    };
    let mean = |x: usize, y: usize| hits(x, y).iter().sum::<f32>() / spp as f32;
    let variance = |x: usize, y: usize| {
        let mean = mean(x, y);
        hits(x, y).iter().map(|hit| (hit - mean) * (hit - mean)).sum::<f32>() / (spp * (spp - 1)) as f32
    };
    let mut frame = frame(7, 16.0, 0.0);
    let color = |x: usize, y: usize| if x < WIDTH / 3 { Rgb::splat(mean(x, y)) } else { Rgb::ONE };
    frame.set(Layer::Color, image(color));
    frame.set(Layer::ColorVariance, image(|x, y| Rgb::splat(variance(x, y))));
    frame.set(Layer::Albedo, image(|_, _| Rgb::ONE));
    frame.set(Layer::Normal, image(|_, _| Rgb::ONE));
    for layer in [Layer::Dx, Layer::Dy] {
        frame.set(layer, image(|_, _| Rgb::ZERO));
    }
    let solved = run("frgr", &frame).image;
    let total = |image: &Image| image.data.iter().map(|&value| f64::from(value)).sum::<f64>();
    let ratio = total(&solved) / total(&image(color));
    assert!((ratio - 1.0).abs() < 0.05, "{ratio} of the light is left");
}
