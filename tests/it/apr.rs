//! `apr` and the feature it generates, on frames whose truth is known.

use crate::common::frames::{COLOR, EDGE, HEIGHT, Truth, WIDTH, frame, image};
use fluxion::film::{BINS, Frame, Layer};
use fluxion::image::Image;
use fluxion::internals::math::{Rgb, vec3};
use fluxion::reconstruct::{Context, Solution, parse, solve};

fn run(method: &str, frame: &Frame) -> Solution {
    let context = Context::QUIET;
    solve(parse(method).unwrap().as_ref(), frame, &context).unwrap()
}

fn squares(image: &Image, truth: fn(usize, usize) -> Rgb) -> Image {
    let truth = self::image(truth);
    let data = image.data.iter().zip(&truth.data).map(|(a, b)| (a - b) * (a - b)).collect();
    Image { data, ..Image::new(WIDTH, HEIGHT, 3) }
}

fn mean(image: &Image) -> f64 {
    image.data.iter().map(|&value| f64::from(value)).sum::<f64>() / image.data.len() as f64
}

fn grey(_: usize, _: usize) -> Rgb {
    Rgb::splat(0.5)
}

/// A parabola, which rises from one to three.
fn bowl(x: usize, y: usize) -> Rgb {
    let (x, y) = (x as f32 / 40.0 - 1.0, y as f32 / 30.0 - 1.0);
    vec3(1.0, 0.8, 0.6) * (1.0 + x * x + y * y)
}

/// A step across the middle.
fn step(x: usize, _: usize) -> Rgb {
    if x < WIDTH / 2 { vec3(0.5, 1.0, 1.5) } else { vec3(1.5, 1.0, 0.5) }
}

/// A wave that no feature shows.
fn wave(x: usize, y: usize) -> Rgb {
    Rgb::splat(2.0 + (0.35 * x as f32).sin() * (0.25 * y as f32).cos())
}

const BOWL: Truth = Truth { color: bowl, albedo: grey };
const STEP: Truth = Truth { color: step, albedo: step };
const WAVE: Truth = Truth { color: wave, albedo: grey };

#[test]
fn orders_follow_what_there_is_to_be_fitted() {
    let frame = frame(1, &BOWL);
    let error = |order: &str| {
        let method = format!("apr:features=none,windows=44,order={order},outliers=off");
        mean(&squares(&run(&method, &frame).image, bowl))
    };
    let noise = f64::from(COLOR * COLOR);
    // Six of 1936 pixels' noise is the least that a parabola leaves; the mean of many windows has less.
    assert!(error("2") < 0.01 * noise, "{}", error("2") / noise);
    assert!(error("0") > 5.0 * error("2") && error("1") > 2.0 * error("2"));
    // Orders that compete do not do much worse than the right one.
    assert!(error("0-3") < 3.0 * error("2"), "{} {}", error("0-3") / noise, error("2") / noise);
}

#[test]
fn edges_that_a_feature_shows_are_kept_and_others_cost() {
    let frame = frame(2, &STEP);
    let error = |features: &str| mean(&squares(&run(&format!("apr:features={features}"), &frame).image, step));
    let noise = f64::from(COLOR * COLOR);
    assert!(error("albedo") < 0.03 * noise, "{}", error("albedo") / noise);
    assert!(error("none") > 3.0 * error("albedo"), "{}", error("none") / noise);
}

#[test]
fn the_generated_feature_shows_what_surfaces_do_not() {
    let frame = frame(3, &WAVE);
    let error = |features: &str| mean(&squares(&run(&format!("apr:features={features}"), &frame).image, wave));
    let (surfaces, generated) = (error("normal+albedo+depth"), error("generated"));
    let (both, all) = (error("normal+albedo+depth+generated"), error("normal+albedo+depth+occlusion+generated"));
    assert!(generated < 0.6 * surfaces && both < 0.6 * surfaces, "{surfaces} {generated} {both}");
    assert!((all / both - 1.0).abs() < 0.2, "a constant feature changes nothing: {all} {both}");
}

#[test]
fn more_samples_bring_the_image_to_the_truth() {
    // The step is in no feature: only the pixel itself can get it right.
    let error = |scale: f32| {
        let mut frame = frame(4, &Truth { color: step, albedo: grey });
        let truth = image(step);
        let mut color = frame.get(Layer::Color).unwrap().clone();
        color.data.iter_mut().zip(&truth.data).for_each(|(value, truth)| *value = truth + scale * (*value - truth));
        let variance = image(|_, _| Rgb::splat((scale * COLOR).powi(2)));
        frame.set(Layer::Color, color);
        frame.set(Layer::ColorVariance, variance);
        mean(&squares(&run("apr:features=none", &frame).image, step))
    };
    let errors = [1.0, 0.1, 0.01].map(error);
    assert!(errors[1] < 0.1 * errors[0] && errors[2] < 0.05 * errors[1], "{errors:?}");
}

#[test]
fn estimated_errors_are_of_the_size_of_the_true_ones() {
    for (truth, color) in [(&WAVE, wave as fn(usize, usize) -> Rgb), (&STEP, step), (&BOWL, bowl)] {
        // Without a generated feature the estimate is unbiased, but as noisy as the colour.
        for (method, most) in
            [("apr", 6.0), ("apr:features=normal+albedo+depth", 20.0), ("feature", 6.0), ("frgr", 6.0), ("rdfc", 6.0)]
        {
            let (mut estimated, mut found) = (0.0, 0.0);
            for seed in 0..4 {
                let solution = run(method, &frame(seed, truth));
                estimated += mean(solution.error.as_ref().unwrap());
                found += mean(&squares(&solution.image, color));
            }
            assert!(estimated < most * found && estimated > 0.2 * found, "{method}: {estimated} for {found}");
        }
    }
}

#[test]
fn with_the_same_variance_everywhere_the_feature_is_the_plain_poisson_solution() {
    let mut frame = frame(5, &WAVE);
    let equal = image(|_, _| Rgb::splat(EDGE * EDGE));
    for layer in [Layer::ColorVariance, Layer::DxVariance, Layer::DyVariance] {
        frame.set(layer, equal.clone());
    }
    let feature = run("feature:prefilter=off", &frame).image;
    let poisson = run("l2:alpha=1", &frame).image;
    // Averages of variances are lower near the border, beyond which there are no edges.
    let inside = |i: &usize| (8..WIDTH - 8).contains(&(i / 3 % WIDTH)) && (8..HEIGHT - 8).contains(&(i / 3 / WIDTH));
    let differences = (0..feature.data.len()).filter(inside).map(|i| (feature.data[i] - poisson.data[i]).abs());
    let worst = differences.fold(0.0, f32::max);
    assert!(worst < 2e-3, "{worst}");
}

#[test]
fn groups_that_agree_leave_no_variance() {
    let mut frame = frame(6, &WAVE);
    for (all, bin) in
        [(Layer::Color, Layer::BinColor as fn(u8) -> Layer), (Layer::Dx, Layer::BinDx), (Layer::Dy, Layer::BinDy)]
    {
        let image = frame.get(all).unwrap().clone();
        (0..BINS as u8).for_each(|k| frame.set(bin(k), image.clone()));
    }
    let error = run("feature", &frame).error.unwrap();
    assert!(mean(&error) < 1e-8, "{}", mean(&error));
}

#[test]
fn the_bagged_variance_is_of_the_size_of_the_variance_over_independent_frames() {
    let mut sums = vec![[0.0f64; 2]; 3 * WIDTH * HEIGHT];
    let (runs, mut claimed) = (40, 0.0);
    for seed in 0..runs {
        let solution = run("feature:prefilter=off,rounds=20", &frame(100 + seed, &WAVE));
        claimed += mean(&solution.error.unwrap()) / runs as f64;
        for (sum, &value) in sums.iter_mut().zip(&solution.image.data) {
            sum[0] += f64::from(value);
            sum[1] += f64::from(value) * f64::from(value);
        }
    }
    let n = runs as f64;
    let variance = |[sum, squares]: &[f64; 2]| (squares - sum * sum / n) / (n - 1.0);
    let found = sums.iter().map(variance).sum::<f64>() / sums.len() as f64;
    // Of the claim a share of 0.7 is left, since it is of the cleaned feature; and rounds are solved roughly.
    let ratio = claimed / 0.7 / found;
    assert!(ratio > 0.5 && ratio < 1.2, "{ratio}");
}

#[test]
fn variances_that_differ_by_twelve_powers_of_ten_are_solved_for() {
    let mut frame = frame(7, &WAVE);
    let wild = |x: usize, y: usize| Rgb::splat(10f32.powi((x * 7 + y * 13) as i32 % 13 - 10));
    for layer in [Layer::DxVariance, Layer::DyVariance] {
        frame.set(layer, image(wild));
    }
    for method in ["feature", "feature:screen=0", "feature:variances=draws", "apr"] {
        let error = mean(&squares(&run(method, &frame).image, wave));
        assert!(error < f64::from(COLOR * COLOR), "{method}: {error}");
    }
}

#[test]
fn light_that_reaches_everything_shows_what_no_path_has_lit() {
    // Nothing was found in the dark, where the albedo is a checkerboard.
    let mut frame = frame(8, &Truth { color: |_, _| Rgb::ZERO, albedo: step });
    let black = image(|_, _| Rgb::ZERO);
    let lit = image(step);
    let across = image(|x, y| if x + 1 < WIDTH { step(x + 1, y) - step(x, y) } else { Rgb::ZERO });
    for layer in [Layer::Color, Layer::ColorVariance, Layer::Dx, Layer::DxVariance, Layer::Dy, Layer::DyVariance] {
        frame.set(layer, black.clone());
    }
    for k in 0..BINS as u8 {
        for layer in [Layer::BinColor(k), Layer::BinDx(k), Layer::BinDy(k), Layer::BinAmbientDy(k)] {
            frame.set(layer, black.clone());
        }
        frame.set(Layer::BinAmbient(k), lit.clone());
        frame.set(Layer::BinAmbientDx(k), across.clone());
    }
    assert!(mean(&run("feature", &frame).image).abs() < 1e-6);
    let feature = run("feature:ambient=0.5", &frame).image;
    let expected = image(|x, y| 0.5 * step(x, y));
    let worst = feature.data.iter().zip(&expected.data).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
    assert!(worst < 0.02, "{worst}");
}
