//! Screened Poisson reconstruction in the L2 norm (Bhat et al. 2008; Kettunen et al. 2015): the image whose
//! differences are nearest to the sampled ones without straying from the sampled colour,
//! min |α (I - colour)|² + |Dx I - dx|² + |Dy I - dy|².
//!
//! The result is linear in colours and differences, so it is as unbiased as they are, and keeps the mean. Values may be
//! negative.
//! Differences to the right and downwards are solved for exactly by cosine transforms, edges between other pixels by
//! multigrid.

use rayon::prelude::*;

use super::common::inputs::{Inputs, check_memory};
use super::{Context, Method, Parameter, Parameters, Reconstruction, Solution, Traits};
use crate::error::Result;
use crate::film::{Cross, EdgeParts, Frame, Layer, Needs};
use crate::image::Image;
use crate::solve::poisson::{self, Targets, Weights};

/// `l2`.
pub const METHOD: Method = Method {
    id: "l2",
    summary: "screened Poisson reconstruction from colour and differences, unbiased",
    traits: Traits { keeps_mean: true, ..Traits::POISSON },
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
        Needs::EDGES
    }

    fn reconstruct(&self, frame: &Frame, context: &Context) -> Result<Solution> {
        check_memory(frame, context, METHOD.id, BYTES)?;
        let image = match frame.cross() {
            Err(_) if frame.own_edges().is_some() => self.by_multigrid(frame)?,
            cross => self.by_cosines(frame.require(Layer::Color)?, &cross?),
        };
        Ok(Solution { image, alpha: None, error: None, notes: Vec::new() })
    }
}

/// Residuals of the iterative solver are brought down to this share.
const TOLERANCE: f64 = 1e-6;

impl L2 {
    /// Solves exactly on the grid of direct neighbours.
    fn by_cosines(&self, color: &Image, cross: &Cross) -> Image {
        let [dx, dy] = cross.mean;
        let solve = |c| poisson::screened(color.width, &color.channel(c), &dx.channel(c), &dy.channel(c), self.alpha);
        let channels: Vec<_> = (0..3).into_par_iter().map(solve).collect();
        let mut image = Image::new(color.width, color.height, 3);
        for (i, value) in image.data.iter_mut().enumerate() {
            *value = channels[i % 3][i / 3] as f32;
        }
        image
    }

    /// Solves for edges between any pixels.
    fn by_multigrid(&self, frame: &Frame) -> Result<Image> {
        let inputs = Inputs::new(frame, 1)?;
        let edges = frame.edges(EdgeParts::default())?;
        let (data, differences) = (inputs.quads(Layer::Color)?, inputs.differences(&edges));
        let screen = (self.alpha * self.alpha) as f32;
        let weights = Weights { edges: vec![1.0; edges.len()], screen: vec![screen; data.len()] };
        let rhs = weights.rhs(Targets { edges: &edges, data: &data, differences: &differences });
        Ok(inputs.image(&weights.solver(&edges).solve(&rhs, data, TOLERANCE).x))
    }
}
