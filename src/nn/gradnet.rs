//! GradNet (Guo et al. 2019): an encoder for colours and features, one for differences, residual blocks, and a decoder that sees
//! what both encoders had at its size. At full size it may see the inputs, too, which the published one does not.

use super::convolution::{Activation, Convolution};
use super::tensor::{Tensor, band_rows, in_bands};
use super::weights::Weights;

/// Slope of leaky ReLU.
const SLOPE: f32 = 0.01;

/// How often the encoders halve the image, and number of residual blocks.
const LEVELS: usize = 3;
const BLOCKS: usize = 4;

/// Rows that an output depends on, to either side: two for every residual block and less than four for all the rest, in pixels
/// of the deepest level.
const REACH: usize = (2 * BLOCKS + 4) * GradNet::MULTIPLE;

/// Layers of the network.
pub struct GradNet {
    data: Vec<Convolution>,
    gradient: Vec<Convolution>,
    blocks: Vec<[Convolution; 2]>,
    decoder: Vec<Convolution>,
    /// A convolution of all inputs at full size, and one of that beside what was decoded.
    near: Option<[Convolution; 2]>,
    out: Convolution,
}

impl GradNet {
    /// Both sides of the inputs are multiples of this.
    pub const MULTIPLE: usize = 1 << LEVELS;

    /// The network of arrays `data.0` to `data.2`, `gradient.0` to `gradient.2`, `blocks.0.a` to `blocks.3.b`, `decoder.0` to
    /// `decoder.2`, `near` and `last` if it has them, and `out`, each with `.weight` and `.bias`. The error says what is wrong
    /// with them.
    pub fn new(weights: &Weights) -> Result<Self, String> {
        let layer = |name: &str, activation| weights.convolution(name, 1, activation);
        let leaky = |name: &str| layer(name, Activation::Leaky(SLOPE));
        let encoder = |name: &str| {
            (0..LEVELS).map(|k| Ok(leaky(&format!("{name}.{k}"))?.halving())).collect::<Result<Vec<_>, String>>()
        };
        let block =
            |k: usize| Ok([leaky(&format!("blocks.{k}.a"))?, layer(&format!("blocks.{k}.b"), Activation::Linear)?]);
        let doubling = |k: usize| weights.transposed(&format!("decoder.{k}"), Activation::Leaky(SLOPE));
        let near = if weights.has("near.weight") { Some([leaky("near")?, leaky("last")?]) } else { None };
        let made = Self {
            data: encoder("data")?,
            gradient: encoder("gradient")?,
            blocks: (0..BLOCKS).map(block).collect::<Result<_, String>>()?,
            decoder: (0..LEVELS).map(doubling).collect::<Result<_, String>>()?,
            near,
            out: layer("out", Activation::Linear)?,
        };
        made.check()?;
        Ok(made)
    }

    /// Fails if layers do not fit each other.
    fn check(&self) -> Result<(), String> {
        let [mut data, mut gradient] = self.inputs();
        let both = data + gradient;
        let mut skips = Vec::new();
        for (a, b) in self.data.iter().zip(&self.gradient) {
            (data, gradient) = (a.after(data)?, b.after(gradient)?);
            skips.push(data + gradient);
        }
        let mut channels = data + gradient;
        for layer in self.blocks.iter().flatten() {
            channels = layer.after(channels)?;
        }
        for (layer, skip) in self.decoder.iter().zip(skips.iter().rev()) {
            channels = layer.after(channels + skip)?;
        }
        if let Some([first, last]) = &self.near {
            channels = last.after(channels + first.after(both)?)?;
        }
        self.out.after(channels).map(|_| ())
    }

    /// Number of channels that each encoder takes.
    pub fn inputs(&self) -> [usize; 2] {
        [&self.data, &self.gradient].map(|encoder| encoder[0].inputs())
    }

    /// Number of channels that come out.
    pub fn outputs(&self) -> usize {
        self.out.outputs()
    }

    /// The output for `both`, the channels of the data encoder's input and after them those of the gradient encoder's. Bands of
    /// rows bound the memory and do not change the values.
    pub fn apply(&self, both: &Tensor) -> Tensor {
        self.in_bands(both, band_rows((both.width, both.height), REACH))
    }

    fn in_bands(&self, both: &Tensor, rows: usize) -> Tensor {
        in_bands(both, (rows, Self::MULTIPLE, REACH), |both| self.whole(both))
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
        let (doubling, finest) = self.decoder.split_at(LEVELS - 1);
        let mut beside = |at: &Tensor| {
            let (data, gradient) = skips.pop().expect("as many as levels");
            Tensor::concat(&[at, &data, &gradient])
        };
        for layer in doubling {
            at = layer.apply(&beside(&at));
        }
        let (at, finest) = (beside(&at), &finest[0]);
        let Some([first, last]) = &self.near else { return self.out.apply(&finest.apply(&at)) };
        // At full size nothing is copied.
        let mut whole = Tensor::new(both.width, both.height, finest.outputs() + first.outputs());
        finest.apply_into(&at, &mut whole, 0);
        first.apply_into(both, &mut whole, finest.outputs());
        self.out.apply(&last.apply(&whole))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A small network with its inputs and output.
    const PRINTED: &[u8] = include_bytes!("../../tests/data/gradnet-printed.safetensors");

    fn inputs(vectors: &Weights) -> Tensor {
        let [data, gradient] = ["data", "gradient"].map(|name| vectors.tensor(name).unwrap());
        Tensor::concat(&[&data, &gradient])
    }

    #[test]
    fn outputs_are_those_of_pytorch() {
        let vectors = Weights::parse(PRINTED).unwrap();
        let network = GradNet::new(&vectors).unwrap();
        assert_eq!((network.inputs(), network.outputs()), ([10, 6], 3));
        let (made, output) = (network.apply(&inputs(&vectors)), vectors.tensor("output").unwrap());
        let largest = output.data.iter().fold(0.0f32, |most, value| most.max(value.abs()));
        for (made, expected) in made.data.iter().zip(&output.data) {
            assert!((made - expected).abs() < 1e-5 * largest, "{made} instead of {expected}");
        }
    }

    #[test]
    fn bands_change_nothing() {
        let vectors = Weights::parse(PRINTED).unwrap();
        let (network, part) = (GradNet::new(&vectors).unwrap(), inputs(&vectors));
        let rows = 5 * REACH;
        let tall = Tensor::from_fn(part.width, rows, part.channels, |x, y, pixel| {
            pixel.copy_from_slice(part.pixel(x, y * y % part.height));
        });
        assert_eq!(network.in_bands(&tall, REACH), network.whole(&tall));
    }
}
