//! Closures: how surfaces scatter light, with everything that textures decide looked up. Sixteen of a packet and a single
//! one are evaluated by the same code.
//!
//! A closure is one of a few [`Kind`]s of lobes with its parameters, on one side of the surface or on both, under a
//! perturbed normal or not, with holes or without. Directions are local and point away from the surface.

mod conductor;
mod dielectric;
mod diffuse;
pub mod facets;
mod lobes;
mod parameter;
mod perturbation;
mod plastic;
mod principled;
mod sample;
mod scatter;
mod terms;
mod thin;

pub use self::conductor::{Conductor, RoughConductor};
pub use self::dielectric::{Dielectric, RoughDielectric};
pub use self::diffuse::Diffuse;
pub use self::lobes::visible_facets;
use self::lobes::{AllLobes, Lobes};
use self::parameter::parameters;
pub use self::perturbation::Perturbation;
pub use self::plastic::{Plastic, RoughPlastic};
pub use self::principled::Principled;
pub use self::sample::{BsdfSample, Delta, Eval, Lobe};
pub use self::scatter::{Deltas, Draws, Evals, Numbers, Proposals, Scatters};
pub use self::thin::PrincipledThin;
use crate::math::lanes::{Bits, LANES, Lanes, Lanes3, Mask};
use crate::math::{Rgb, Vec2, Vec3, warp};
use crate::scene::packet::Frames;

/// Kinds of lobes that closures have.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum Kind {
    /// None: the material is evaluated by its trait.
    None,
    /// [`Diffuse`].
    Diffuse,
    /// [`Conductor`].
    Conductor,
    /// [`RoughConductor`].
    RoughConductor,
    /// [`Dielectric`].
    Dielectric,
    /// [`RoughDielectric`].
    RoughDielectric,
    /// [`Plastic`].
    Plastic,
    /// [`RoughPlastic`].
    RoughPlastic,
    /// [`Principled`].
    Principled,
    /// [`PrincipledThin`].
    PrincipledThin,
}

/// Number of [`Kind`]s.
pub const KINDS: usize = Kind::PrincipledThin as usize + 1;

/// Largest number of parameters.
const PARAMETERS: usize = 18;

/// Closures of several surfaces.
#[derive(Clone, Copy, Debug)]
#[repr(align(64))]
pub struct Closures<const N: usize = LANES> {
    kind: Bits<N>,
    /// Number of parameters in use.
    count: Bits<N>,
    /// Smallest roughness of the smooth lobes, infinite for diffuse ones; negative without smooth lobes.
    pub roughness: Lanes<N>,
    /// Lanes that look the same from behind.
    two_sided: Mask<N>,
    /// Opaque shares; light goes straight through the rest.
    opacity: Lanes<N>,
    perturbation: Perturbation<N>,
    parameters: [Lanes<N>; PARAMETERS],
}

/// Way from the directions of a surface to those that its lobes see.
struct Side<const N: usize> {
    /// Lanes that are seen from behind.
    behind: Mask<N>,
    /// Lanes under a perturbed normal.
    perturbed: Mask<N>,
    /// The perturbed frames.
    frame: Frames<N>,
}

/// A single closure.
pub type Closure = Closures<1>;

impl<const N: usize> Default for Closures<N> {
    fn default() -> Self {
        Self {
            kind: Bits::ZERO,
            count: Bits::ZERO,
            roughness: Lanes::ZERO,
            two_sided: Mask::NONE,
            opacity: Lanes::ONE,
            perturbation: Perturbation::NONE,
            parameters: [Lanes::ZERO; PARAMETERS],
        }
    }
}

impl Closure {
    fn new(kind: Kind, parameters: &[Lanes<1>], roughness: Option<f32>) -> Self {
        let mut closure = Self {
            kind: Bits([kind as u32]),
            count: Bits([parameters.len() as u32]),
            roughness: Lanes([roughness.unwrap_or(-1.0)]),
            ..Self::default()
        };
        closure.parameters[..parameters.len()].copy_from_slice(parameters);
        closure
    }

    /// [`Closures::sample`] of a single closure.
    pub fn sample_one(&self, wi: Vec3, lobe: f32, u: Vec2) -> Option<BsdfSample> {
        let numbers = (Lanes([lobe]), [Lanes([u.x]), Lanes([u.y])]);
        let (scatters, found) = self.sample(Lanes3::splat(wi), numbers, Mask([!0]));
        found.get(0).then(|| scatters.get(0))
    }

    /// [`Closures::eval`] of a single closure.
    pub fn eval_one(&self, wi: Vec3, wo: Vec3) -> Eval {
        self.eval(Lanes3::splat(wi), Lanes3::splat(wo), Mask([!0])).get(0)
    }

    /// [`Closures::deltas`] of a single closure.
    pub fn delta(&self, wi: Vec3, lobe: Lobe) -> Option<Delta> {
        self.deltas(Lanes3::splat(wi), lobe, Mask([!0])).get(0)
    }

    /// Number of the [`Kind`] of its lobes.
    pub fn kind(&self) -> usize {
        self.kind.0[0] as usize
    }

    /// Smallest roughness of the smooth lobes, if there are such.
    pub fn roughness_of_one(&self) -> Option<f32> {
        Some(self.roughness.0[0]).filter(|&roughness| roughness >= 0.0)
    }

    /// The same on both sides of the surface; `None` with holes.
    pub fn on_both_sides(self) -> Option<Self> {
        if self.opacity == Lanes::ONE { Some(Self { two_sided: Mask([!0]), ..self }) } else { None }
    }

    /// The same under a perturbed normal; `None` if it is perturbed, has holes, or has two sides already.
    pub fn under(self, perturbation: Perturbation<1>) -> Option<Self> {
        let plain = self.opacity == Lanes::ONE && !(self.two_sided | self.perturbation.lanes).any();
        if plain { Some(Self { perturbation, ..self }) } else { None }
    }

    /// The same with a share of holes; `None` if it has holes already.
    pub fn with_holes(self, opacity: f32) -> Option<Self> {
        let roughness = if opacity > 0.0 { self.roughness } else { Lanes([-1.0]) };
        if self.opacity == Lanes::ONE { Some(Self { opacity: Lanes([opacity]), roughness, ..self }) } else { None }
    }
}

impl<const N: usize> Closures<N> {
    /// Copies a lane of other closures.
    #[inline(always)]
    pub fn copy<const M: usize>(&mut self, to: usize, from: &Closures<M>, lane: usize) {
        self.kind.0[to] = from.kind.0[lane];
        self.count.0[to] = from.count.0[lane];
        self.roughness.0[to] = from.roughness.0[lane];
        self.two_sided.0[to] = from.two_sided.0[lane];
        self.opacity.0[to] = from.opacity.0[lane];
        self.perturbation.copy(to, &from.perturbation, lane);
        let count = from.count.0[lane] as usize;
        for (to_lanes, from_lanes) in self.parameters.iter_mut().zip(&from.parameters).take(count) {
            to_lanes.0[to] = from_lanes.0[lane];
        }
    }

    /// [`Lanes::copy_beside`].
    #[inline(always)]
    pub fn copy_beside<const STEP: i32>(&mut self, from: &Self) {
        self.kind.copy_beside::<STEP>(&from.kind);
        self.count.copy_beside::<STEP>(&from.count);
        self.roughness.copy_beside::<STEP>(&from.roughness);
        self.two_sided.copy_beside::<STEP>(&from.two_sided);
        self.opacity.copy_beside::<STEP>(&from.opacity);
        self.perturbation.copy_beside::<STEP>(&from.perturbation);
        let most = from.count.0.iter().fold(0, |most, &count| most.max(count)) as usize;
        for (to, from) in self.parameters.iter_mut().zip(&from.parameters).take(most) {
            to.copy_beside::<STEP>(from);
        }
    }

    /// A lane whose material has no closure.
    pub fn set_none(&mut self, lane: usize, roughness: Option<f32>) {
        self.kind.0[lane] = Kind::None as u32;
        self.roughness.0[lane] = roughness.unwrap_or(-1.0);
    }

    /// Lanes whose material has a closure.
    #[inline(always)]
    pub fn exist(&self) -> Mask<N> {
        !self.are(Kind::None)
    }

    /// Lanes with a diffuse lobe that is neither perturbed nor has holes.
    #[inline(always)]
    pub fn plainly_diffuse(&self) -> Mask<N> {
        self.are(Kind::Diffuse) & !(self.opacity.less(Lanes::ONE) | self.perturbation.lanes)
    }

    /// Reflectance of a lane, if its lobes are [`Diffuse`].
    #[inline(always)]
    pub fn reflectance(&self, lane: usize) -> Option<Rgb> {
        self.are(Kind::Diffuse).get(lane).then(|| Diffuse::load(self).reflectance.get(lane))
    }

    #[inline(always)]
    fn are(&self, kind: Kind) -> Mask<N> {
        self.kind.equal(kind as u32)
    }

    /// Lanes that are seen from behind.
    #[inline(always)]
    fn behind(&self, wi: Lanes3<N>) -> Mask<N> {
        self.two_sided & wi.z.less(Lanes::ZERO)
    }

    /// [`Closures::eval`] where all active lanes are plainly diffuse.
    #[inline(always)]
    pub fn eval_diffuse(&self, wi: Lanes3<N>, wo: Lanes3<N>, active: Mask<N>) -> Evals<N> {
        let behind = self.behind(wi);
        Diffuse::load(self).eval(wi.mirror(behind), wo.mirror(behind)).only(active)
    }

    /// [`Closures::sample`] where all active lanes are plainly diffuse.
    #[inline(always)]
    pub fn sample_diffuse(&self, wi: Lanes3<N>, u: [Lanes<N>; 2], active: Mask<N>) -> Draws<N> {
        let behind = self.behind(wi);
        let wo = warp::cosine_hemisphere_lanes(u);
        let found = active & wi.mirror(behind).z.greater(Lanes::ZERO) & wo.z.greater(Lanes::ZERO);
        let pdf = warp::cosine_hemisphere_pdfs(wo.z);
        let weight = Diffuse::load(self).reflectance;
        (Scatters { weight, pdf, ..Scatters::towards(wo.mirror(behind), Lanes::ONE) }, found)
    }
}

impl<const N: usize> Closures<N>
where
    Self: AllLobes<N>,
{
    /// Evaluates the smooth lobes of the active lanes; the values of the others are zero.
    #[inline(always)]
    pub fn eval(&self, wi: Lanes3<N>, wo: Lanes3<N>, active: Mask<N>) -> Evals<N> {
        let behind = self.behind(wi);
        let (wi, wo) = (wi.mirror(behind), wo.mirror(behind));
        let perturbed = active & self.perturbation.lanes;
        if !perturbed.any() {
            let evals = self.eval_lobes([wi, wo], active);
            return Evals { value: evals.value * self.opacity, pdf: evals.pdf * self.opacity };
        }
        let frame = self.perturbation.frame(wi);
        let inside = (frame.to_local(wi), frame.to_local(wo));
        let same_side = !perturbed | (wo.z * inside.1.z).greater(Lanes::ZERO);
        let (wi, wo_inside) = (perturbed.select3(inside.0, wi), perturbed.select3(inside.1, wo));
        let evals = self.eval_lobes([wi, wo_inside], active & same_side);
        let share = perturbed.select(self.perturbation.unshadowed(wo), Lanes::ONE) * self.opacity;
        Evals { value: evals.value * share, pdf: evals.pdf * self.opacity }
    }

    /// Directions as the lobes of the active lanes see them, and the way back.
    #[inline(always)]
    fn enter(&self, from: Lanes3<N>, active: Mask<N>) -> (Lanes3<N>, Side<N>) {
        let behind = self.behind(from);
        let wi = from.mirror(behind);
        let perturbed = active & self.perturbation.lanes;
        let frame = self.perturbation.frame(wi);
        let seen = if perturbed.any() { perturbed.select3(frame.to_local(wi), wi) } else { wi };
        (seen, Side { behind, perturbed, frame })
    }

    /// Samples directions for the active lanes; returns the lanes that have one.
    #[inline(always)]
    pub fn sample(&self, from: Lanes3<N>, (lobe, u): (Lanes<N>, [Lanes<N>; 2]), active: Mask<N>) -> Draws<N> {
        let (wi, Side { behind, perturbed, frame }) = self.enter(from, active);
        let hole = active & !lobe.less(self.opacity);
        let (mut scatters, mut found) = self.sample_lobes(wi, [lobe / self.opacity, u[0], u[1]], active & !hole);
        if perturbed.any() {
            let wo = frame.to_world(scatters.wo);
            let same_side = (wo.z * scatters.wo.z).greater(Lanes::ZERO);
            found = found & (!perturbed | same_side);
            scatters.wo = perturbed.select3(wo, scatters.wo);
            let share = perturbed.select(self.perturbation.unshadowed(wo), Lanes::ONE);
            scatters.weight = scatters.weight * share;
        }
        scatters.wo = scatters.wo.mirror(behind);
        scatters.pdf = scatters.pdf * self.opacity;
        if hole.any() {
            scatters = scatters.or_straight_on(from, Lanes::ONE - self.opacity, hole);
        }
        (scatters, found | hole)
    }

    /// Scattering by a delta lobe in the active lanes; of others anything.
    #[inline(always)]
    pub fn deltas(&self, from: Lanes3<N>, lobe: Lobe, active: Mask<N>) -> Deltas<N> {
        if lobe == Lobe::Null {
            let hole = Deltas { wo: -from, value: Lanes3::ONE, probability: Lanes::ONE };
            return hole.scaled(Lanes::ONE - self.opacity);
        }
        let (wi, Side { behind, perturbed, frame }) = self.enter(from, active);
        let mut deltas = self.delta_lobes(wi, lobe, active).scaled(self.opacity);
        if perturbed.any() {
            let wo = frame.to_world(deltas.wo);
            let other_side = perturbed & !(wo.z * deltas.wo.z).greater(Lanes::ZERO);
            let share = perturbed.select(self.perturbation.unshadowed(wo), Lanes::ONE);
            deltas.probability = other_side.select(Lanes::ZERO, deltas.probability);
            (deltas.wo, deltas.value) = (perturbed.select3(wo, deltas.wo), deltas.value * share);
        }
        Deltas { wo: deltas.wo.mirror(behind), ..deltas }
    }
}
