//! Convolutions of a 1280x720 image: `cargo bench --bench convolution [-- PYTHON]`.
//!
//! With a Python that has PyTorch, whose convolutions are oneDNN's, it takes turns with these, in channels-last order. One
//! thread; medians of five, in seconds and thousand millions of operations a second.

mod common;

use std::process::Command;
use std::time::Instant;

use fluxion::internals::nn::{Activation, Convolution, Tensor};

use self::common::median;

const RUNS: usize = 5;
const SIZE: (usize, usize) = (1280, 720);

/// Inputs, outputs and pixels along a side.
const LAYERS: [(usize, usize, usize); 5] = [(16, 16, 3), (32, 32, 3), (64, 64, 3), (25, 24, 3), (32, 32, 1)];

const OTHER: &str = "
import sys, time, torch
torch.set_num_threads(1)
inputs, outputs, size = map(int, sys.argv[1:])
with torch.no_grad():
    layer = torch.nn.Conv2d(inputs, outputs, size, padding=size // 2).to(memory_format=torch.channels_last)
    image = torch.randn(1, inputs, 720, 1280).to(memory_format=torch.channels_last)
    layer(image)
    start = time.perf_counter()
    torch.nn.functional.leaky_relu(layer(image), 0.01)
    print(time.perf_counter() - start)
";

fn main() {
    let python = std::env::args().skip(1).find(|argument| !argument.starts_with("--"));
    rayon::ThreadPoolBuilder::new().num_threads(1).build_global().expect("a pool");
    println!("| inputs | outputs | size | seconds | GFLOP/s | PyTorch | ratio |\n|---|---|---|---|---|---|---|");
    for (inputs, outputs, size) in LAYERS {
        let weights: Vec<f32> = (0..outputs * inputs * size * size).map(|i| ((i % 17) as f32 - 8.0) * 0.01).collect();
        let layer =
            Convolution::new((outputs, inputs, size), 1, &weights, &vec![0.1; outputs], Activation::Leaky(0.01));
        let image = Tensor::from_fn(SIZE.0, SIZE.1, inputs, |x, y, pixel| pixel.fill((x ^ y) as f32 * 1e-3));
        layer.apply(&image);
        let own = || {
            let start = Instant::now();
            let made = layer.apply(&image);
            let seconds = start.elapsed().as_secs_f64();
            assert!(made.data.iter().all(|value| value.is_finite()));
            seconds
        };
        let (mut ours, mut others) = (Vec::new(), Vec::new());
        for _ in 0..RUNS {
            ours.push(own());
            others.extend(python.as_ref().map(|python| other(python, [inputs, outputs, size])));
        }
        let seconds = median(ours);
        let operations = (2 * size * size * inputs * outputs * SIZE.0 * SIZE.1) as f64 / 1e9;
        let beside = if others.is_empty() { None } else { Some(median(others)) };
        let beside = beside.map_or("| |".into(), |other| format!("{other:.3} | {:.2} |", seconds / other));
        println!("| {inputs} | {outputs} | {size}x{size} | {seconds:.3} | {:.0} | {beside}", operations / seconds);
    }
}

fn other(python: &str, layer: [usize; 3]) -> f64 {
    let arguments = layer.map(|number| number.to_string());
    let output = Command::new(python).args(["-c", OTHER]).args(arguments).output().expect("a Python");
    let text = String::from_utf8_lossy(&output.stdout);
    text.trim().parse().unwrap_or_else(|_| panic!("{}", String::from_utf8_lossy(&output.stderr)))
}
