//! Materials. Directions are local (the shading normal is +z) and point away from the surface; `wi` is where the
//! path came from, `wo` where it goes.

mod blendbsdf;
mod bumpmap;
mod coating;
mod conductor;
mod dielectric;
mod diffuse;
mod mask;
mod metals;
pub mod microfacet;
mod normalmap;
mod null;
mod perturbed;
mod phong;
mod plastic;
mod polarizer;
mod pplastic;
mod principled;
mod roughconductor;
mod roughdielectric;
mod roughdiffuse;
mod roughplastic;
mod thindielectric;
mod twosided;
mod ward;

use std::sync::Arc;

use super::Surface;
use super::closure::Closure;
use super::load::Plugin;
use super::load::props::{Object, Property, Value};
use super::texture::{Point, Texture};
use crate::error::Result;
use crate::math::{Rgb, Vec2, Vec3, vec3};

/// The BSDFs of scene files.
pub const PLUGINS: &[Plugin<Arc<dyn Bsdf>>] = &[
    diffuse::PLUGIN,
    roughdiffuse::PLUGIN,
    conductor::PLUGIN,
    roughconductor::PLUGIN,
    dielectric::PLUGIN,
    roughdielectric::PLUGIN,
    thindielectric::PLUGIN,
    plastic::PLUGIN,
    roughplastic::PLUGIN,
    pplastic::PLUGIN,
    phong::PLUGIN,
    ward::PLUGIN,
    principled::PLUGIN,
    principled::thin::PLUGIN,
    twosided::PLUGIN,
    mask::PLUGIN,
    blendbsdf::PLUGIN,
    blendbsdf::MIXTURE,
    coating::SMOOTH,
    coating::ROUGH,
    bumpmap::PLUGIN,
    normalmap::PLUGIN,
    null::PLUGIN,
    polarizer::LINEAR,
    polarizer::CIRCULAR,
    polarizer::RETARDER,
];

/// The material of a shape that names none: half-grey, but black for a shape that emits.
pub fn default(emits: bool) -> Arc<dyn Bsdf> {
    diffuse::uniform(if emits { 0.0 } else { 0.5 })
}

/// Kinds of scattering that shift mappings distinguish.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Lobe {
    /// Spread over solid angle.
    Smooth,
    /// Mirror direction only.
    DeltaReflect,
    /// Refracted direction only.
    DeltaTransmit,
    /// Straight through, unscattered.
    Null,
}

impl Lobe {
    /// Whether the lobe has a single direction.
    pub fn is_delta(self) -> bool {
        self != Self::Smooth
    }
}

/// A sampled direction.
#[derive(Clone, Copy, Debug)]
pub struct BsdfSample {
    /// Outgoing direction.
    pub wo: Vec3,
    /// f |cos θo| / pdf, of all smooth lobes together or of the one delta lobe.
    pub weight: Rgb,
    /// Density per solid angle, or probability of a delta lobe.
    pub pdf: f32,
    /// The lobe.
    pub lobe: Lobe,
    /// Relative index of refraction along the new direction: 1 unless refracted.
    pub eta: f32,
}

/// The smooth lobes in a pair of directions.
#[derive(Clone, Copy, Debug, Default)]
pub struct Eval {
    /// f |cos θo|.
    pub value: Rgb,
    /// Density per solid angle with which `sample` gives `wo`, delta lobes' share taken off.
    pub pdf: f32,
}

impl Eval {
    /// The sample of a direction in which a smooth lobe has this value; none where it is never sampled.
    pub fn sampled(self, wo: Vec3) -> Option<BsdfSample> {
        let Self { value, pdf } = self;
        (pdf > 0.0).then(|| BsdfSample { wo, weight: value / pdf, pdf, lobe: Lobe::Smooth, eta: 1.0 })
    }
}

/// Share of a specular lobe in sampling beside a diffuse one, by their mean reflectances.
fn specular_share(diffuse: &dyn Texture, specular: &dyn Texture) -> f32 {
    let total = diffuse.mean() + specular.mean();
    if total > 0.0 { specular.mean() / total } else { 0.5 }
}

/// Scattering by a delta lobe.
#[derive(Clone, Copy, Debug)]
pub struct Delta {
    /// Its one outgoing direction.
    pub wo: Vec3,
    /// Factor on radiance.
    pub value: Rgb,
    /// Probability with which `sample` chooses it.
    pub probability: f32,
}

/// A surface that is put together only where a material asks for more than its texture coordinates.
pub type Whole<'a> = &'a dyn Fn() -> Surface;

/// Scattering at a surface. A material says either what its closure is or, if it has none, how it scatters.
pub trait Bsdf: Send + Sync {
    /// The material at a surface, if it is one of the [kinds](crate::scene::closure::Kind) that packets evaluate. It has one
    /// everywhere or nowhere; where one is missing all the same, the material is asked as if it had none.
    fn closure(&self, _at: &Point, _surface: Whole) -> Option<Closure> {
        None
    }

    /// Everything that the closure looks up.
    fn textures(&self) -> Vec<&dyn Texture> {
        Vec::new()
    }

    /// Draws a direction from the lobe number `lobe` in [0, 1) and `u`. `None` absorbs.
    fn sample(&self, surface: &Surface, wi: Vec3, lobe: f32, u: Vec2) -> Option<BsdfSample> {
        self.closure(&surface.at, &|| *surface)?.sample_one(wi, lobe, u)
    }

    /// The smooth lobes.
    fn eval(&self, surface: &Surface, wi: Vec3, wo: Vec3) -> Eval {
        self.closure(&surface.at, &|| *surface).map_or_else(Eval::default, |closure| closure.eval_one(wi, wo))
    }

    /// Scattering by a delta lobe; `None` if the material has none, or if it does not scatter `wi`.
    fn delta(&self, surface: &Surface, wi: Vec3, lobe: Lobe) -> Option<Delta> {
        self.closure(&surface.at, &|| *surface)?.delta(wi, lobe)
    }

    /// Smallest roughness (Beckmann or GGX alpha) of the smooth lobes, infinite for diffuse ones; `None` without
    /// smooth lobes.
    fn roughness(&self, surface: &Surface) -> Option<f32> {
        self.closure(&surface.at, &|| *surface)?.roughness_of_one()
    }

    /// Overall colour in [0, 1], the same from everywhere: the albedo feature.
    fn albedo(&self, surface: &Surface) -> Rgb;

    /// Whether light can pass to the other side.
    fn transmits(&self) -> bool {
        false
    }

    /// Interior over exterior index of refraction of the smooth lobes that refract, if there are such.
    fn refraction(&self) -> Option<f32> {
        None
    }

    /// Whether surfaces need dp_du and dp_dv.
    fn needs_derivatives(&self) -> bool {
        false
    }
}

/// A local direction seen from the other side of the surface.
fn mirror(w: Vec3) -> Vec3 {
    vec3(w.x, w.y, -w.z)
}

/// The default interior of plastics.
const POLYPROPYLENE: f32 = 1.49;
/// The default interior of glass.
const BK7: f32 = 1.5046;

/// Indices of refraction by name.
const IOR: &[(&str, f32)] = &[
    ("vacuum", 1.0),
    ("helium", 1.000_036),
    ("hydrogen", 1.000_132),
    ("air", 1.000_277),
    ("carbon dioxide", 1.000_45),
    ("water", 1.333),
    ("acetone", 1.36),
    ("ethanol", 1.361),
    ("carbon tetrachloride", 1.461),
    ("glycerol", 1.4729),
    ("benzene", 1.501),
    ("silicone oil", 1.520_45),
    ("bromine", 1.661),
    ("water ice", 1.31),
    ("fused quartz", 1.458),
    ("pyrex", 1.47),
    ("acrylic glass", 1.49),
    ("polypropylene", POLYPROPYLENE),
    ("bk7", BK7),
    ("sodium chloride", 1.544),
    ("amber", 1.55),
    ("pet", 1.575),
    ("diamond", 2.419),
];

fn ior(object: &Object, name: &str, default: f32) -> Result<f32> {
    if let Some(Property { value: Value::String(material), loc, .. }) = object.get(name) {
        let found = IOR.iter().find(|(known, _)| known.eq_ignore_ascii_case(material));
        let names = || IOR.iter().map(|(known, _)| *known).collect::<Vec<_>>().join(", ");
        let unknown = || loc.unsupported(format!("`{material}` is no known material; there are {}", names()));
        return found.map(|(_, ior)| *ior).ok_or_else(unknown);
    }
    let value = object.float(name, default)?;
    if value > 0.0 && value.is_finite() {
        Ok(value)
    } else {
        Err(object.loc_of(name).invalid(format!("`{name}` must be positive")))
    }
}

/// Interior over exterior index of refraction.
fn relative_ior(object: &Object, default_interior: f32) -> Result<f32> {
    Ok(ior(object, "int_ior", default_interior)? / ior(object, "ext_ior", 1.000_277)?)
}
