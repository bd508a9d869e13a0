//! Shading normals that a texture perturbs.

use crate::math::lanes::{LANES, Lanes, Lanes3, Mask};
use crate::math::{Frame, Vec3};
use crate::scene::packet::Frames;

/// Perturbed normals, in the shading frames of their surfaces.
#[derive(Clone, Copy, Debug)]
pub struct Perturbation<const N: usize = LANES> {
    /// Lanes whose normal is perturbed.
    pub lanes: Mask<N>,
    /// Lanes whose normal is mirrored where it faces away from the viewer.
    flips: Mask<N>,
    /// Lanes in which directions that the bumps would shadow are attenuated, where light would otherwise be cut off.
    shadows: Mask<N>,
    normal: Lanes3<N>,
}

impl<const N: usize> Perturbation<N> {
    /// No normal is perturbed.
    pub const NONE: Self = Self { lanes: Mask::NONE, flips: Mask::NONE, shadows: Mask::NONE, normal: Lanes3::UP };

    /// Copies a lane of others.
    #[inline(always)]
    pub fn copy<const M: usize>(&mut self, to: usize, from: &Perturbation<M>, lane: usize) {
        self.lanes.0[to] = from.lanes.0[lane];
        if from.lanes.get(lane) {
            (self.flips.0[to], self.shadows.0[to]) = (from.flips.0[lane], from.shadows.0[lane]);
            self.normal.set(to, from.normal.get(lane));
        }
    }

    /// [`Lanes::copy_beside`].
    #[inline(always)]
    pub fn copy_beside<const STEP: i32>(&mut self, from: &Self) {
        self.lanes.copy_beside::<STEP>(&from.lanes);
        if from.lanes.any() {
            self.flips.copy_beside::<STEP>(&from.flips);
            self.shadows.copy_beside::<STEP>(&from.shadows);
            self.normal.copy_beside::<STEP>(&from.normal);
        }
    }

    /// The perturbed frames.
    #[inline(always)]
    pub fn frame(&self, wi: Lanes3<N>) -> Frames<N> {
        let n = self.normal;
        let away = self.flips & !(wi.z * wi.dot(n)).greater(Lanes::ZERO);
        let n = Lanes3 { x: away.select(-n.x, n.x), y: away.select(-n.y, n.y), z: n.z };
        Frames::along(n, Lanes3::splat(Vec3::X))
    }

    /// Shares of light that the bumps let pass (Conty et al. 2017).
    #[inline(always)]
    pub fn unshadowed(&self, wo: Lanes3<N>) -> Lanes<N> {
        let (one, least) = (Lanes::ONE, Lanes::splat(1e-12));
        let tan2 = |w: Lanes3<N>| (w.x * w.x + w.y * w.y) / (w.z * w.z).max(least);
        let alpha2 = self.shadows.select((Lanes::splat(0.125) * tan2(self.normal)).min(one), Lanes::ZERO);
        Lanes::splat(2.0) / (one + (one + alpha2 * tan2(wo)).sqrt())
    }
}

impl Perturbation<1> {
    /// A perturbed normal.
    pub fn new(normal: Vec3, flips: bool, shadows: bool) -> Self {
        let mask = |holds: bool| Mask([if holds { !0 } else { 0 }]);
        Self { lanes: mask(true), flips: mask(flips), shadows: mask(shadows), normal: Lanes3::splat(normal) }
    }

    /// The perturbed frame.
    pub fn frame_of(&self, wi: Vec3) -> Frame {
        self.frame(Lanes3::splat(wi)).get(0)
    }

    /// The share of light that the bumps let pass.
    pub fn unshadowed_of(&self, wo: Vec3) -> f32 {
        self.unshadowed(Lanes3::splat(wo)).0[0]
    }
}
