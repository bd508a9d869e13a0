//! The network: an encoder for colours and features, one for differences, residual blocks, and a decoder that sees what both
//! encoders had at its size.

use crate::nn::tensor::in_bands;
use crate::nn::{Activation, Convolution, Tensor, Weights};

/// Slope of leaky ReLU.
const SLOPE: f32 = 0.01;

/// How often the encoders halve the image, and number of residual blocks.
const LEVELS: usize = 3;
const BLOCKS: usize = 4;

/// Both sides of the inputs are multiples of this.
pub const MULTIPLE: usize = 1 << LEVELS;

/// Rows that are worked on at a time: what bounds the memory.
const ROWS: usize = 128;

/// Rows that an output depends on, to either side: two for every residual block and less than four for all the rest, in pixels
/// of the deepest level.
const REACH: usize = (2 * BLOCKS + 4) * MULTIPLE;

/// Layers of the network.
pub struct Network {
    data: Vec<Convolution>,
    gradient: Vec<Convolution>,
    blocks: Vec<[Convolution; 2]>,
    decoder: Vec<Convolution>,
    out: Convolution,
}

impl Network {
    /// The network of a weights file for so many channels of the encoders. The error says what is wrong with it.
    pub fn new(bytes: &[u8], inputs: [usize; 2]) -> Result<Self, String> {
        let weights = Weights::parse(bytes)?;
        let leaky = Activation::Leaky(SLOPE);
        let encoder = |name: &str| {
            let layer = |k| Ok(weights.convolution(&format!("{name}.{k}"), 1, leaky)?.halving());
            (0..LEVELS).map(layer).collect::<Result<Vec<_>, String>>()
        };
        let block = |k: usize| {
            let layer = |part: &str, activation| weights.convolution(&format!("blocks.{k}.{part}"), 1, activation);
            Ok([layer("a", leaky)?, layer("b", Activation::Linear)?])
        };
        let made = Self {
            data: encoder("data")?,
            gradient: encoder("gradient")?,
            blocks: (0..BLOCKS).map(block).collect::<Result<_, String>>()?,
            decoder: (0..LEVELS)
                .map(|k| weights.transposed(&format!("decoder.{k}"), leaky))
                .collect::<Result<_, String>>()?,
            out: weights.convolution("out", 1, Activation::Linear)?,
        };
        made.check(inputs)?;
        Ok(made)
    }

    /// Fails if layers do not fit each other.
    fn check(&self, inputs: [usize; 2]) -> Result<(), String> {
        let take = |channels: &mut usize, layer: &Convolution, beside: usize| {
            let (given, taken) = (*channels + beside, layer.inputs());
            *channels = layer.outputs();
            if given == taken { Ok(()) } else { Err(format!("a layer takes {taken} channels instead of {given}")) }
        };
        let [mut data, mut gradient] = inputs;
        let mut skips = Vec::new();
        for (a, b) in self.data.iter().zip(&self.gradient) {
            take(&mut data, a, 0)?;
            take(&mut gradient, b, 0)?;
            skips.push(data + gradient);
        }
        let mut channels = data + gradient;
        self.blocks.iter().flatten().try_for_each(|layer| take(&mut channels, layer, 0))?;
        self.decoder.iter().zip(skips.iter().rev()).try_for_each(|(layer, skip)| take(&mut channels, layer, *skip))?;
        take(&mut channels, &self.out, 0)?;
        if channels == 3 { Ok(()) } else { Err(format!("{channels} channels come out instead of 3")) }
    }

    /// The output for `both`, the channels of the data encoder's input and after them those of the gradient encoder's.
    pub fn apply(&self, both: &Tensor) -> Tensor {
        in_bands(both, (ROWS, MULTIPLE, REACH), |both| self.whole(both))
    }

    fn whole(&self, both: &Tensor) -> Tensor {
        let (mut data, mut gradient) = both.split(self.data[0].inputs());
        let mut skips = Vec::new();
        for (a, b) in self.data.iter().zip(&self.gradient) {
            (data, gradient) = (a.apply(&data), b.apply(&gradient));
            skips.push((data.clone(), gradient.clone()));
        }
        let mut at = Tensor::concat(&[&data, &gradient]);
        for [a, b] in &self.blocks {
            let more = b.apply(&a.apply(&at));
            at.data.iter_mut().zip(&more.data).for_each(|(value, more)| *value += more);
        }
        for layer in &self.decoder {
            let (data, gradient) = skips.pop().expect("as many as levels");
            at = layer.apply(&Tensor::concat(&[&at, &data, &gradient]));
        }
        self.out.apply(&at)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const VECTORS: &[u8] = include_bytes!("../../../tests/data/gradnet-own.safetensors");

    #[test]
    fn outputs_are_those_of_pytorch() {
        let weights = include_bytes!("own.safetensors");
        let vectors = Weights::parse(VECTORS).unwrap();
        let [data, gradient, output] = ["data", "gradient", "output"].map(|name| vectors.tensor(name).unwrap());
        let network = Network::new(weights, [data.channels, gradient.channels]).unwrap();
        let made = network.apply(&Tensor::concat(&[&data, &gradient]));
        let largest = output.data.iter().fold(0.0f32, |most, value| most.max(value.abs()));
        for (made, expected) in made.data.iter().zip(&output.data) {
            assert!((made - expected).abs() < 1e-5 * largest, "{made} instead of {expected}");
        }
        assert!(Network::new(weights, [9, 6]).err().unwrap().contains("channels instead of 9"));
    }

    #[test]
    fn bands_change_nothing() {
        let vectors = Weights::parse(VECTORS).unwrap();
        let network = Network::new(include_bytes!("own.safetensors"), [12, 8]).unwrap();
        let [data, gradient] = ["data", "gradient"].map(|name| vectors.tensor(name).unwrap());
        let part = Tensor::concat(&[&data, &gradient]);
        let tall =
            Tensor::from_fn(part.width, 2 * ROWS + 3 * REACH / MULTIPLE * MULTIPLE, part.channels, |x, y, pixel| {
                pixel.copy_from_slice(part.pixel(x, y * y % part.height));
            });
        assert_eq!(network.apply(&tall), network.whole(&tall));
    }
}
