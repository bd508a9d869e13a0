//! A material whose shading normal is perturbed by a texture: the common part of bump maps and normal maps.

use std::sync::Arc;

use super::{Bsdf, BsdfSample, Delta, Eval, Lobe, Whole};
use crate::error::Result;
use crate::math::{Rgb, Vec2, Vec3};
use crate::scene::Surface;
use crate::scene::closure::{Closure, Perturbation};
use crate::scene::plugin::{Loader, Object};
use crate::scene::texture::{Point, Texture};

/// Source of the perturbed normal.
pub trait NormalMap: Send + Sync {
    /// The perturbed normal in the shading frame, of length one.
    fn normal(&self, surface: &Surface) -> Vec3;

    /// The texture that it is read from.
    fn texture(&self) -> &dyn Texture;
}

/// The nested material under perturbed normals.
pub struct Perturbed<B> {
    map: B,
    /// Mirror a perturbed normal that faces away from the viewer.
    flip_invalid: bool,
    /// Attenuate directions that the bumps would shadow, where the perturbed normal would otherwise cut light off.
    shadowing: bool,
    nested: Arc<dyn Bsdf>,
}

impl<B: NormalMap> Perturbed<B> {
    /// Reads the parameters that all perturbed materials share.
    pub fn load(object: &Object, loader: &mut dyn Loader, map: B) -> Result<Self> {
        Ok(Self {
            map,
            flip_invalid: object.boolean("flip_invalid_normals", true)?,
            shadowing: object.boolean("use_shadowing_function", true)?,
            nested: loader.nested_bsdf(object)?,
        })
    }

    fn perturbation(&self, surface: &Surface) -> Perturbation<1> {
        Perturbation::new(self.map.normal(surface), self.flip_invalid, self.shadowing)
    }
}

impl<B: NormalMap> Bsdf for Perturbed<B> {
    fn closure(&self, at: &Point, surface: Whole) -> Option<Closure> {
        self.nested.closure(at, surface)?.under(self.perturbation(&surface()))
    }

    fn textures(&self) -> Vec<&dyn Texture> {
        self.nested.textures().into_iter().chain([self.map.texture()]).collect()
    }

    fn sample(&self, surface: &Surface, wi: Vec3, lobe: f32, u: Vec2) -> Option<BsdfSample> {
        let perturbation = self.perturbation(surface);
        let frame = perturbation.frame_of(wi);
        let sample = self.nested.sample(surface, frame.to_local(wi), lobe, u)?;
        let wo = frame.to_world(sample.wo);
        let weight = sample.weight * perturbation.unshadowed_of(wo);
        (wo.z * sample.wo.z > 0.0).then_some(BsdfSample { wo, weight, ..sample })
    }

    fn eval(&self, surface: &Surface, wi: Vec3, wo: Vec3) -> Eval {
        let perturbation = self.perturbation(surface);
        let frame = perturbation.frame_of(wi);
        let perturbed_wo = frame.to_local(wo);
        if wo.z * perturbed_wo.z <= 0.0 {
            return Eval::default();
        }
        let Eval { value, pdf } = self.nested.eval(surface, frame.to_local(wi), perturbed_wo);
        Eval { value: value * perturbation.unshadowed_of(wo), pdf }
    }

    fn delta(&self, surface: &Surface, wi: Vec3, lobe: Lobe) -> Option<Delta> {
        let perturbation = self.perturbation(surface);
        let frame = perturbation.frame_of(wi);
        let delta = self.nested.delta(surface, frame.to_local(wi), lobe)?;
        let wo = frame.to_world(delta.wo);
        let value = delta.value * perturbation.unshadowed_of(wo);
        (wo.z * delta.wo.z > 0.0).then_some(Delta { wo, value, ..delta })
    }

    fn roughness(&self, surface: &Surface) -> Option<f32> {
        self.nested.roughness(surface)
    }

    fn albedo(&self, surface: &Surface) -> Rgb {
        self.nested.albedo(surface)
    }

    fn transmits(&self) -> bool {
        self.nested.transmits()
    }

    fn refraction(&self) -> Option<f32> {
        self.nested.refraction()
    }

    fn needs_derivatives(&self) -> bool {
        true
    }
}
