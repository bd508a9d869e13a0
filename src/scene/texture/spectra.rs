//! Spectra written as plugins: the same everywhere, as reflectances or as light.

use std::sync::Arc;

use super::{Constant, Texture};
use crate::error::Result;
use crate::math::Rgb;
use crate::scene::plugin::{Loader, Object, Plugin, Property, Value, values};
use crate::scene::spectrum::Spectrum;

/// `d65`: daylight, which is white in linear sRGB, in a colour.
pub const D65: Plugin<Arc<dyn Texture>> =
    Plugin { name: "d65", parameters: "scale = 1, color = 1 or one nested texture", make: make_d65 };
/// `srgb`: a linear colour.
pub const SRGB: Plugin<Arc<dyn Texture>> = Plugin { name: "srgb", parameters: "color = 1", make: make_srgb };
/// `blackbody`: in W/(m² sr nm).
pub const BLACKBODY: Plugin<Arc<dyn Texture>> = Plugin {
    name: "blackbody",
    parameters: "temperature in kelvin, scale = 1, wavelength_min, wavelength_max (ignored)",
    make: make_curve,
};
/// `regular`: values at even steps of wavelength.
pub const REGULAR: Plugin<Arc<dyn Texture>> =
    Plugin { name: "regular", parameters: "wavelength_min, wavelength_max, values", make: make_curve };
/// `irregular`: values at any wavelengths.
pub const IRREGULAR: Plugin<Arc<dyn Texture>> =
    Plugin { name: "irregular", parameters: "wavelengths, values", make: make_curve };

fn make_d65(object: &Object, loader: &mut dyn Loader) -> Result<Arc<dyn Texture>> {
    let scale = object.float("scale", 1.0)?;
    let nested = object.nested().next().is_some();
    let named = object.get("color").is_some();
    if nested && !named {
        return loader.nested_texture(object);
    }
    let color = loader.texture(object, "color", Rgb::ONE)?;
    Ok(color.constant().map_or(color, |color| Arc::new(Constant(color * scale))))
}

fn make_srgb(object: &Object, _loader: &mut dyn Loader) -> Result<Arc<dyn Texture>> {
    Ok(Arc::new(Constant(object.color("color", Rgb::ONE)?)))
}

fn make_curve(object: &Object, _loader: &mut dyn Loader) -> Result<Arc<dyn Texture>> {
    let curve = curve(object)?.map_or(Rgb::ONE, |spectrum| spectrum.reflectance());
    Ok(Arc::new(Constant(curve)))
}

/// The spectrum that an object is, if it is one over wavelengths.
pub fn curve(object: &Object) -> Result<Option<Spectrum>> {
    let list = |name: &str| -> Result<Vec<f64>> {
        let text = match object.get(name) {
            Some(Property { value: Value::String(text), .. }) => text.clone(),
            _ => return Err(object.loc.invalid(format!("`{}` needs a list of numbers `{name}`", object.plugin))),
        };
        values::numbers(&text, &object.loc_of(name))
    };
    let pairs = match object.plugin.as_str() {
        "blackbody" => {
            let (temperature, scale) = (object.float("temperature", 0.0)?, object.float("scale", 1.0)?);
            object.ignore(&["wavelength_min", "wavelength_max"]);
            return Spectrum::blackbody(f64::from(temperature), f64::from(scale), &object.loc).map(Some);
        }
        "regular" => {
            let values = list("values")?;
            let first = f64::from(object.float("wavelength_min", 360.0)?);
            let last = f64::from(object.float("wavelength_max", 830.0)?);
            let step = (last - first) / (values.len().max(2) - 1) as f64;
            values.into_iter().enumerate().map(|(i, value)| [first + step * i as f64, value]).collect::<Vec<_>>()
        }
        "irregular" => {
            let (wavelengths, values) = (list("wavelengths")?, list("values")?);
            if wavelengths.len() != values.len() {
                return Err(object.loc.invalid("`wavelengths` and `values` have different lengths"));
            }
            wavelengths.into_iter().zip(values).map(|(wavelength, value)| [wavelength, value]).collect()
        }
        _ => return Ok(None),
    };
    Spectrum::curve(pairs, &object.loc).map(Some)
}
