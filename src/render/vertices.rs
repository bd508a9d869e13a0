//! Vertices of sixteen paths: surface, next-event sample and scattered direction.

use crate::math::lanes::{Bits, LANES, Lanes, Lanes3, Mask};
use crate::scene::closure::{Evals, Scatters};
use crate::scene::packet::{Lights, Materials, Surfaces};

/// Sixteen vertices of as many paths.
#[derive(Clone)]
#[repr(align(64))]
pub struct Vertices {
    /// Lanes that have hit a surface that they may scatter at.
    pub hit: Mask,
    /// Indices of the samples in the wave.
    pub id: Bits,
    /// The surfaces.
    pub surfaces: Surfaces,
    /// Materials of the surfaces.
    pub materials: Materials,
    /// Throughput up to the vertices: product of f cos / pdf, divided by the survival probabilities.
    pub throughput: Lanes3,
    /// Lanes whose next-event sample is visible and non-zero.
    pub lit: Mask,
    /// The next-event samples.
    pub light: Light,
    /// Lanes whose path continues.
    pub scattered: Mask,
    /// Lanes that the surface lets pass straight through.
    pub passed: Mask,
    /// Sampled directions.
    pub scatters: Scatters,
    /// Survival probabilities of Russian roulette after the vertices.
    pub survival: Lanes,
    /// Indices of the next vertices.
    pub next: Bits,
    /// Lanes whose next segment hits an emitter.
    pub hits_emitter: Mask,
    /// Emitters at the ends of these segments.
    pub emission: Emission,
}

/// Emitter points sampled by next-event estimation.
#[derive(Clone)]
#[repr(align(64))]
pub struct Light {
    /// The points.
    pub points: Lights,
    /// Radiance that the points send to the vertices.
    pub radiance: Lanes3,
    /// Local directions towards the points.
    pub wo: Lanes3,
    /// BSDF values, and densities of hitting the points by scattering.
    pub evals: Evals,
    /// Densities per solid angle of sampling the points.
    pub pdf: Lanes,
}

/// Emitters that paths have hit by scattering.
#[derive(Clone)]
#[repr(align(64))]
pub struct Emission {
    /// The points that were hit.
    pub points: Lights,
    /// Radiance that the points send back.
    pub radiance: Lanes3,
    /// Densities with which next-event estimation would have sampled the points; 0 after a delta lobe.
    pub light_pdf: Lanes,
}

impl Vertices {
    /// Lanes whose path goes on to one of the vertices of the next depth, with packet and lane there.
    #[inline(always)]
    pub fn followed_by(&self, below: &[Self]) -> impl Iterator<Item = (usize, usize, usize)> {
        (self.hit & self.scattered).lanes().filter_map(|lane| {
            let (packet, at) = (self.next.0[lane] as usize / LANES, self.next.0[lane] as usize % LANES);
            below.get(packet).filter(|there| there.hit.get(at)).map(|_| (lane, packet, at))
        })
    }
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
            light: Light { points: points.clone(), radiance: zero3, wo: zero3, evals: Evals::ZERO, pdf: zero },
            scattered: Mask::NONE,
            passed: Mask::NONE,
            scatters: Scatters::default(),
            survival: zero,
            next: Bits::ZERO,
            hits_emitter: Mask::NONE,
            emission: Emission { points, radiance: zero3, light_pdf: zero },
        }
    }
}
