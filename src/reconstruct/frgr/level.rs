//! An image at one resolution: colour, differences, features and their variances.

use crate::image::planes::Planes;
use crate::reconstruct::common::features::Feature;
use crate::reconstruct::common::inputs::{FLOOR, floor_variance};

/// Means and variances of the means, radiance in units of its typical luminance.
#[derive(Clone)]
pub struct Level {
    /// Colour, and its variance.
    pub color: Planes,
    /// Variance of the colour.
    pub variance: Planes,
    /// Differences to the right and downwards. The values of the last column and row belong to no edge.
    pub gradients: [Planes; 2],
    /// Variances of the differences, mean over the channels.
    pub noise: [Planes; 2],
    /// Albedo and normal, if the frame has them and they are asked for.
    pub features: Vec<Feature>,
}

/// Least variance of a difference, as a share of the mean variance of those around it.
const GRADIENT_FLOOR: f32 = 0.25;

impl Level {
    /// The same with variances raised to a share of those around them.
    pub fn with_variance_floor(self) -> Self {
        let noise = [floor_variance(&self.noise[0], GRADIENT_FLOOR), floor_variance(&self.noise[1], GRADIENT_FLOOR)];
        Self { variance: floor_variance(&self.variance, FLOOR), noise, ..self }
    }
}
