//! The principled material for thin sheets: paper, leaves, bubbles. Both sides look the same.

use std::sync::Arc;

use super::facets;
use crate::error::Result;
use crate::math::Rgb;
use crate::math::lanes::{Lanes, Lanes3};
use crate::scene::Surface;
use crate::scene::bsdf::{Bsdf, Whole};
use crate::scene::closure::{self, Closure};
use crate::scene::plugin::{Loader, Object, Plugin};
use crate::scene::texture::{Point, Texture};

/// `principledthin`.
pub const PLUGIN: Plugin<Arc<dyn Bsdf>> = Plugin {
    name: "principledthin",
    parameters: "base_color = 0.5, roughness = 0.5, anisotropic = 0, spec_trans = 0, eta = 1.5, spec_tint = 0, \
        sheen = 0, sheen_tint = 0, flatness = 0, diff_trans = 0 (to 2), specular_reflectance_sampling_rate, specular_transmittance_sampling_rate, \
        diffuse_reflectance_sampling_rate, diffuse_transmittance_sampling_rate (all four ignored)",
    make,
};

fn make(object: &Object, loader: &mut dyn Loader) -> Result<Arc<dyn Bsdf>> {
    object.ignore(&[
        "specular_reflectance_sampling_rate",
        "specular_transmittance_sampling_rate",
        "diffuse_reflectance_sampling_rate",
        "diffuse_transmittance_sampling_rate",
    ]);
    let mut number = |name: &str, default: f32| loader.texture(object, name, Rgb::splat(default));
    Ok(Arc::new(PrincipledThin {
        roughness: number("roughness", 0.5)?,
        anisotropic: number("anisotropic", 0.0)?,
        spec_trans: number("spec_trans", 0.0)?,
        eta: number("eta", 1.5)?,
        spec_tint: number("spec_tint", 0.0)?,
        sheen: number("sheen", 0.0)?,
        sheen_tint: number("sheen_tint", 0.0)?,
        flatness: number("flatness", 0.0)?,
        diff_trans: number("diff_trans", 0.0)?,
        base_color: loader.texture(object, "base_color", Rgb::splat(0.5))?,
    }))
}

struct PrincipledThin {
    base_color: Arc<dyn Texture>,
    roughness: Arc<dyn Texture>,
    anisotropic: Arc<dyn Texture>,
    spec_trans: Arc<dyn Texture>,
    eta: Arc<dyn Texture>,
    spec_tint: Arc<dyn Texture>,
    sheen: Arc<dyn Texture>,
    sheen_tint: Arc<dyn Texture>,
    flatness: Arc<dyn Texture>,
    diff_trans: Arc<dyn Texture>,
}

impl Bsdf for PrincipledThin {
    fn closure(&self, at: &Point, _surface: Whole) -> Option<Closure> {
        let number = |texture: &Arc<dyn Texture>| texture.scalar(at);
        let lane = |texture: &Arc<dyn Texture>| Lanes([texture.scalar(at)]);
        let (eta, roughness) = (number(&self.eta), number(&self.roughness));
        let (specular, anisotropic) = (number(&self.spec_trans), number(&self.anisotropic));
        let reflecting = facets(roughness, anisotropic);
        let transmitting = facets((0.65 * eta - 0.35) * roughness, anisotropic);
        let smallest = reflecting.smallest().min(transmitting.smallest());
        let lobes = closure::PrincipledThin {
            eta: Lanes([eta]),
            base: Lanes3::splat(self.base_color.color(at)),
            reflecting: reflecting.ggx(),
            transmitting: transmitting.ggx(),
            roughness: Lanes([roughness]),
            specular: Lanes([specular]),
            passing: Lanes([0.5 * number(&self.diff_trans)]),
            spec_tint: lane(&self.spec_tint),
            sheen: lane(&self.sheen),
            sheen_tint: lane(&self.sheen_tint),
            flatness: lane(&self.flatness),
        };
        Some(lobes.closure(Some(if specular > 0.0 { smallest } else { f32::INFINITY })))
    }

    fn textures(&self) -> Vec<&dyn Texture> {
        let all = [
            &self.base_color,
            &self.roughness,
            &self.anisotropic,
            &self.spec_trans,
            &self.eta,
            &self.spec_tint,
            &self.sheen,
            &self.sheen_tint,
            &self.flatness,
            &self.diff_trans,
        ];
        all.map(|texture| &**texture).into()
    }

    fn albedo(&self, surface: &Surface) -> Rgb {
        self.base_color.color(&surface.at).clamp(Rgb::ZERO, Rgb::ONE)
    }

    fn transmits(&self) -> bool {
        true
    }

    fn needs_derivatives(&self) -> bool {
        self.anisotropic.constant() != Some(Rgb::ZERO)
    }
}
