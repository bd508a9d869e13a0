//! U-Nets: a picture is halved level by level and doubled again, each time beside what the level had on the way down
//! (Ronneberger et al. 2015).

use super::convolution::{Activation, Convolution};
use super::resample::{max_pool, nearest_beside};
use super::tensor::{Tensor, band_rows, in_bands};
use super::weights::Weights;

/// Slope of leaky ReLU.
const SLOPE: f32 = 0.01;

/// A U-Net of 3x3 convolutions; the last one is of 1x1 pixels.
pub struct UNet {
    first: Convolution,
    /// One at full size, and one after every halving.
    down: Vec<Convolution>,
    middle: Convolution,
    /// One after every doubling.
    up: Vec<Convolution>,
    last: Convolution,
    out: Convolution,
}

impl UNet {
    /// The network of arrays `first`, `down.0` to `down.N`, `middle`, `up.0` to `up.N-1`, `last` and `out`, each with `.weight`
    /// and `.bias`, after a prefix. The error says what is wrong with them.
    pub fn new(weights: &Weights, prefix: &str, halvings: usize) -> Result<Self, String> {
        let layer = |name: &str| weights.convolution(&format!("{prefix}{name}"), 1, Activation::Leaky(SLOPE));
        let layers =
            |name: &str, count: usize| (0..count).map(|k| layer(&format!("{name}.{k}"))).collect::<Result<Vec<_>, _>>();
        let made = Self {
            first: layer("first")?,
            down: layers("down", halvings + 1)?,
            middle: layer("middle")?,
            up: layers("up", halvings)?,
            last: layer("last")?,
            out: weights.convolution(&format!("{prefix}out"), 1, Activation::Linear)?,
        };
        made.check()?;
        Ok(made)
    }

    /// Fails if layers do not fit each other.
    fn check(&self) -> Result<(), String> {
        let mut channels = self.first.inputs();
        let mut take = |layer: &Convolution, beside: usize| {
            channels = layer.after(channels + beside)?;
            Ok::<_, String>(())
        };
        take(&self.first, 0)?;
        self.down.iter().try_for_each(|layer| take(layer, 0))?;
        take(&self.middle, 0)?;
        let skips = self.down.iter().rev().skip(1);
        self.up.iter().zip(skips).try_for_each(|(layer, skip)| take(layer, skip.outputs()))?;
        [&self.last, &self.out].into_iter().try_for_each(|layer| take(layer, 0))
    }

    /// Number of channels that go in.
    pub fn inputs(&self) -> usize {
        self.first.inputs()
    }

    /// Number of channels that come out.
    pub fn outputs(&self) -> usize {
        self.out.outputs()
    }

    /// Both sides of the input are multiples of this.
    pub fn multiple(&self) -> usize {
        1 << self.up.len()
    }

    /// The output, worked on in bands of rows, which bounds the memory and does not change the values.
    pub fn apply(&self, input: &Tensor) -> Tensor {
        let deepest = self.multiple();
        // A convolution reaches one pixel of its level; all of the finer levels together reach less than three of the deepest
        // one's, and halving and doubling less than one each.
        let (rows, reach) = (band_rows((input.width, input.height), 6 * deepest), 6 * deepest);
        in_bands(input, (rows, deepest, reach), |input| self.whole(input))
    }

    fn whole(&self, input: &Tensor) -> Tensor {
        let mut skips = Vec::new();
        let mut at = self.down[0].apply(&self.first.apply(input));
        for layer in &self.down[1..] {
            let below = layer.apply(&max_pool(&at));
            skips.push(std::mem::replace(&mut at, below));
        }
        at = self.middle.apply(&at);
        for layer in &self.up {
            let skip = skips.pop().expect("as many as halvings");
            at = layer.apply(&nearest_beside(&at, &skip));
        }
        self.out.apply(&self.last.apply(&at))
    }
}
