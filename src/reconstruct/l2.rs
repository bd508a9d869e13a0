//! Screened Poisson reconstruction in the L2 norm (Bhat et al. 2008; Kettunen et al. 2015): the image whose
//! differences are nearest to the sampled ones without straying from the sampled colour,
//! min |α (I - colour)|² + |Dx I - dx|² + |Dy I - dy|².
//!
//! It is linear in its data, so the result is as unbiased as they are, and keeps the mean. Values may be negative.

use rayon::prelude::*;

use super::inputs::check_memory;
use super::{Context, Method, Parameter, Parameters, Reconstruction, Solution};
use crate::error::Result;
use crate::film::{Frame, Layer, Needs};
use crate::image::Image;
use crate::solve::poisson;

/// `l2`.
pub const METHOD: Method = Method {
    id: "l2",
    summary: "screened Poisson reconstruction from colour and differences, unbiased",
    parameters: &[Parameter {
        name: "alpha",
        default: "0.2",
        summary: "weight of the colour against the differences, > 0; enters squared, as in Kettunen et al. 2015",
    }],
    make,
};

/// Bytes held for every pixel besides the frame, an upper bound.
const BYTES: u64 = 150;

fn make(parameters: &Parameters) -> Result<Box<dyn Reconstruction>> {
    let alpha = parameters.get("alpha", "a number in [1e-4, 1e4]", |alpha| (1e-4..=1e4).contains(alpha))?;
    Ok(Box::new(L2 { alpha }))
}

struct L2 {
    alpha: f64,
}

impl Reconstruction for L2 {
    fn needs(&self) -> Needs {
        Needs { edges: true, ..Needs::default() }
    }

    fn reconstruct(&self, frame: &Frame, context: &Context) -> Result<Solution> {
        check_memory(frame, context, METHOD.id, BYTES)?;
        let [color, dx, dy] = [Layer::Color, Layer::Dx, Layer::Dy].map(|layer| frame.require(layer));
        let (color, dx, dy) = (color?, dx?, dy?);
        let solve = |c| poisson::screened(frame.width, &color.channel(c), &dx.channel(c), &dy.channel(c), self.alpha);
        let channels: Vec<_> = (0..3).into_par_iter().map(solve).collect();
        let mut image = Image::new(frame.width, frame.height, 3);
        for (i, value) in image.data.iter_mut().enumerate() {
            *value = channels[i % 3][i / 3] as f32;
        }
        Ok(Solution { image, error: None, notes: Vec::new() })
    }
}
