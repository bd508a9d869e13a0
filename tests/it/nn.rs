//! Inference: layers against PyTorch's and against sums written out, on any number of threads and in bands.

use fluxion::internals::nn::tensor::in_bands;
use fluxion::internals::nn::{Activation, Convolution, Tensor, Weights, resample};
use proptest::prelude::*;

const VECTORS: &[u8] = include_bytes!("../data/nn.safetensors");

const LEAKY: Activation = Activation::Leaky(0.1);

fn tensor(weights: &Weights, name: &str) -> Tensor {
    weights.tensor(name).unwrap()
}

fn assert_near(made: &Tensor, expected: &Tensor, name: &str) {
    let shape = |tensor: &Tensor| (tensor.width, tensor.height, tensor.channels);
    assert_eq!(shape(made), shape(expected), "{name}");
    let largest = expected.data.iter().fold(0.0f32, |most, value| most.max(value.abs()));
    for (a, b) in made.data.iter().zip(&expected.data) {
        assert!((a - b).abs() <= 1e-5 * largest, "{name}: {a} instead of {b}");
    }
}

#[test]
fn layers_are_those_of_pytorch() {
    let weights = Weights::parse(VECTORS).unwrap();
    type Layer<'a> = Box<dyn Fn(&Tensor) -> Tensor + 'a>;
    let convolution = |name, dilation| -> Layer {
        let layer = weights.convolution(name, dilation, LEAKY).unwrap();
        Box::new(move |input| layer.apply(input))
    };
    let halve = weights.convolution("halve", 1, LEAKY).unwrap().halving();
    let double = weights.transposed("double", LEAKY).unwrap();
    let layers: [(&str, Layer); 8] = [
        ("halve", Box::new(move |input| halve.apply(input))),
        ("conv3", convolution("conv3", 1)),
        ("dilated", convolution("dilated", 3)),
        ("dense", convolution("dense", 1)),
        ("double", Box::new(move |input| double.apply(input))),
        ("pool", Box::new(resample::max_pool)),
        ("nearest", Box::new(nearest)),
        ("bilinear", Box::new(resample::bilinear)),
    ];
    for (name, layer) in layers {
        let made = layer(&tensor(&weights, &format!("{name}.input")));
        assert_near(&made, &tensor(&weights, &format!("{name}.output")), name);
    }
}

fn nearest(input: &Tensor) -> Tensor {
    resample::nearest_beside(input, &Tensor::new(2 * input.width, 2 * input.height, 0))
}

#[test]
fn damaged_files_are_refused_with_the_reason() {
    let changed = |from: &str, to: &str| {
        assert_eq!(from.len(), to.len());
        let at = VECTORS.windows(from.len()).position(|window| window == from.as_bytes()).unwrap();
        let mut bytes = VECTORS.to_vec();
        bytes[at..at + to.len()].copy_from_slice(to.as_bytes());
        bytes
    };
    let mut not_finite = VECTORS.to_vec();
    let end = not_finite.len();
    not_finite[end - 4..].copy_from_slice(&f32::NAN.to_le_bytes());
    for (bytes, expected) in [
        (VECTORS[..5].to_vec(), "shorter than its header"),
        (VECTORS[..900].to_vec(), "shorter than its header"),
        (VECTORS[..VECTORS.len() - 4].to_vec(), "beyond its end"),
        (changed("\"F32\"", "\"F64\""), "of type F64"),
        (changed("\"shape\"", "\"shade\""), "no sensible entry"),
        (changed("[33,7,1,1]", "[33,0,1,1]"), "without values"),
        (not_finite, "not finite"),
    ] {
        let why = Weights::parse(&bytes).unwrap_err();
        assert!(why.contains(expected), "{why}");
    }
    let weights = Weights::parse(VECTORS).unwrap();
    assert!(weights.convolution("conv4", 1, LEAKY).unwrap_err().contains("lacks the array conv4.weight"));
    assert!(weights.convolution("double", 1, LEAKY).unwrap_err().contains("no convolution double"));
    assert!(weights.transposed("conv3", LEAKY).unwrap_err().contains("no transposed convolution conv3"));
}

#[test]
fn bits_are_the_same_on_any_number_of_threads_and_in_bands() {
    let weights: Vec<f32> = (0..8 * 8 * 9).map(|i| ((i * 37) % 19) as f32 * 0.1 - 0.9).collect();
    let layer = |dilation| Convolution::new((8, 8, 3), dilation, &weights, &[0.1; 8], LEAKY);
    let network = |input: &Tensor| {
        let pooled = resample::max_pool(&layer(1).apply(input));
        layer(2).apply(&nearest(&pooled))
    };
    let input = Tensor::from_fn(30, 46, 8, |x, y, pixel| {
        pixel.iter_mut().enumerate().for_each(|(c, value)| *value = ((x * 7 + y * 13 + c * 5) % 11) as f32 - 5.0);
    });
    let on = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| network(&input))
    };
    let whole = on(1);
    assert_eq!(whole, on(3));
    for rows in [1, 8, 20, 100] {
        assert_eq!(in_bands(&input, (rows, 2, 5), network), whole, "{rows} rows");
    }
}

proptest! {
    #[test]
    fn convolutions_are_sums_of_products(
        (width, height) in (1usize..20, 1usize..9),
        (inputs, outputs) in (1usize..5, 1usize..20),
        size in prop::sample::select(vec![1usize, 3, 5]),
        dilation in 1usize..4,
        seed in 0usize..1000,
    ) {
        let number = |i: usize| ((i * 2654435761 + seed * 97) % 1000) as f32 / 500.0 - 1.0;
        let weights: Vec<f32> = (0..outputs * inputs * size * size).map(number).collect();
        let bias: Vec<f32> = (0..outputs).map(|i| number(i + 7777)).collect();
        let input = Tensor { width, height, channels: inputs, data: (0..width * height * inputs).map(|i| number(i + 31)).collect() };
        let made = Convolution::new((outputs, inputs, size), dilation, &weights, &bias, Activation::Linear).apply(&input);
        let mut expected = Tensor::new(width, height, outputs);
        for (y, x, o) in (0..height).flat_map(|y| (0..width).flat_map(move |x| (0..outputs).map(move |o| (y, x, o)))) {
            let mut sum = f64::from(bias[o]);
            for (ky, kx) in (0..size).flat_map(|ky| (0..size).map(move |kx| (ky, kx))) {
                let from = |at: usize, k: usize| (at + k * dilation).checked_sub(size / 2 * dilation);
                if let (Some(sx), Some(sy)) = (from(x, kx).filter(|&sx| sx < width), from(y, ky).filter(|&sy| sy < height)) {
                    let weight = |i: usize| weights[((o * inputs + i) * size + ky) * size + kx];
                    sum += (0..inputs).map(|i| f64::from(weight(i)) * f64::from(input.pixel(sx, sy)[i])).sum::<f64>();
                }
            }
            expected.data[(y * width + x) * outputs + o] = sum as f32;
        }
        let largest = expected.data.iter().fold(1.0f32, |most, value| most.max(value.abs()));
        for (a, b) in made.data.iter().zip(&expected.data) {
            prop_assert!((a - b).abs() <= 1e-5 * largest, "{a} instead of {b}");
        }
    }
}
