//! Checks a scene folder against its reference: does an independent render agree within the noise of both?

use std::path::Path;

use super::Reference;
use crate::error::Result;
use crate::mitsuba;
use crate::render::Control;

/// Largest departure of a channel's mean that passes, apart from its noise.
const MEAN_TOLERANCE: f64 = 0.01;
/// Largest share of values beyond four standard errors that passes.
const OUTLIER_TOLERANCE: f64 = 0.01;
/// Rounding of half floats, as a share of the value (a uniform error of half a unit in the last place).
const HALF_ROUNDING: f64 = 4.9e-4 / 3.464;

/// The outcome of a check.
#[derive(Clone, Copy, Debug)]
pub struct Verdict {
    /// Mean of the render over mean of the reference, per channel.
    pub mean_ratio: [f64; 3],
    /// Root mean square of the differences in standard errors: 1 when the noise is all there is.
    pub z_rms: f64,
    /// Share of values that differ by more than four standard errors.
    pub outliers: f64,
    /// Whether the means and the outliers are within their tolerances.
    pub passed: bool,
}

/// Renders `folder/scene.xml` at the size of `folder/reference.exr` and compares.
pub fn check_folder(folder: &Path, spp: u32, seed: u64) -> Result<Verdict> {
    let reference = Reference::load(&folder.join("reference.exr"))?;
    let size = (reference.image.width, reference.image.height);
    let scene = mitsuba::load(
        &folder.join("scene.xml"),
        &mitsuba::Options { size: Some(size), ..mitsuba::Options::default() },
    )?;
    let mut own = Reference::new(&scene, seed);
    own.add_wave(&scene, spp.div_ceil(2), &Control::QUIET)?;
    let mut sums = [[0.0; 3]; 3];
    let (mut squares, mut outliers) = (0.0, 0);
    for i in 0..own.image.data.len() {
        let at = |image: &crate::image::Image| f64::from(image.data[i]);
        let (value, expected) = (at(&own.image), at(&reference.image));
        let rounding = HALF_ROUNDING * expected;
        // Few samples may all have missed what makes the noise, and the reference may have missed what a few
        // have hit: the larger of both variances is used.
        let variance = at(&reference.variance);
        let own_variance = at(&own.variance).max(variance * f64::from(reference.spp) / f64::from(own.spp));
        let variance = variance + own_variance + rounding * rounding;
        let difference = value - expected;
        let z = if difference == 0.0 { 0.0 } else { difference / variance.max(1e-12).sqrt() };
        squares += z * z;
        outliers += usize::from(z.abs() > 4.0);
        sums[i % 3][0] += value;
        sums[i % 3][1] += expected;
        sums[i % 3][2] += variance;
    }
    let count = (3 * size.0 * size.1) as f64;
    let ratio = |[value, expected, _]: [f64; 3]| if value == expected { 1.0 } else { value / expected };
    let within = |s: &[f64; 3]| (s[0] - s[1]).abs() <= MEAN_TOLERANCE * s[1] + 4.0 * s[2].sqrt();
    let outliers = outliers as f64 / count;
    let passed = sums.iter().all(within) && outliers <= OUTLIER_TOLERANCE;
    Ok(Verdict { mean_ratio: sums.map(ratio), z_rms: (squares / count).sqrt(), outliers, passed })
}
