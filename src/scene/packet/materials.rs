//! Scattering at sixteen surfaces.

use super::Surfaces;
use crate::math::lanes::{Lanes, Lanes3, Mask};
use crate::math::{Rgb, vec2};
use crate::scene::Scene;
use crate::scene::closure::{Closures, Deltas, Draws, Evals, Lobe, Scatters};

/// Materials of sixteen surfaces.
#[derive(Clone, Debug, Default)]
pub struct Materials {
    closures: Closures,
}

impl Materials {
    /// Evaluates the materials of the active surfaces.
    pub fn evaluate(&mut self, scene: &Scene, surfaces: &Surfaces, active: Mask) {
        self.closures.roughness = Lanes::splat(f32::INFINITY);
        // Images are waited for together, not one after the other.
        for lane in active.lanes() {
            let number = surfaces.shape.0[lane] as usize;
            if scene.shape_infos[number].images {
                scene.shapes[number].bsdf.prefetch(&surfaces.at(lane));
            }
        }
        for lane in active.lanes() {
            let number = surfaces.shape.0[lane] as usize;
            let info = &scene.shape_infos[number];
            if let Some(closure) = &info.closure {
                self.closures.copy(lane, closure, 0);
                continue;
            }
            let bsdf = &scene.shapes[number].bsdf;
            let closure = if info.closes { bsdf.closure(&surfaces.at(lane), &|| surfaces.get(lane)) } else { None };
            match closure {
                Some(closure) => self.closures.copy(lane, &closure, 0),
                None => self.closures.set_none(lane, bsdf.roughness(&surfaces.get(lane))),
            }
        }
    }

    /// Copies one lane of other materials.
    #[inline(always)]
    pub fn copy(&mut self, to: usize, from: &Self, lane: usize) {
        self.closures.copy(to, &from.closures, lane);
    }

    /// [`Lanes::copy_beside`].
    #[inline(always)]
    pub fn copy_beside<const STEP: i32>(&mut self, from: &Self) {
        self.closures.copy_beside::<STEP>(&from.closures);
    }

    /// Smallest roughness of the smooth lobes, infinite for diffuse ones; negative without smooth lobes.
    #[inline(always)]
    pub fn roughness(&self) -> Lanes {
        self.closures.roughness
    }

    /// Lanes whose material has a smooth lobe.
    #[inline(always)]
    pub fn smooth(&self) -> Mask {
        !self.closures.roughness.less(Lanes::ZERO)
    }

    /// Albedo of one lane.
    pub fn albedo(&self, scene: &Scene, surfaces: &Surfaces, lane: usize) -> Rgb {
        if let Some(reflectance) = self.closures.reflectance(lane) {
            return reflectance.clamp(Rgb::ZERO, Rgb::ONE);
        }
        let surface = surfaces.get(lane);
        scene.bsdf(&surface).albedo(&surface)
    }

    /// Evaluates the smooth lobes of the active lanes; the values of the others are zero.
    #[inline(always)]
    pub fn eval(&self, scene: &Scene, surfaces: &Surfaces, (wi, wo): (Lanes3, Lanes3), active: Mask) -> Evals {
        if !(active & !self.closures.plainly_diffuse()).any() {
            return self.closures.eval_diffuse(wi, wo, active);
        }
        let mut evals = eval(&self.closures, (wi, wo), active & self.closures.exist());
        for lane in (active & !self.closures.exist()).lanes() {
            let surface = surfaces.get(lane);
            evals.set(lane, scene.bsdf(&surface).eval(&surface, wi.get(lane), wo.get(lane)));
        }
        evals
    }

    /// Scattering of the active lanes by a delta lobe; none in the others.
    pub fn deltas(&self, scene: &Scene, surfaces: &Surfaces, (wi, lobe): (Lanes3, Lobe), active: Mask) -> Deltas {
        let closed = active & self.closures.exist();
        let mut deltas = Deltas::NONE;
        if closed.any() {
            deltas = deltas.replaced(&self.closures.deltas(wi, lobe, closed), closed);
        }
        for lane in (active & !self.closures.exist()).lanes() {
            let surface = surfaces.get(lane);
            deltas.set(lane, scene.bsdf(&surface).delta(&surface, wi.get(lane), lobe));
        }
        deltas
    }

    /// Lanes whose material is a closure, which has one delta lobe of a kind at most.
    #[inline(always)]
    pub fn are_closures(&self) -> Mask {
        self.closures.exist()
    }

    /// Samples directions for the active lanes; returns the lanes that have one.
    #[inline(always)]
    pub fn sample(
        &self,
        scene: &Scene,
        surfaces: &Surfaces,
        (lobe, [u, v]): (Lanes, [Lanes; 2]),
        active: Mask,
        to: &mut Scatters,
    ) -> Mask {
        let mut found;
        if !(active & !self.closures.plainly_diffuse()).any() {
            (*to, found) = self.closures.sample_diffuse(surfaces.wi, [u, v], active);
            return found;
        }
        (*to, found) = sample(&self.closures, surfaces.wi, (lobe, [u, v]), active & self.closures.exist());
        for lane in (active & !self.closures.exist()).lanes() {
            let surface = surfaces.get(lane);
            let numbers = vec2(u.0[lane], v.0[lane]);
            if let Some(sample) = scene.bsdf(&surface).sample(&surface, surface.wi, lobe.0[lane], numbers) {
                to.set(lane, &sample);
                found.set(lane, true);
            }
        }
        found
    }
}

vectorized! {
    /// [`Closures::eval`] in the widest vectors that there are.
    fn eval(closures: &Closures, (wi, wo): (Lanes3, Lanes3), active: Mask) -> Evals {
        closures.eval(wi, wo, active)
    }
}

vectorized! {
    /// [`Closures::sample`] in the widest vectors that there are.
    fn sample(closures: &Closures, wi: Lanes3, numbers: (Lanes, [Lanes; 2]), active: Mask) -> Draws {
        closures.sample(wi, numbers, active)
    }
}
