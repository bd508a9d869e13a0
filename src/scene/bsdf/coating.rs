//! A clear or tinted layer over another material, with a smooth or a rough surface. Light that is reflected back and forth
//! inside of the layer is lost.

use std::sync::Arc;

use super::ior::{BK7, relative_ior};
use super::microfacet::{Kind, Microfacet, RoughTransmittance};
use super::{Bsdf, BsdfSample, Delta, Eval, Lobe, mirror};
use crate::error::Result;
use crate::math::{Rgb, Vec2, Vec3, fresnel, vec3};
use crate::scene::Surface;
use crate::scene::plugin::{Loader, Object, Plugin};
use crate::scene::texture::Texture;

/// `coating`.
pub const SMOOTH: Plugin<Arc<dyn Bsdf>> = Plugin {
    name: "coating",
    parameters: "int_ior = bk7, ext_ior = air, thickness = 1, sigma_a = 0, specular_reflectance = 1, one nested bsdf",
    make: make_smooth,
};

/// `roughcoating`.
pub const ROUGH: Plugin<Arc<dyn Bsdf>> = Plugin {
    name: "roughcoating",
    parameters: "int_ior = bk7, ext_ior = air, thickness = 1, sigma_a = 0, specular_reflectance = 1, alpha = 0.1, \
        distribution = beckmann (ggx), sample_visible (ignored), one nested bsdf",
    make: make_rough,
};

fn make_smooth(object: &Object, loader: &mut dyn Loader) -> Result<Arc<dyn Bsdf>> {
    Ok(Arc::new(Coating::load(object, loader, None)?))
}

fn make_rough(object: &Object, loader: &mut dyn Loader) -> Result<Arc<dyn Bsdf>> {
    object.ignore(&["sample_visible"]);
    let eta = relative_ior(object, BK7)?;
    if eta <= 1.0 {
        return Err(object.loc.unsupported("roughcoating with a layer no denser than its exterior"));
    }
    let facets = Microfacet::new(Kind::load(object, loader)?, object.float("alpha", 0.1)?);
    let transmittance = RoughTransmittance::new(facets, eta);
    Ok(Arc::new(Coating::load(object, loader, Some((facets, transmittance)))?))
}

struct Coating {
    eta: f32,
    thickness: f32,
    /// Absorption per unit of length.
    sigma_a: Arc<dyn Texture>,
    specular: Arc<dyn Texture>,
    /// The layer's surface, if it is rough.
    facets: Option<(Microfacet, RoughTransmittance)>,
    nested: Arc<dyn Bsdf>,
    /// Share of the layer's surface in sampling where it and the rest are equally bright.
    specular_share: f32,
}

impl Coating {
    fn load(
        object: &Object,
        loader: &mut dyn Loader,
        facets: Option<(Microfacet, RoughTransmittance)>,
    ) -> Result<Self> {
        let (thickness, sigma_a) = (object.float("thickness", 1.0)?, loader.texture(object, "sigma_a", Rgb::ZERO)?);
        let through = (-2.0 * thickness * sigma_a.mean()).exp();
        Ok(Self {
            eta: relative_ior(object, BK7)?,
            thickness,
            sigma_a,
            specular: loader.texture(object, "specular_reflectance", Rgb::ONE)?,
            facets,
            nested: loader.nested_bsdf(object)?,
            specular_share: 1.0 / (1.0 + through),
        })
    }

    /// Share of light that enters the layer at a cosine.
    fn entering(&self, cos: f32) -> f32 {
        match &self.facets {
            Some((_, transmittance)) => transmittance.at(cos.abs()),
            None => 1.0 - fresnel::dielectric(cos.abs(), self.eta).reflectance,
        }
    }

    /// Probability of sampling the layer's surface.
    fn probability(&self, cos: f32) -> f32 {
        let entering = self.entering(cos);
        let surface = (1.0 - entering) * self.specular_share;
        let rest = entering * (1.0 - self.specular_share);
        if surface + rest > 0.0 { surface / (surface + rest) } else { 1.0 }
    }

    /// A direction with its tangential part scaled: by one over the index into the layer, by the index out of it. `None` on
    /// total reflection.
    fn refracted(w: Vec3, scale: f32) -> Option<Vec3> {
        let (x, y) = (w.x * scale, w.y * scale);
        let cos2 = 1.0 - x * x - y * y;
        (cos2 > 0.0).then(|| vec3(x, y, cos2.sqrt().copysign(w.z)))
    }

    /// Share of light that gets into the layer, through it twice and out again.
    fn through(&self, surface: &Surface, [wi, wo]: [Vec3; 2], [wi_inside, wo_inside]: [Vec3; 2]) -> Rgb {
        let length = self.thickness * (1.0 / wi_inside.z.abs() + 1.0 / wo_inside.z.abs());
        let depth = self.sigma_a.color(&surface.at) * -length;
        let absorbed = if depth == Rgb::ZERO { Rgb::ONE } else { Rgb::from_array(depth.to_array().map(f32::exp)) };
        absorbed * (self.entering(wi.z) * self.entering(wo.z))
    }

    /// The lobe of the layer's rough surface, and its density.
    fn glossy(&self, surface: &Surface, wi: Vec3, wo: Vec3) -> Eval {
        let Some((facets, _)) = &self.facets else { return Eval::default() };
        if wi.z * wo.z <= 0.0 {
            return Eval::default();
        }
        let (wi, wo) = if wi.z < 0.0 { (mirror(wi), mirror(wo)) } else { (wi, wo) };
        let m = (wi + wo).normalize();
        let pdf = facets.reflect_pdf(wi, m);
        let reflectance = fresnel::dielectric(wi.dot(m), self.eta).reflectance;
        Eval { value: self.specular.color(&surface.at) * (reflectance * pdf * facets.g1(wo, m)), pdf }
    }

    fn sample_nested(&self, surface: &Surface, wi: Vec3, lobe: f32, u: Vec2) -> Option<BsdfSample> {
        let inside = Self::refracted(wi, 1.0 / self.eta)?;
        let sample = self.nested.sample(surface, inside, lobe, u)?;
        if sample.lobe.is_delta() {
            let Delta { wo, value, probability } = self.delta(surface, wi, sample.lobe)?;
            return Some(BsdfSample { wo, weight: value / probability, pdf: probability, ..sample });
        }
        let wo = Self::refracted(sample.wo, self.eta)?;
        let Eval { value, pdf } = self.eval(surface, wi, wo);
        (pdf > 0.0).then(|| BsdfSample { wo, weight: value / pdf, pdf, ..sample })
    }
}

impl Bsdf for Coating {
    fn sample(&self, surface: &Surface, wi: Vec3, lobe: f32, u: Vec2) -> Option<BsdfSample> {
        if wi.z == 0.0 {
            return None;
        }
        let surface_share = self.probability(wi.z);
        if lobe >= surface_share {
            let lobe = (lobe - surface_share) / (1.0 - surface_share);
            return self.sample_nested(surface, wi, lobe.min(1.0 - f32::EPSILON), u);
        }
        let Some((facets, _)) = &self.facets else {
            let Delta { wo, value, probability } = self.delta(surface, wi, Lobe::DeltaReflect)?;
            let weight = value / probability;
            return Some(BsdfSample { wo, weight, pdf: probability, lobe: Lobe::DeltaReflect, eta: 1.0 });
        };
        let above = if wi.z < 0.0 { mirror(wi) } else { wi };
        let wo = fresnel::reflect_about(above, facets.sample_visible(above, u));
        let wo = if wi.z < 0.0 { mirror(wo) } else { wo };
        if wo.z * wi.z > 0.0 { self.eval(surface, wi, wo).sampled(wo) } else { None }
    }

    fn eval(&self, surface: &Surface, wi: Vec3, wo: Vec3) -> Eval {
        if wi.z == 0.0 || wo.z == 0.0 {
            return Eval::default();
        }
        let share = self.probability(wi.z);
        let glossy = self.glossy(surface, wi, wo);
        let mut sum = Eval { value: glossy.value, pdf: share * glossy.pdf };
        if let (Some(i), Some(o)) = (Self::refracted(wi, 1.0 / self.eta), Self::refracted(wo, 1.0 / self.eta)) {
            let Eval { value, pdf } = self.nested.eval(surface, i, o);
            // Solid angles inside are smaller.
            let squeeze = wo.z / (self.eta * self.eta * o.z);
            sum.value += value * self.through(surface, [wi, wo], [i, o]) * squeeze;
            sum.pdf += (1.0 - share) * pdf * squeeze;
        }
        sum
    }

    fn delta(&self, surface: &Surface, wi: Vec3, lobe: Lobe) -> Option<Delta> {
        let share = self.probability(wi.z);
        let nested = Self::refracted(wi, 1.0 / self.eta).and_then(|inside| {
            let delta = self.nested.delta(surface, inside, lobe)?;
            let wo = Self::refracted(delta.wo, self.eta)?;
            let value = delta.value * self.through(surface, [wi, wo], [inside, delta.wo]);
            Some(Delta { wo, value, probability: delta.probability * (1.0 - share) })
        });
        if lobe != Lobe::DeltaReflect || self.facets.is_some() || wi.z == 0.0 {
            return nested.filter(|delta| delta.probability > 0.0);
        }
        let own = self.specular.color(&surface.at) * (1.0 - self.entering(wi.z));
        // A mirror below reflects into the same direction.
        let (value, probability) = nested.map_or((Rgb::ZERO, 0.0), |delta| (delta.value, delta.probability));
        let (value, probability) = (own + value, share + probability);
        (probability > 0.0).then_some(Delta { wo: fresnel::reflect(wi), value, probability })
    }

    fn roughness(&self, surface: &Surface) -> Option<f32> {
        let own = self.facets.as_ref().map(|(facets, _)| facets.smallest());
        own.into_iter().chain(self.nested.roughness(surface)).reduce(f32::min)
    }

    fn albedo(&self, surface: &Surface) -> Rgb {
        let depth = self.sigma_a.color(&surface.at) * (-2.0 * self.thickness);
        let absorbed = Rgb::from_array(depth.to_array().map(f32::exp));
        (self.nested.albedo(surface) * absorbed).clamp(Rgb::ZERO, Rgb::ONE)
    }

    fn transmits(&self) -> bool {
        self.nested.transmits()
    }

    fn needs_derivatives(&self) -> bool {
        self.nested.needs_derivatives()
    }
}
