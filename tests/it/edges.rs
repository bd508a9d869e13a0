//! Methods on edges between any pixels, which a frame holds in place of the cross of its layers.

use fluxion::error::Error;
use fluxion::film::{BINS, Edges, Frame, Layer};
use fluxion::image::Image;
use fluxion::internals::math::{Rgb, rng};
use fluxion::internals::synthetic::{change, exact, picture};
use fluxion::reconstruct::{Context, parse, solve};

const SIZE: (usize, usize) = (31, 22);

/// Methods that take any edges.
const METHODS: [&str; 10] = [
    "l2",
    "l1",
    "least_trimmed",
    "least_trimmed:norm=l2",
    "control_variate",
    "control_variate:weights=uniform",
    "control_variate:weights=given",
    "control_variate:cross=on",
    "feature:prefilter=off",
    "apr:prefilter=off",
];

fn random(i: usize, k: u64) -> f32 {
    rng::unit(rng::combine(k, i as u64))
}

/// Edges of every pixel to about two random pixels of the 5x5 around it.
fn random_edges() -> Edges {
    let (width, height) = SIZE;
    let pairs = (0..2 * width * height).filter_map(|i| {
        let (x, y) = (i / 2 % width, i / 2 / width);
        let step = |k: u64| (5.0 * random(i, k)) as isize - 2;
        let (a, b) = (x.checked_add_signed(step(1))?, y.checked_add_signed(step(2))?);
        (a < width && b < height).then_some([y * width + x, b * width + a])
    });
    Edges::new(SIZE, pairs)
}

/// A noise-free frame of a picture with the given edges.
fn frame(image: &Image, mut edges: Edges) -> Frame {
    let color = |pixel: usize| image.rgb(pixel % SIZE.0, pixel / SIZE.0);
    edges.mean = (0..edges.len()).map(|edge| edges.ends(edge)).map(|[low, high]| color(high) - color(low)).collect();
    edges.variance = vec![Rgb::splat(1e-4); edges.len()];
    edges.bins = edges.mean.iter().map(|mean| [*mean; BINS]).collect();
    edges.counts = vec![64; edges.len()];
    edges.weights = (0..edges.len()).map(|edge| [0.2 + random(edge, 3), 0.2 + random(edge, 4)]).collect();
    let mut frame = exact(image);
    frame.set_edges(edges);
    frame
}

fn run(method: &str, frame: &Frame) -> Result<Image, Error> {
    solve(parse(method)?.as_ref(), frame, &Context::QUIET).map(|solution| solution.image)
}

fn farthest(a: &Image, b: &Image) -> f32 {
    a.data.iter().zip(&b.data).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max)
}

#[test]
fn a_noise_free_frame_is_a_fixed_point_whatever_its_edges() {
    let image = picture(SIZE);
    let edges = random_edges();
    assert!(edges.offsets().len() >= 12 && edges.len() > 800, "{} edges", edges.len());
    for method in METHODS {
        for edges in [edges.clone(), Edges::new(SIZE, [[0, 40], [7, 9]]), Edges::new(SIZE, [])] {
            let worst = farthest(&run(method, &frame(&image, edges)).unwrap(), &image);
            assert!(worst < 1e-4, "{method}: {worst}");
        }
    }
}

#[test]
fn edges_spread_what_they_know_as_those_of_layers_do() {
    let image = picture(SIZE);
    let noisy = |seed: u64, image: &Image| {
        let data = image.data.iter().enumerate().map(|(i, value)| value + 0.2 * (random(i, seed) - 0.5)).collect();
        Image { data, ..image.clone() }
    };
    let color = noisy(5, &image);
    let with_color = |mut frame: Frame| {
        frame.set(Layer::Color, color.clone());
        change(&mut frame, Layer::ColorVariance, |_, _| 0.2 * 0.2 / 12.0);
        frame
    };
    // The cross as edges of its own: another solver, but the same problem.
    for method in ["l2", "l1", "least_trimmed", "control_variate:weights=uniform"] {
        let own = run(method, &with_color(frame(&image, Edges::cross(SIZE)))).unwrap();
        let of_layers = run(method, &with_color(exact(&image))).unwrap();
        assert!(farthest(&own, &of_layers) < 1e-4, "{method}: {}", farthest(&own, &of_layers));
    }
    // Exact differences remove noise of the colours.
    let truth = picture(SIZE);
    let error = |image: &Image| image.data.iter().zip(&truth.data).map(|(a, b)| (a - b).powi(2)).sum::<f32>();
    for method in METHODS {
        let many = run(method, &with_color(frame(&image, random_edges()))).unwrap();
        assert!(error(&many) < 0.8 * error(&color), "{method}: {} of {}", error(&many), error(&color));
    }
}

#[test]
fn methods_on_a_grid_say_that_they_need_the_cross() {
    let frame = frame(&picture(SIZE), random_edges());
    let message = run("frgr", &frame).unwrap_err().to_string();
    assert!(message.contains("dx.R") && message.contains("between other pixels"), "{message}");
}

#[test]
fn edges_survive_files_to_the_bit() {
    let edges = random_edges();
    let mut written = frame(&picture(SIZE), edges);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.exr");
    fluxion::exr::save(&path, &written).unwrap();
    let read = fluxion::exr::load(&path).unwrap();
    // Counts are those of the pixels.
    let mut expected = written.own_edges().unwrap().clone();
    let samples = written.get(Layer::Samples).unwrap().data[0] as u32;
    expected.counts = vec![samples; expected.len()];
    assert!(!expected.weights.is_empty());
    written.set_edges(expected);
    assert!(read.own_edges() == written.own_edges());
    // Edges that files have no room for are not lost silently.
    let mut long = exact(&picture(SIZE));
    let mut edge = Edges::new(SIZE, [[0, 3]]);
    edge.mean = vec![Rgb::ZERO];
    long.set_edges(edge);
    let message = fluxion::exr::save(&path, &long).unwrap_err().to_string();
    assert!(message.contains("a.exr") && message.contains("windows of 5x5"), "{message}");
    // Values that cannot be are refused.
    let kept = written.own_edges().unwrap().clone();
    for what in ["variance", "weight"] {
        let mut wrong = kept.clone();
        if what == "weight" {
            wrong.weights[7][1] = -1.0;
        } else {
            wrong.variance[7].y = -1.0;
        }
        written.set_edges(wrong);
        let message = run("l2", &written).unwrap_err().to_string();
        assert!(message.contains(&format!("{what} between chosen neighbours")), "{message}");
    }
}

#[test]
fn given_weights_are_those_of_the_mean() {
    let (image, mut edges) = (picture(SIZE), Edges::new(SIZE, [[3, 34]]));
    edges.mean = vec![Rgb::splat(0.5)];
    edges.weights = vec![[3.0, 1.0]];
    let mut frame = exact(&image);
    frame.set_edges(edges);
    let result = run("control_variate:weights=given,iterations=1", &frame).unwrap();
    let at = |image: &Image, pixel: usize| image.rgb(pixel % SIZE.0, pixel / SIZE.0);
    let (low, high) = (at(&image, 3), at(&image, 34));
    let expected = [0.25 * low + 0.75 * (high - 0.5), 0.5 * high + 0.5 * (low + 0.5)];
    for (pixel, expected) in [3, 34].into_iter().zip(expected) {
        assert!((at(&result, pixel) - expected).abs().max_element() < 1e-5, "{pixel}");
    }
    let mut without = exact(&image);
    let mut edges = Edges::new(SIZE, [[3, 34]]);
    edges.mean = vec![Rgb::ZERO];
    without.set_edges(edges);
    let message = run("control_variate:weights=given", &without).unwrap_err().to_string();
    assert!(message.contains("without weights"), "{message}");
}
