//! Stacks of convolutions at full size.

use super::convolution::{Activation, Convolution};
use super::tensor::{Tensor, in_bands};
use super::weights::Weights;

/// Slope of leaky ReLU.
const SLOPE: f32 = 0.01;

/// Rows that are worked on at a time: what bounds the memory.
const ROWS: usize = 64;

/// Convolutions with leaky ReLU between them.
pub struct Stack {
    layers: Vec<Convolution>,
    /// Rows away that outputs depend on at most.
    reach: usize,
}

impl Stack {
    /// The network of arrays `layer0`, `layer1` and so on, whose taps are as far from each other as `dilations` say, with so many
    /// channels that go in and come out. The error says what is wrong with the weights.
    pub fn new(weights: &Weights, dilations: &[usize], (inputs, outputs): (usize, usize)) -> Result<Self, String> {
        let layer = |(k, &dilation): (usize, &usize)| {
            let activation = if k + 1 < dilations.len() { Activation::Leaky(SLOPE) } else { Activation::Linear };
            weights.convolution(&format!("layer{k}"), dilation, activation)
        };
        let layers = dilations.iter().enumerate().map(layer).collect::<Result<Vec<_>, _>>()?;
        let made = layers.iter().try_fold(inputs, |channels, layer| layer.after(channels))?;
        if made != outputs {
            return Err(format!("the weights make {made} channels instead of {outputs}"));
        }
        Ok(Self { layers, reach: dilations.iter().sum() })
    }

    /// The output, worked on in bands of rows.
    pub fn apply(&self, input: &Tensor) -> Tensor {
        let through = |input: &Tensor| {
            let first = self.layers[0].apply(input);
            self.layers[1..].iter().fold(first, |tensor, layer| layer.apply(&tensor))
        };
        in_bands(input, (ROWS, 1, self.reach), through)
    }
}
