//! Scattering at sixteen surfaces.

use std::f32::consts::{FRAC_1_PI, FRAC_PI_4};

use super::{ShapeInfo, Surfaces};
use crate::math::Rgb;
use crate::math::lanes::{Bits, Lanes, Lanes3, Mask};
use crate::math::vec2;
use crate::scene::Scene;
use crate::scene::bsdf::{BsdfSample, Eval, Lobe};

/// Materials of sixteen surfaces.
#[derive(Clone, Debug)]
pub struct Materials {
    /// Lanes whose material is a diffuse lobe and nothing else.
    lambert: Mask,
    two_sided: Mask,
    /// Reflectance of diffuse materials.
    color: Lanes3,
    /// Smallest roughness of the smooth lobes, infinite for diffuse ones; negative without smooth lobes.
    pub roughness: Lanes,
}

/// Smooth lobes evaluated for pairs of directions, as in [`Eval`].
#[derive(Clone, Copy, Debug)]
pub struct Evals {
    /// f |cos θo|.
    pub value: Lanes3,
    /// Density per solid angle.
    pub pdf: Lanes,
}

/// Sampled directions, as in [`BsdfSample`].
#[derive(Clone, Debug)]
pub struct Scatters {
    /// Outgoing directions.
    pub wo: Lanes3,
    /// f |cos θo| / pdf.
    pub weight: Lanes3,
    /// Densities.
    pub pdf: Lanes,
    /// Lobes, as positions in [`LOBES`].
    lobe: Bits,
    /// Relative indices of refraction.
    pub eta: Lanes,
}

/// Lobes by number; the smooth one is number 0.
const LOBES: [Lobe; 4] = [Lobe::Smooth, Lobe::DeltaReflect, Lobe::DeltaTransmit, Lobe::Null];

impl Default for Materials {
    fn default() -> Self {
        Self { lambert: Mask::NONE, two_sided: Mask::NONE, color: Lanes3::ZERO, roughness: Lanes::ZERO }
    }
}

impl Default for Evals {
    fn default() -> Self {
        Self { value: Lanes3::ZERO, pdf: Lanes::ZERO }
    }
}

impl Evals {
    fn set(&mut self, lane: usize, Eval { value, pdf }: Eval) {
        self.value.set(lane, value);
        self.pdf.0[lane] = pdf;
    }
}

impl Default for Scatters {
    fn default() -> Self {
        let zero = Lanes::ZERO;
        Self { wo: Lanes3::ZERO, weight: Lanes3::ZERO, pdf: zero, lobe: Bits::ZERO, eta: zero }
    }
}

impl Scatters {
    fn set(&mut self, lane: usize, sample: &BsdfSample) {
        self.wo.set(lane, sample.wo);
        self.weight.set(lane, sample.weight);
        self.pdf.0[lane] = sample.pdf;
        self.lobe.0[lane] = LOBES.iter().position(|&lobe| lobe == sample.lobe).unwrap_or_default() as u32;
        self.eta.0[lane] = sample.eta;
    }

    /// The sample of one lane.
    pub fn get(&self, lane: usize) -> BsdfSample {
        BsdfSample {
            wo: self.wo.get(lane),
            weight: self.weight.get(lane),
            pdf: self.pdf.0[lane],
            lobe: LOBES[self.lobe.0[lane] as usize],
            eta: self.eta.0[lane],
        }
    }

    /// Lanes that go straight through.
    #[inline(always)]
    pub fn pass(&self) -> Mask {
        self.lobe.equal(3)
    }

    /// Lanes whose direction is one of a smooth lobe.
    #[inline(always)]
    pub fn smooth(&self) -> Mask {
        self.lobe.equal(0)
    }
}

impl Materials {
    /// Evaluates the materials of the active surfaces.
    pub fn evaluate(&mut self, scene: &Scene, surfaces: &Surfaces, active: Mask) {
        (self.lambert, self.two_sided) = (Mask::NONE, Mask::NONE);
        self.roughness = Lanes::splat(f32::INFINITY);
        for lane in active.lanes() {
            let ShapeInfo { lambert, two_sided, color, texture, .. } =
                &scene.shape_infos[surfaces.shape.0[lane] as usize];
            if !lambert {
                let surface = surfaces.get(lane);
                self.roughness.0[lane] = scene.bsdf(&surface).roughness(&surface).unwrap_or(-1.0);
                continue;
            }
            self.lambert.set(lane, true);
            self.two_sided.set(lane, *two_sided);
            self.color.set(lane, texture.as_ref().map_or(*color, |texture| texture.color(&surfaces.at(lane))));
        }
    }

    /// Copies one lane of other materials.
    #[inline(always)]
    pub fn copy(&mut self, to: usize, from: &Self, lane: usize) {
        self.lambert.0[to] = from.lambert.0[lane];
        self.two_sided.0[to] = from.two_sided.0[lane];
        self.color.set(to, from.color.get(lane));
        self.roughness.0[to] = from.roughness.0[lane];
    }

    /// Lanes whose material has a smooth lobe.
    #[inline(always)]
    pub fn smooth(&self) -> Mask {
        !self.roughness.less(Lanes::ZERO)
    }

    /// Albedo of one lane.
    pub fn albedo(&self, scene: &Scene, surfaces: &Surfaces, lane: usize) -> Rgb {
        if self.lambert.get(lane) {
            return self.color.get(lane).clamp(Rgb::ZERO, Rgb::ONE);
        }
        let surface = surfaces.get(lane);
        scene.bsdf(&surface).albedo(&surface)
    }

    /// Cosines with respect to the side that scatters; a two-sided material scatters on the side of `wi`.
    #[inline(always)]
    fn height(&self, wi: Lanes3, w: Lanes) -> Lanes {
        (self.two_sided & wi.z.less(Lanes::ZERO)).select(-w, w)
    }

    /// Evaluates the smooth lobes of the active lanes; the values of the others are zero.
    #[inline(always)]
    pub fn eval(&self, scene: &Scene, surfaces: &Surfaces, (wi, wo): (Lanes3, Lanes3), active: Mask) -> Evals {
        let (in_height, out_height) = (self.height(wi, wi.z), self.height(wi, wo.z));
        let scatters = active & self.lambert & in_height.greater(Lanes::ZERO) & out_height.greater(Lanes::ZERO);
        let pdf = scatters.select(out_height * Lanes::splat(FRAC_1_PI), Lanes::ZERO);
        let mut evals = Evals { value: self.color * pdf, pdf };
        for lane in (active & !self.lambert).lanes() {
            let surface = surfaces.get(lane);
            evals.set(lane, scene.bsdf(&surface).eval(&surface, wi.get(lane), wo.get(lane)));
        }
        evals
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
        let (x, y) = disk(u, v);
        let one = Lanes::splat(1.0);
        let height = (one - (x * x + y * y)).max(Lanes::ZERO).sqrt();
        let in_height = self.height(surfaces.wi, surfaces.wi.z);
        let mut found = active & self.lambert & in_height.greater(Lanes::ZERO) & height.greater(Lanes::ZERO);
        to.wo = Lanes3 { x, y, z: self.height(surfaces.wi, height) };
        (to.weight, to.pdf) = (self.color, height * Lanes::splat(FRAC_1_PI));
        (to.lobe, to.eta) = (Bits::ZERO, one);
        for lane in (active & !self.lambert).lanes() {
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

/// [`crate::math::warp::disk`].
#[inline(always)]
pub fn disk(u: Lanes, v: Lanes) -> (Lanes, Lanes) {
    let (two, one) = (Lanes::splat(2.0), Lanes::splat(1.0));
    let (x, y) = (two * u - one, two * v - one);
    let wide = x.abs().greater(y.abs());
    let (radius, other) = (wide.select(x, y), wide.select(y, x));
    let nonzero = radius.abs().greater(Lanes::ZERO);
    let angle = nonzero.select(Lanes::splat(FRAC_PI_4) * (other / radius), Lanes::ZERO);
    let (cosine, sine) = angle.cos_sin_small();
    (radius * wide.select(cosine, sine), radius * wide.select(sine, cosine))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::warp;

    #[test]
    fn the_disk_is_the_disk() {
        for i in 0..1000 {
            let u = vec2((i as f32 * 0.618_034).fract(), (i as f32 * 0.754_877).fract());
            let (x, y) = disk(Lanes::splat(u.x), Lanes::splat(u.y));
            assert_eq!(warp::disk(u), vec2(x.0[3], y.0[3]));
        }
        assert_eq!(disk(Lanes::splat(0.5), Lanes::splat(0.5)), (Lanes::ZERO, Lanes::ZERO));
    }
}
