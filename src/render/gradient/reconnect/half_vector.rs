//! Half-vector copies: the offset leaves its vertex as the base path leaves its own, by the same delta lobe, or mirrored or
//! refracted about the same local half vector.

use super::offsets::SurfacePacket;
use crate::math::fresnel;
use crate::math::lanes::{LANES, Lanes, Lanes3, Mask};
use crate::scene::Scene;
use crate::scene::bsdf::Lobe;
use crate::scene::closure::Evals;
use crate::scene::packet::{Materials, Surfaces};

/// How sixteen base paths leave their vertices.
pub struct Departures<'a> {
    /// The vertices.
    pub surfaces: &'a Surfaces,
    /// Their materials.
    pub materials: &'a Materials,
    /// Lanes of the vertices, one for each of the active lanes of everything below.
    pub lanes: &'a [usize],
    /// Local directions that the paths come from.
    pub wi: Lanes3,
    /// Local directions that they leave by.
    pub wo: Lanes3,
    /// Lobes that they leave by.
    pub lobes: [Lobe; LANES],
}

/// Directions that sixteen offsets leave their vertices by.
#[repr(align(64))]
pub struct Copies {
    /// Lanes whose offset's material scatters so.
    pub possible: Mask,
    /// Local directions.
    pub wo: Lanes3,
    /// f cos, or the factor of a delta lobe, times dω' / dω, which is 1 for delta lobes.
    pub value: Lanes3,
    /// Density per solid angle, or probability of a delta lobe, times dω' / dω.
    pub pdf: Lanes,
    /// dω' / dω.
    pub jacobian: Lanes,
    /// Lanes of delta lobes.
    pub delta: Mask,
}

impl Copies {
    /// The directions by which offsets leave their vertices when their base paths leave theirs so.
    pub fn new(scene: &Scene, base: &Departures, offset: &SurfacePacket) -> Self {
        let active = Mask::first(base.lanes.len());
        let mut delta = Mask::NONE;
        active.lanes().for_each(|lane| delta.set(lane, base.lobes[lane].is_delta()));
        let mut copies = Self::of_smooth(scene, base, offset, active & !delta);
        if !delta.any() {
            return copies;
        }
        copies.delta = delta;
        for lobe in [Lobe::DeltaReflect, Lobe::DeltaTransmit, Lobe::Null] {
            let mut lanes = Mask::NONE;
            delta.lanes().for_each(|lane| lanes.set(lane, base.lobes[lane] == lobe));
            if lanes.any() {
                copies.add_deltas(scene, (base, lobe), offset, lanes);
            }
        }
        copies
    }

    /// Copies of directions of smooth lobes.
    fn of_smooth(scene: &Scene, base: &Departures, offset: &SurfacePacket, smooth: Mask) -> Self {
        let SurfacePacket { surfaces, materials } = offset;
        let mut directions = mirrored(base, surfaces);
        let through = smooth & !(base.wi.z * base.wo.z).greater(Lanes::ZERO);
        if through.any() {
            let (eta, alike) = indices(scene, base, surfaces, through);
            let refracted = refract(base.wi, base.wo, surfaces.wi, eta);
            let (wo, jacobian, possible) = directions;
            directions = (
                through.select3(refracted.0, wo),
                through.select(refracted.1, jacobian),
                (possible & !through) | (refracted.2 & alike),
            );
        }
        let (wo, jacobian, possible) = directions;
        let possible = possible & smooth;
        let Evals { value, pdf } =
            if possible.any() { materials.eval(scene, surfaces, (surfaces.wi, wo), possible) } else { Evals::ZERO };
        let possible = possible & value.nonzero() & pdf.greater(Lanes::ZERO);
        Self { possible, wo, value: value * jacobian, pdf: pdf * jacobian, jacobian, delta: Mask::NONE }
    }

    /// Adds the lanes that leave by a delta lobe.
    fn add_deltas(&mut self, scene: &Scene, (base, lobe): (&Departures, Lobe), offset: &SurfacePacket, lanes: Mask) {
        let SurfacePacket { surfaces, materials } = offset;
        let deltas = materials.deltas(scene, surfaces, (surfaces.wi, lobe), lanes);
        let mut found = lanes & deltas.probability.greater(Lanes::ZERO);
        for lane in found.lanes() {
            // If the base's material has several lobes of this kind (a blend), the inverse shift fails, so this one has to.
            let from = base.lanes[lane];
            if !base.materials.are_closures().get(from) {
                let surface = base.surfaces.get(from);
                found.set(lane, scene.bsdf(&surface).delta(&surface, surface.wi, lobe).is_some());
            }
        }
        self.possible = self.possible | found;
        self.wo = lanes.select3(deltas.wo, self.wo);
        self.value = lanes.select3(deltas.value, self.value);
        self.pdf = lanes.select(deltas.probability, self.pdf);
        self.jacobian = lanes.select(Lanes::ONE, self.jacobian);
    }
}

vectorized! {
    fn mirrored(base: &Departures, offset: &Surfaces) -> (Lanes3, Lanes, Mask) {
        reflect(base.wi, base.wo, offset.wi)
    }
}

/// Indices of refraction on the sides that some base paths go to over those on the sides that they come from, and the lanes in
/// which the offset's material has the same: the inverse shift refracts at the base's.
fn indices(scene: &Scene, base: &Departures, offset: &Surfaces, lanes: Mask) -> (Lanes, Mask) {
    let (mut eta, mut alike) = (Lanes::ONE, Mask::NONE);
    let index = |surfaces: &Surfaces, lane: usize| scene.shapes()[surfaces.shape.0[lane] as usize].bsdf.refraction();
    for lane in lanes.lanes() {
        let (there, here) = (index(offset, lane), index(base.surfaces, base.lanes[lane]));
        if let Some(index) = there.filter(|_| there == here) {
            alike.set(lane, true);
            eta.0[lane] = if base.wi.z.0[lane] > 0.0 { index } else { 1.0 / index };
        }
    }
    (eta, alike)
}

/// Mirrors `offset_wi` about the half vectors of `wi` and `wo`; with the Jacobians dω' / dω. The mask leaves out the lanes where
/// either pair of directions is on different sides of the surface.
#[inline(always)]
pub fn reflect<const N: usize>(wi: Lanes3<N>, wo: Lanes3<N>, offset_wi: Lanes3<N>) -> (Lanes3<N>, Lanes<N>, Mask<N>) {
    let h = (wi + wo).normalize_or(Lanes3::ZERO);
    let offset_wo = fresnel::lanes::reflect_about(offset_wi, h);
    let jacobian = offset_wo.dot(h).abs() / wo.dot(h).abs();
    let same_side = (wi.z * wo.z).greater(Lanes::ZERO) & (offset_wi.z * offset_wo.z).greater(Lanes::ZERO);
    (offset_wo, jacobian, same_side & jacobian.greater(Lanes::ZERO) & jacobian.finite())
}

/// Refracts `offset_wi` at the half vectors that refract `wi` into `wo`, with the changes of solid angle dω' / dω. `eta` is
/// the index of refraction on the side of `wo` over that on the side of `wi`. The mask leaves out total reflection, and lanes in
/// which the sides are not the same.
#[inline(always)]
pub fn refract<const N: usize>(
    wi: Lanes3<N>,
    wo: Lanes3<N>,
    offset_wi: Lanes3<N>,
    eta: Lanes<N>,
) -> (Lanes3<N>, Lanes<N>, Mask<N>) {
    let (zero, one) = (Lanes::ZERO, Lanes::ONE);
    let sum = wi + wo * eta;
    let h = sum.normalize_or(Lanes3::ZERO);
    let cos_i = offset_wi.dot(h);
    let cos_t = (one - (one - cos_i * cos_i) / (eta * eta)).max(zero).sqrt().copysign(cos_i);
    let offset_wo = (h * (cos_i / eta - cos_t) - offset_wi * (one / eta)).normalize_or(Lanes3::ZERO);
    let offset_sum = offset_wi + offset_wo * eta;
    let growth = offset_sum.dot(offset_sum) / sum.dot(sum);
    let jacobian = growth * (wo.dot(h) / offset_wo.dot(h)).abs();
    let same_sides = (wi.z * offset_wi.z).greater(zero) & (wo.z * offset_wo.z).greater(zero) & (wi.z * wo.z).less(zero);
    let refracts = (wi.dot(h) * wo.dot(h)).less(zero) & cos_t.abs().greater(zero) & (cos_i * wi.dot(h)).greater(zero);
    (offset_wo, jacobian, same_sides & refracts & jacobian.greater(zero) & jacobian.finite())
}
