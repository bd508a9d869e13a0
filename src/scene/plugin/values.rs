//! The texts of attributes as numbers, vectors and colours.

use crate::error::{Result, SourceLoc};
use crate::math::{Rgb, Vec3, srgb_decode, vec3};

/// The numbers of a list, as texts.
pub fn split(text: &str) -> impl Iterator<Item = &str> {
    text.split(|c: char| c == ',' || c.is_whitespace()).filter(|part| !part.is_empty())
}

/// Any number of numbers.
pub fn numbers(text: &str, loc: &SourceLoc) -> Result<Vec<f64>> {
    split(text).map(|part| number(part, loc)).collect()
}

/// A finite number.
pub fn number(text: &str, loc: &SourceLoc) -> Result<f64> {
    match text.trim().parse::<f64>() {
        Ok(value) if value.is_finite() => Ok(value),
        _ => Err(loc.invalid(format!("`{text}` is not a finite number"))),
    }
}

/// A whole number.
pub fn integer(text: &str, loc: &SourceLoc) -> Result<i64> {
    text.trim().parse().map_err(|_| loc.invalid(format!("`{text}` is not a whole number")))
}

/// True or false, in any case.
pub fn boolean(text: &str, loc: &SourceLoc) -> Result<bool> {
    let text = text.trim();
    match (text.eq_ignore_ascii_case("true"), text.eq_ignore_ascii_case("false")) {
        (false, false) => Err(loc.invalid(format!("`{text}` is neither true nor false"))),
        (is_true, _) => Ok(is_true),
    }
}

/// Three numbers, or one for all three.
pub fn triple(text: &str, loc: &SourceLoc) -> Result<Vec3> {
    match numbers(text, loc)?.as_slice() {
        &[x, y, z] => Ok(vec3(x as f32, y as f32, z as f32)),
        &[all] => Ok(Vec3::splat(all as f32)),
        other => Err(loc.invalid(format!("`{text}` has {} numbers; three are needed", other.len()))),
    }
}

/// A linear colour: one number or three, or the display colour `#rrggbb`.
pub fn rgb(text: &str, loc: &SourceLoc) -> Result<Rgb> {
    match (hexadecimal(text, loc)?, split(text).count()) {
        (Some(encoded), _) => Ok(decode(encoded)),
        (None, 1) => Ok(Rgb::splat(number(text, loc)? as f32)),
        (None, _) => triple(text, loc),
    }
}

/// A display colour: `#rrggbb`, or one or three numbers.
pub fn srgb(text: &str, loc: &SourceLoc) -> Result<Rgb> {
    let encoded = hexadecimal(text, loc)?;
    encoded.map_or_else(|| rgb(text, loc), Ok).map(decode)
}

fn decode(encoded: Rgb) -> Rgb {
    Rgb::from_array(encoded.to_array().map(srgb_decode))
}

fn hexadecimal(text: &str, loc: &SourceLoc) -> Result<Option<Rgb>> {
    let Some(digits) = text.trim().strip_prefix('#') else { return Ok(None) };
    let bits = u32::from_str_radix(digits, 16).ok().filter(|_| digits.len() == 6);
    let bits = bits.ok_or_else(|| loc.invalid(format!("`{text}` is not #rrggbb")))?;
    Ok(Some(vec3((bits >> 16) as f32, (bits >> 8 & 255) as f32, (bits & 255) as f32) / 255.0))
}
