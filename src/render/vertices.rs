//! What paths meet and choose at a vertex.

use crate::math::lanes::{Bits, Lanes, Lanes3, Mask};
use crate::scene::packet::{Evals, Lights, Materials, Scatters, Surfaces};

/// Sixteen vertices of as many paths.
#[derive(Clone)]
pub struct Vertices {
    /// Which of the paths have hit a surface that they may scatter at.
    pub hit: Mask,
    /// Numbers of the paths' samples in the wave.
    pub id: Bits,
    /// The surfaces.
    pub surfaces: Surfaces,
    /// Their materials.
    pub materials: Materials,
    /// f cos / pdf of everything before, with the chances of survival taken off.
    pub throughput: Lanes3,
    /// Which are lit by a visible point of an emitter that was chosen.
    pub lit: Mask,
    /// The points.
    pub light: Light,
    /// Which are gone on from.
    pub scattered: Mask,
    /// The directions.
    pub scatters: Scatters,
    /// Chances of having survived Russian roulette after them.
    pub survival: Lanes,
    /// Places of the paths at the next vertices.
    pub next: Bits,
    /// Which lead to an emitter.
    pub emits: Mask,
    /// What is hit there.
    pub emission: Emission,
}

/// Points on emitters chosen at vertices, seen from there.
#[derive(Clone)]
pub struct Light {
    /// The points.
    pub points: Lights,
    /// Radiance they send.
    pub radiance: Lanes3,
    /// Local directions towards them.
    pub wo: Lanes3,
    /// Scattering from them, and the densities of running into them.
    pub evals: Evals,
    /// Densities of choosing the points, per solid angle.
    pub pdf: Lanes,
}

/// Emitters that paths have run into by scattering.
#[derive(Clone)]
pub struct Emission {
    /// The points that were hit.
    pub points: Lights,
    /// Radiance they send back.
    pub radiance: Lanes3,
    /// Densities with which they would have been chosen; 0 after a delta lobe.
    pub light_pdf: Lanes,
}

impl Default for Vertices {
    fn default() -> Self {
        let (zero, zero3) = (Lanes::ZERO, Lanes3::ZERO);
        let points = Lights::default();
        Self {
            hit: Mask::NONE,
            id: Bits::ZERO,
            surfaces: Surfaces::default(),
            materials: Materials::default(),
            throughput: zero3,
            lit: Mask::NONE,
            light: Light { points: points.clone(), radiance: zero3, wo: zero3, evals: Evals::default(), pdf: zero },
            scattered: Mask::NONE,
            scatters: Scatters::default(),
            survival: zero,
            next: Bits::ZERO,
            emits: Mask::NONE,
            emission: Emission { points, radiance: zero3, light_pdf: zero },
        }
    }
}
