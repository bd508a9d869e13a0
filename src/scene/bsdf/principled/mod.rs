//! The principled material: diffuse, metal, rough glass, clearcoat and sheen in one (Burley 2012 and 2015).

pub mod thin;

use std::sync::Arc;

use super::microfacet::{Kind, Microfacet};
use super::{Bsdf, Whole};
use crate::error::Result;
use crate::math::lanes::{Lanes, Lanes3};
use crate::math::{Rgb, Vec2, vec2};
use crate::scene::Surface;
use crate::scene::closure::{self, Closure};
use crate::scene::plugin::{Loader, Object, Plugin};
use crate::scene::texture::{Point, Texture};

/// `principled`.
pub const PLUGIN: Plugin<Arc<dyn Bsdf>> = Plugin {
    name: "principled",
    parameters: "base_color = 0.5, roughness = 0.5, anisotropic = 0, metallic = 0, spec_trans = 0, \
        eta or specular = 0.5, spec_tint = 0, sheen = 0, sheen_tint = 0, flatness = 0, clearcoat = 0, \
        clearcoat_gloss = 0, main_specular_sampling_rate, clearcoat_sampling_rate, \
        diffuse_reflectance_sampling_rate (all three ignored)",
    make,
};

fn make(object: &Object, loader: &mut dyn Loader) -> Result<Arc<dyn Bsdf>> {
    object.ignore(&["main_specular_sampling_rate", "clearcoat_sampling_rate", "diffuse_reflectance_sampling_rate"]);
    let eta = relative_ior(object)?;
    let mut number = |name: &str, default: f32| loader.texture(object, name, Rgb::splat(default));
    Ok(Arc::new(Principled {
        eta,
        roughness: number("roughness", 0.5)?,
        anisotropic: number("anisotropic", 0.0)?,
        metallic: number("metallic", 0.0)?,
        spec_trans: number("spec_trans", 0.0)?,
        spec_tint: number("spec_tint", 0.0)?,
        sheen: number("sheen", 0.0)?,
        sheen_tint: number("sheen_tint", 0.0)?,
        flatness: number("flatness", 0.0)?,
        clearcoat: number("clearcoat", 0.0)?,
        clearcoat_gloss: number("clearcoat_gloss", 0.0)?,
        base_color: loader.texture(object, "base_color", Rgb::splat(0.5))?,
    }))
}

/// From `eta`, or from `specular`, which spans the reflectance of common dielectrics. Equal indices would leave nothing to
/// refract by, so the index is kept off one.
fn relative_ior(object: &Object) -> Result<f32> {
    if object.get("eta").is_some() && object.get("specular").is_some() {
        return Err(object.loc_of("eta").invalid("give either `eta` or `specular`"));
    }
    let specular = object.float("specular", 0.5)?;
    let from_specular = 2.0 / (1.0 - (0.08 * specular.max(1e-3)).sqrt()) - 1.0;
    let eta = object.float("eta", from_specular)?;
    if !(eta > 0.0 && eta.is_finite()) {
        return Err(object.loc_of("eta").invalid("`eta` must be positive"));
    }
    Ok(if eta == 1.0 { 1.001 } else { eta })
}

struct Principled {
    eta: f32,
    base_color: Arc<dyn Texture>,
    roughness: Arc<dyn Texture>,
    anisotropic: Arc<dyn Texture>,
    metallic: Arc<dyn Texture>,
    spec_trans: Arc<dyn Texture>,
    spec_tint: Arc<dyn Texture>,
    sheen: Arc<dyn Texture>,
    sheen_tint: Arc<dyn Texture>,
    flatness: Arc<dyn Texture>,
    clearcoat: Arc<dyn Texture>,
    clearcoat_gloss: Arc<dyn Texture>,
}

impl Bsdf for Principled {
    fn closure(&self, at: &Point, _surface: Whole) -> Option<Closure> {
        let number = |texture: &Arc<dyn Texture>| Lanes([texture.scalar(at)]);
        let roughness = number(&self.roughness);
        let facets = facets(roughness.0[0], self.anisotropic.scalar(at));
        let clearcoat = number(&self.clearcoat);
        let clearcoat_alpha = 0.1 + (0.001 - 0.1) * self.clearcoat_gloss.scalar(at);
        let lobes = closure::Principled {
            eta: Lanes([self.eta]),
            base: Lanes3::splat(self.base_color.color(at)),
            facets: facets.ggx(),
            roughness,
            metallic: number(&self.metallic),
            spec_trans: number(&self.spec_trans),
            spec_tint: number(&self.spec_tint),
            sheen: number(&self.sheen),
            sheen_tint: number(&self.sheen_tint),
            flatness: number(&self.flatness),
            clearcoat,
            clearcoat_alpha: Lanes([clearcoat_alpha]),
        };
        let coat = if clearcoat.0[0] > 0.0 { clearcoat_alpha } else { f32::INFINITY };
        Some(lobes.closure(Some(facets.smallest().min(coat))))
    }

    fn textures(&self) -> Vec<&dyn Texture> {
        let all = [
            &self.base_color,
            &self.roughness,
            &self.anisotropic,
            &self.metallic,
            &self.spec_trans,
            &self.spec_tint,
            &self.sheen,
            &self.sheen_tint,
            &self.flatness,
            &self.clearcoat,
            &self.clearcoat_gloss,
        ];
        all.map(|texture| &**texture).into()
    }

    fn albedo(&self, surface: &Surface) -> Rgb {
        self.base_color.color(&surface.at).clamp(Rgb::ZERO, Rgb::ONE)
    }

    fn transmits(&self) -> bool {
        self.spec_trans.constant() != Some(Rgb::ZERO)
    }

    fn refraction(&self) -> Option<f32> {
        self.transmits().then_some(self.eta)
    }

    fn needs_derivatives(&self) -> bool {
        self.anisotropic.constant() != Some(Rgb::ZERO)
    }
}

/// Facets of the main specular lobe.
fn facets(roughness: f32, anisotropic: f32) -> Microfacet {
    let squared = roughness * roughness;
    let aspect = (1.0 - 0.9 * anisotropic).sqrt();
    let alpha: Vec2 = vec2(squared / aspect, squared * aspect).max(Vec2::splat(1e-3));
    Microfacet::anisotropic(Kind::Ggx, alpha)
}
