//! The screened Poisson problem of a frame: colours, and the differences that they should have.

use std::borrow::Cow;

use super::inputs::{Inputs, check_memory};
use crate::error::Result;
use crate::film::{EdgeParts, Edges, Frame, Layer};
use crate::reconstruct::Context;
use crate::solve::graph::Quad;
use crate::solve::poisson::Targets;

/// Colours and differences of a frame, as solvers take them.
pub struct Problem<'a> {
    /// The frame.
    pub inputs: Inputs<'a>,
    /// Pixels that differences are known between.
    pub edges: Cow<'a, Edges>,
    /// Colours.
    pub data: Vec<Quad>,
    /// Differences, edge by edge.
    pub differences: Vec<Quad>,
}

impl<'a> Problem<'a> {
    /// The problem of a frame, for a method that takes so many bytes a pixel.
    pub fn new(frame: &'a Frame, context: &Context, (method, bytes): (&'static str, u64)) -> Result<Self> {
        let inputs = Inputs::new(frame, 1)?;
        check_memory(frame, context, method, bytes)?;
        let data = inputs.quads(Layer::Color)?;
        let edges = frame.edges(EdgeParts::default())?;
        let differences = inputs.differences(&edges);
        Ok(Self { inputs, edges, data, differences })
    }

    /// Targets of the solvers.
    pub fn targets(&self) -> Targets<'_> {
        Targets { edges: &self.edges, data: &self.data, differences: &self.differences }
    }
}
