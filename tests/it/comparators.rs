//! The classical methods on frames whose truth is known: each does what its literature says.

use crate::common::frames::{COLOR, HEIGHT, Truth, WIDTH, image};
use fluxion::film::{Frame, Layer};
use fluxion::image::Image;
use fluxion::internals::math::{Rgb, rng, vec3};
use fluxion::metrics;
use fluxion::reconstruct::{Context, parse, solve};

fn truth(x: usize, y: usize) -> Rgb {
    albedo(x, y) * (1.0 + 0.01 * x as f32 - 0.005 * y as f32)
}

fn albedo(x: usize, y: usize) -> Rgb {
    if (x / 20 + y / 20).is_multiple_of(2) { vec3(0.8, 0.6, 0.4) } else { vec3(0.2, 0.3, 0.5) }
}

fn frame(seed: u64) -> Frame {
    crate::common::frames::frame(seed, &Truth { color: truth, albedo })
}

fn run(method: &str, frame: &Frame) -> Image {
    let context = Context::QUIET;
    solve(parse(method).unwrap().as_ref(), frame, &context).unwrap().image
}

fn mse(image: &Image) -> f64 {
    metrics::find("mse").unwrap().measure(image, &self::image(truth)).unwrap().mean
}

/// Replaces every fiftieth difference by one that is far off.
fn spoil(frame: &mut Frame) {
    for layer in [Layer::Dx, Layer::Dy] {
        let mut edges = frame.get(layer).unwrap().clone();
        for y in 0..HEIGHT - 1 {
            for x in (0..WIDTH - 1).filter(|x| rng::mix((y * WIDTH + x) as u64 + 7).is_multiple_of(50)) {
                edges.pixel_mut(x, y).iter_mut().for_each(|value| *value += 3.0);
            }
        }
        frame.set(layer, edges);
    }
}

#[test]
fn gradients_bring_most_of_the_noise_down() {
    let frame = frame(1);
    let noise = f64::from(COLOR * COLOR);
    for (method, bound) in [
        ("l2", 0.15),
        ("l1", 0.15),
        ("control_variate", 0.15),
        ("control_variate:weights=uniform", 0.15),
        ("control_variate:cross=on", 0.15),
        ("least_trimmed", 0.15),
        ("least_trimmed:norm=l2", 0.15),
        ("nlm", 0.1),
        ("rdfc", 0.1),
        ("nfor", 0.08),
        ("frgr", 0.03),
        ("feature", 0.03),
        ("feature:variances=draws,screen=0,prefilter=nlm", 0.15),
        ("apr", 0.03),
        ("apr:features=generated", 0.05),
        ("apr:features=normal+albedo+depth", 0.05),
        ("apr:features=none", 0.5),
    ] {
        let error = mse(&run(method, &frame));
        assert!(error < bound * noise, "{method}: {:.3} of the noise", error / noise);
    }
}

#[test]
fn outliers_among_the_differences_hurt_l2_and_not_the_robust_methods() {
    let mut frame = frame(2);
    let clean = mse(&run("l2", &frame));
    spoil(&mut frame);
    let l2 = mse(&run("l2", &frame));
    assert!(l2 > 10.0 * clean);
    for (method, share) in
        [("l1", 0.5), ("l1:iterations=20,decay=0.5", 0.15), ("least_trimmed:norm=l2", 0.01), ("least_trimmed", 0.01)]
    {
        let error = mse(&run(method, &frame));
        assert!(error < share * l2, "{method}: {error} with l2 at {l2}");
    }
}

#[test]
fn l1_comes_nearer_to_its_own_minimum_with_every_iteration() {
    let mut frame = frame(3);
    spoil(&mut frame);
    let [color, dx, dy] = [Layer::Color, Layer::Dx, Layer::Dy].map(|layer| frame.get(layer).unwrap().clone());
    let objective = |u: &Image| {
        let mut sum = 0.0;
        for (x, y) in (0..HEIGHT).flat_map(|y| (0..WIDTH).map(move |x| (x, y))) {
            sum += 0.2 * (u.rgb(x, y) - color.rgb(x, y)).length();
            if x + 1 < WIDTH {
                sum += (u.rgb(x + 1, y) - u.rgb(x, y) - dx.rgb(x, y)).length();
            }
            if y + 1 < HEIGHT {
                sum += (u.rgb(x, y + 1) - u.rgb(x, y) - dy.rgb(x, y)).length();
            }
        }
        f64::from(sum)
    };
    let at = |n: u32| objective(&run(&format!("l1:decay=0.6,iterations={n}"), &frame));
    let path = [1, 2, 4, 8, 16].map(at);
    assert!(path.windows(2).all(|pair| pair[1] < pair[0] * 1.0005), "{path:?}");
    assert!(path[4] < 0.9 * path[0], "{path:?}");
}

#[test]
fn one_uniform_step_is_the_mean_of_five() {
    let frame = frame(4);
    let result = run("control_variate:weights=uniform,iterations=1", &frame);
    let rgb = |layer, x, y| frame.get(layer).unwrap().rgb(x, y);
    for (x, y) in [(5, 7), (40, 30), (78, 58)] {
        let color = |x, y| rgb(Layer::Color, x, y);
        let left = color(x - 1, y) + rgb(Layer::Dx, x - 1, y);
        let up = color(x, y - 1) + rgb(Layer::Dy, x, y - 1);
        let right = color(x + 1, y) - rgb(Layer::Dx, x, y);
        let down = color(x, y + 1) - rgb(Layer::Dy, x, y);
        let expected = (color(x, y) + left + right + up + down) / 5.0;
        assert!((result.rgb(x, y) - expected).abs().max_element() < 1e-5);
    }
    // A corner has two neighbours.
    let expected = rgb(Layer::Color, 0, 0) + rgb(Layer::Color, 1, 0) - rgb(Layer::Dx, 0, 0) + rgb(Layer::Color, 0, 1)
        - rgb(Layer::Dy, 0, 0);
    assert!((result.rgb(0, 0) - expected / 3.0).abs().max_element() < 1e-5);
}

#[test]
fn uniform_and_cross_weights_are_unbiased() {
    // Means over independent frames, in standard errors of the mean.
    for method in ["l2", "control_variate:weights=uniform", "control_variate:cross=on"] {
        let runs = 24;
        let exact = image(truth);
        let (mut sum, mut squares) = (vec![0.0; exact.data.len()], vec![0.0; exact.data.len()]);
        for seed in 0..runs {
            for (i, value) in run(method, &frame(100 + seed)).data.iter().enumerate() {
                let error = f64::from(value - exact.data[i]);
                sum[i] += error;
                squares[i] += error * error;
            }
        }
        let n = runs as f64;
        let z = sum.iter().zip(&squares).map(|(sum, squares)| {
            let mean = sum / n;
            mean / ((squares / n - mean * mean) / (n - 1.0)).sqrt()
        });
        let mean_square = z.map(|z| z * z).sum::<f64>() / exact.data.len() as f64;
        // Student's t of 23 degrees of freedom has variance 1.095; neighbours are correlated.
        assert!((0.8..1.4).contains(&mean_square), "{method}: {mean_square}");
    }
}

#[test]
fn nfor_knows_its_error() {
    let frame = frame(5);
    let context = Context::QUIET;
    let solution = solve(parse("nfor").unwrap().as_ref(), &frame, &context).unwrap();
    let estimated = solution.error.unwrap().data.iter().map(|&error| f64::from(error)).sum::<f64>();
    let share = estimated / (3 * WIDTH * HEIGHT) as f64 / mse(&solution.image);
    assert!((0.2..10.0).contains(&share), "{share} of the true error");
}

#[test]
fn halves_are_means_of_every_other_bin() {
    let mut frame = frame(6);
    let few = Image { data: vec![5.0; WIDTH * HEIGHT], ..Image::new(WIDTH, HEIGHT, 1) };
    frame.set(Layer::Samples, few);
    let bin = |k: u8| frame.get(Layer::BinColor(k)).unwrap().rgb(9, 9);
    // Five samples: bins 0 to 4 have one each.
    let [even, variance] = frame.color_half(0).unwrap();
    let [odd, _] = frame.color_half(1).unwrap();
    let mean = (bin(0) + bin(2) + bin(4)) / 3.0;
    assert!((even.rgb(9, 9) - mean).abs().max_element() < 1e-6);
    assert!((odd.rgb(9, 9) - (bin(1) + bin(3)) / 2.0).abs().max_element() < 1e-6);
    let squares = [0, 2, 4].map(|k| (bin(k) - mean) * (bin(k) - mean));
    let expected = (squares[0] + squares[1] + squares[2]) / 2.0 / 3.0;
    assert!((variance.rgb(9, 9) - expected).abs().max_element() < 1e-6);
    // A single sample is in both halves: there is nothing else.
    let one = Image { data: vec![1.0; WIDTH * HEIGHT], ..Image::new(WIDTH, HEIGHT, 1) };
    let first = bin(0);
    frame.set(Layer::Samples, one);
    for half in [0, 1] {
        assert_eq!(frame.color_half(half).unwrap()[0].rgb(9, 9), first);
    }
}
