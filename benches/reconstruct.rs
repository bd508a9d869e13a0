//! Seconds of each stage of a reconstruction: `cargo bench --bench reconstruct -- [METHOD [LAYERS.exr [WxH ...]]]`.
//!
//! The layers are those of `fluxion render --layers`; without a file they are synthetic. Sizes other than the frame's
//! repeat it or cut it off. Medians of five runs.

use std::cell::RefCell;
use std::path::Path;
use std::time::Instant;

use fluxion::film::{Frame, exr};
use fluxion::image::Image;
use fluxion::internals::synthetic::{Distribution, Noise, noisy, picture};
use fluxion::reconstruct::{Context, parse, solve};

const RUNS: usize = 5;

fn main() {
    // Cargo passes --bench of its own.
    let arguments: Vec<String> = std::env::args().skip(1).filter(|argument| !argument.starts_with("--")).collect();
    let method = arguments.first().map_or("frgr", String::as_str);
    let source = arguments.get(1).map_or_else(noise, |path| exr::load(Path::new(path)).expect("a file of layers"));
    let sizes = match arguments.get(2..) {
        Some(sizes) if !sizes.is_empty() => sizes.iter().map(|size| parse_size(size)).collect(),
        _ => vec![(640, 360), (1280, 720), (1920, 1080), (3840, 2160)],
    };
    println!("{method}, {} threads", rayon::current_num_threads());
    for (width, height) in sizes {
        let frame = repeated(&source, width, height);
        let mut runs: Vec<Vec<(String, f64)>> = (0..RUNS).map(|_| stages(method, &frame)).collect();
        runs.sort_by(|a, b| total(a).total_cmp(&total(b)));
        let median = &runs[RUNS / 2];
        let seconds = total(median);
        let list: Vec<_> = median.iter().map(|(stage, seconds)| format!("{stage} {seconds:.3}")).collect();
        let per_pixel = seconds / (width * height) as f64 * 1e6;
        println!("{width}x{height}: {seconds:.3} s, {per_pixel:.2} µs a pixel: {}", list.join(", "));
    }
}

fn parse_size(text: &str) -> (usize, usize) {
    let (width, height) = text.split_once('x').expect("a size such as 1280x720");
    (width.parse().expect("a width"), height.parse().expect("a height"))
}

fn total(stages: &[(String, f64)]) -> f64 {
    stages.iter().map(|(_, seconds)| seconds).sum()
}

/// Seconds between the messages about progress, summed by what they say is being done.
fn stages(method: &str, frame: &Frame) -> Vec<(String, f64)> {
    let marks = RefCell::new(vec![("begin".to_owned(), Instant::now())]);
    let progress = |what: &str, _: f32| marks.borrow_mut().push((what.to_owned(), Instant::now()));
    let made = parse(method).expect("a method");
    let solved = solve(made.as_ref(), frame, &Context { progress: &progress, memory: None, notes: false });
    solved.unwrap_or_else(|error| panic!("{error}"));
    progress("end", 1.0);
    let mut stages: Vec<(String, f64)> = Vec::new();
    for pair in marks.into_inner().windows(2) {
        let ((what, from), (_, to)) = (&pair[0], &pair[1]);
        let seconds = (*to - *from).as_secs_f64();
        match stages.iter_mut().find(|(known, _)| known == what) {
            Some((_, sum)) => *sum += seconds,
            None => stages.push((what.clone(), seconds)),
        }
    }
    stages
}

fn repeated(source: &Frame, width: usize, height: usize) -> Frame {
    let mut frame = Frame::new(width, height);
    for (layer, from) in source.present() {
        let mut image = Image::new(width, height, from.channels);
        for (i, pixel) in image.data.chunks_exact_mut(from.channels).enumerate() {
            pixel.copy_from_slice(from.pixel(i % width % from.width, i / width % from.height));
        }
        frame.set(layer, image);
    }
    frame
}

/// A picture under noise.
fn noise() -> Frame {
    let noise = Noise { color: 0.3, edge: 0.09, distribution: Distribution::Uniform };
    noisy(&picture((640, 360)), noise, 1)
}
