//! Convolutions. Zeros surround the input, so that outputs are as large as inputs, or half or twice as large.

use rayon::prelude::*;

use super::tensor::Tensor;
use crate::ffi::vectors::Vectors;
use crate::math::lanes::{LANES, Lanes};

/// Function of a weighted sum.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Activation {
    /// The sum itself.
    Linear,
    /// Leaky ReLU: the sum, times a slope where it is negative.
    Leaky(f32),
}

/// A convolution of 3x3 or 1x1 pixels (then it is a dense layer for every pixel), or one that halves or doubles the size.
#[derive(Clone, Debug)]
pub struct Convolution {
    inputs: usize,
    outputs: usize,
    /// Input pixels from one output pixel to the next along each axis, 1 or 2.
    step: usize,
    /// Output pixels for every input pixel along each axis, 1 or 2.
    stride: usize,
    /// For each of the stride² output pixels: its taps.
    phases: Vec<Phase>,
    /// Bias, padded to whole packets.
    bias: Vec<f32>,
    activation: Activation,
}

/// Taps that an output pixel is summed over.
#[derive(Clone, Debug)]
struct Phase {
    /// Columns and rows from the pixel to the inputs.
    taps: Vec<(isize, isize)>,
    /// For each packet of outputs, each tap and each input: the weights of the outputs.
    weights: Vec<f32>,
}

impl Phase {
    /// `weight(tap, input, output)` packed.
    fn new(
        taps: Vec<(isize, isize)>,
        (inputs, outputs): (usize, usize),
        weight: impl Fn(usize, usize, usize) -> f32,
    ) -> Self {
        let mut weights = Vec::new();
        for first in (0..outputs).step_by(LANES) {
            for tap in 0..taps.len() {
                for input in 0..inputs {
                    let of_output = |output| if output < outputs { weight(tap, input, output) } else { 0.0 };
                    weights.extend((first..first + LANES).map(of_output));
                }
            }
        }
        Self { taps, weights }
    }
}

impl Convolution {
    /// A convolution of `size` x `size` pixels, an odd number, that are `dilation` apart. Weights are indexed by output, input,
    /// row and column, as PyTorch's `Conv2d` has them.
    pub fn new(
        (outputs, inputs, size): (usize, usize, usize),
        dilation: usize,
        weights: &[f32],
        bias: &[f32],
        activation: Activation,
    ) -> Self {
        assert_eq!((weights.len(), bias.len()), (outputs * inputs * size * size, outputs), "as many as the shape says");
        let offset = |k: usize| (k as isize - size as isize / 2) * dilation as isize;
        let taps: Vec<_> = (0..size * size).map(|tap| (offset(tap % size), offset(tap / size))).collect();
        let weight = |tap, input, output| weights[(output * inputs + input) * size * size + tap];
        let phases = vec![Phase::new(taps, (inputs, outputs), weight)];
        Self { inputs, outputs, step: 1, stride: 1, phases, bias: padded(bias), activation }
    }

    /// A transposed convolution of 4x4 pixels and stride 2, which doubles the size. Weights are indexed by input, output, row
    /// and column, as PyTorch's `ConvTranspose2d` with a padding of 1 has them.
    pub fn transposed(
        (outputs, inputs): (usize, usize),
        weights: &[f32],
        bias: &[f32],
        activation: Activation,
    ) -> Self {
        assert_eq!((weights.len(), bias.len()), (outputs * inputs * 16, outputs), "as many as the shape says");
        // Output 2i + p takes weight k of the input (2i + p + 1 - k) / 2, where that is a whole number.
        const ALONG: [[(usize, isize); 2]; 2] = [[(3, -1), (1, 0)], [(2, 0), (0, 1)]];
        let phase = |phase: usize| {
            let (rows, columns) = (ALONG[phase / 2], ALONG[phase % 2]);
            let pairs: Vec<_> = rows.iter().flat_map(|row| columns.iter().map(move |column| (*column, *row))).collect();
            let taps = pairs.iter().map(|((_, dx), (_, dy))| (*dx, *dy)).collect();
            Phase::new(taps, (inputs, outputs), |tap, input, output| {
                let ((kx, _), (ky, _)) = pairs[tap];
                weights[((input * outputs + output) * 4 + ky) * 4 + kx]
            })
        };
        let phases = (0..4).map(phase).collect();
        Self { inputs, outputs, step: 1, stride: 2, phases, bias: padded(bias), activation }
    }

    /// The same at every second column and row only, which halves the size: what PyTorch has with a stride of 2.
    pub fn halving(self) -> Self {
        assert_eq!((self.step, self.stride), (1, 1), "a convolution that keeps the size");
        Self { step: 2, ..self }
    }

    /// Number of channels that go in.
    pub fn inputs(&self) -> usize {
        self.inputs
    }

    /// Number of channels that come out.
    pub fn outputs(&self) -> usize {
        self.outputs
    }

    /// Number of channels that come out where `given` go in. An error if the layer takes another number.
    pub fn after(&self, given: usize) -> Result<usize, String> {
        match self.inputs {
            taken if taken == given => Ok(self.outputs),
            taken => Err(format!("a layer takes {taken} channels instead of {given}")),
        }
    }

    /// The convolution of a tensor.
    pub fn apply(&self, input: &Tensor) -> Tensor {
        let (width, height) = self.size(input);
        let mut output = Tensor::new(width, height, self.outputs);
        self.apply_into(input, &mut output, 0);
        output
    }

    /// The same into the channels of `output` from `first` on, as parts of what is to be concatenated.
    pub fn apply_into(&self, input: &Tensor, output: &mut Tensor, first: usize) {
        assert_eq!(input.channels, self.inputs, "as many channels as the convolution takes");
        assert_eq!((output.width, output.height), self.size(input));
        assert!(first + self.outputs <= output.channels);
        let wide = has_wide_registers();
        let (channels, border) = (output.channels, self.border());
        let rows = output.rows_mut().chunks(self.stride);
        rows.enumerate().for_each_init(Vec::new, |window, (y, rows)| {
            window_of(window, input, (y * self.step) as isize, border);
            let window = Window { values: window, width: input.width + 2 * border, border, channels: self.inputs };
            for (row_phase, (_, row)) in rows.into_iter().enumerate() {
                for column_phase in 0..self.stride {
                    let phase = &self.phases[row_phase * self.stride + column_phase];
                    let target = &mut row[column_phase * channels + first..];
                    let columns = Columns { step: self.stride * channels, width: input.width / self.step };
                    // As many sums as registers have room for.
                    if wide {
                        self.row::<12>(phase, &window, target, columns)
                    } else {
                        self.row::<6>(phase, &window, target, columns)
                    }
                }
            }
        });
    }

    /// Columns and rows of the output.
    fn size(&self, input: &Tensor) -> (usize, usize) {
        assert!(input.width.is_multiple_of(self.step) && input.height.is_multiple_of(self.step), "sides can be halved");
        (input.width / self.step * self.stride, input.height / self.step * self.stride)
    }

    /// Rows and columns that taps reach beyond a pixel.
    fn border(&self) -> usize {
        let reach = |(dx, dy): &(isize, isize)| dx.abs().max(dy.abs());
        self.phases.iter().flat_map(|phase| phase.taps.iter().map(reach)).max().unwrap_or(0) as usize
    }

    /// One phase of an output row, P pixels at a time.
    fn row<const P: usize>(&self, phase: &Phase, window: &Window, target: &mut [f32], columns: Columns) {
        let packets = phase.weights.chunks_exact(phase.taps.len() * self.inputs * LANES);
        let starts: Vec<usize> = phase.taps.iter().map(|tap| window.start(*tap)).collect();
        for (packet, weights) in packets.enumerate() {
            let outputs = LANES.min(self.outputs - packet * LANES);
            let bias = Lanes::load(&self.bias[packet * LANES..]);
            let sums = Sums { weights, starts: &starts, inputs: self.inputs, step: self.step, bias };
            let mut x = 0;
            while x < columns.width {
                let mut put = |p: usize, sum: Lanes| {
                    let to = &mut target[(x + p) * columns.step + packet * LANES..][..outputs];
                    to.copy_from_slice(&self.activation.of(sum).0[..outputs]);
                };
                if x + P <= columns.width {
                    sums.of::<P>(window.values, x).into_iter().enumerate().for_each(|(p, sum)| put(p, sum));
                    x += P;
                } else {
                    sums.of::<1>(window.values, x).into_iter().for_each(|sum| put(0, sum));
                    x += 1;
                }
            }
        }
    }
}

/// Positions of a phase's pixels in an output row.
#[derive(Clone, Copy)]
struct Columns {
    /// Values from one to the next.
    step: usize,
    /// Their number.
    width: usize,
}

/// Rows around one, with zeros around the image.
struct Window<'a> {
    values: &'a [f32],
    width: usize,
    border: usize,
    channels: usize,
}

impl Window<'_> {
    /// Position of a tap's first value for the pixel in column 0.
    fn start(&self, (dx, dy): (isize, isize)) -> usize {
        let row = (dy + self.border as isize) as usize;
        let column = (dx + self.border as isize) as usize;
        (row * self.width + column) * self.channels
    }
}

/// Fills the rows around row `y`.
fn window_of(window: &mut Vec<f32>, input: &Tensor, y: isize, border: usize) {
    let (width, channels) = (input.width + 2 * border, input.channels);
    window.clear();
    window.resize(width * (2 * border + 1) * channels, 0.0);
    for (k, row) in window.chunks_exact_mut((width * channels).max(1)).enumerate() {
        if let Some(from) = usize::try_from(y + k as isize - border as isize).ok().filter(|&from| from < input.height) {
            row[border * channels..][..input.width * channels].copy_from_slice(input.row(from));
        }
    }
}

/// Sums of a packet of outputs.
struct Sums<'a> {
    weights: &'a [f32],
    starts: &'a [usize],
    inputs: usize,
    step: usize,
    bias: Lanes,
}

impl Sums<'_> {
    /// The sums of P pixels from column `x` on, always in the same order of their terms.
    fn of<const P: usize>(&self, window: &[f32], x: usize) -> [Lanes; P] {
        let mut sums = [self.bias; P];
        let pixel = self.step * self.inputs;
        accumulate(&mut sums, window, self.weights, self.starts, (x * pixel, pixel, self.inputs));
        sums
    }
}

vectorized! {
    fn accumulate<const P: usize>(
        sums: &mut [Lanes; P],
        window: &[f32],
        weights: &[f32],
        starts: &[usize],
        (offset, pixel, inputs): (usize, usize, usize),
    ) {
        let mut total = *sums;
        for (start, weights) in starts.iter().zip(weights.chunks_exact(inputs * LANES)) {
            let values = &window[start + offset..][..(P - 1) * pixel + inputs];
            for (input, weights) in weights.chunks_exact(LANES).enumerate() {
                let weights = Lanes::load(weights);
                for (p, sum) in total.iter_mut().enumerate() {
                    *sum += Lanes::splat(values[p * pixel + input]) * weights;
                }
            }
        }
        *sums = total;
    }
}

impl Activation {
    #[inline(always)]
    fn of(self, sum: Lanes) -> Lanes {
        match self {
            Self::Linear => sum,
            Self::Leaky(slope) => Lanes(sum.0.map(|value| if value < 0.0 { slope * value } else { value })),
        }
    }
}

fn padded(bias: &[f32]) -> Vec<f32> {
    let mut bias = bias.to_vec();
    bias.resize(bias.len().next_multiple_of(LANES), 0.0);
    bias
}

/// Whether there are 32 vector registers instead of 16. Only the speed depends on it.
fn has_wide_registers() -> bool {
    Vectors::get() == Vectors::Avx512
}
