//! Spectra as linear sRGB, the way Mitsuba's rgb mode converts them.

mod cie;

use crate::error::{Result, SourceLoc};
use crate::math::{Rgb, vec3};

/// A quantity over wavelength.
#[derive(Clone, Debug, PartialEq)]
pub enum Spectrum {
    /// The same at all wavelengths.
    Uniform(f32),
    /// Wavelengths in nm, rising, with values between which it is linear; zero outside.
    Curve(Vec<[f64; 2]>),
}

/// Wavelengths at which integrals are taken.
const SAMPLES: usize = 1000;
/// Power of D65 whose luminance counts as one.
const DAYLIGHT: f64 = 98.997_417_518_762_55;

impl Spectrum {
    /// From a single number, or from `wavelength:value` pairs.
    pub fn parse(text: &str, loc: &SourceLoc) -> Result<Self> {
        let number = |text: &str| {
            let parsed = text.trim().parse::<f64>().ok().filter(|value| value.is_finite());
            parsed.ok_or_else(|| loc.invalid(format!("`{text}` is not a finite number")))
        };
        if !text.contains(':') {
            return Ok(Self::Uniform(number(text)? as f32));
        }
        let mut curve = Vec::new();
        for part in text.split(|c: char| c == ',' || c.is_whitespace()).filter(|part| !part.is_empty()) {
            let pair = part.split_once(':');
            let (wavelength, value) = pair.ok_or_else(|| loc.invalid(format!("`{part}` is not `wavelength:value`")))?;
            curve.push([number(wavelength)?, number(value)?]);
        }
        Self::curve(curve, loc)
    }

    /// From the lines of a file, each a wavelength and a value; `#` starts a comment.
    pub fn parse_file(text: &str, loc: &SourceLoc) -> Result<Self> {
        let mut curve = Vec::new();
        for line in text.lines().map(str::trim).filter(|line| !line.is_empty() && !line.starts_with('#')) {
            let mut numbers = line.split_whitespace().map(str::parse::<f64>);
            match (numbers.next(), numbers.next()) {
                (Some(Ok(wavelength)), Some(Ok(value))) => curve.push([wavelength, value]),
                _ => return Err(loc.invalid(format!("`{line}` is not a wavelength and a value"))),
            }
        }
        Self::curve(curve, loc)
    }

    /// Radiance of a black body at a temperature in kelvin (Planck's law), in W/(m² sr nm), times `scale`.
    pub fn blackbody(kelvin: f64, scale: f64, loc: &SourceLoc) -> Result<Self> {
        /// The two constants of Planck's law, for wavelengths in metres.
        const RADIATION: [f64; 2] = [1.191_042_972e-16, 1.438_776_877e-2];
        if kelvin <= 0.0 {
            return Err(loc.invalid(format!("a black body of {kelvin} K; its temperature must be positive")));
        }
        let planck = |nanometres: f64| {
            let wavelength = 1e-9 * nanometres;
            1e-9 * RADIATION[0] / (wavelength.powi(5) * (RADIATION[1] / (wavelength * kelvin)).exp_m1())
        };
        let wavelengths = (0..cie::TABLE.len()).map(|row| cie::FIRST + cie::STEP * row as f64);
        Ok(Self::Curve(wavelengths.map(|wavelength| [wavelength, scale * planck(wavelength)]).collect()))
    }

    /// From wavelengths and values.
    pub fn curve(curve: Vec<[f64; 2]>, loc: &SourceLoc) -> Result<Self> {
        if curve.as_flattened().iter().any(|value| !value.is_finite()) {
            return Err(loc.invalid("a spectrum holds a number that is not finite"));
        }
        if curve.is_empty() || curve.windows(2).any(|pair| pair[0][0] >= pair[1][0]) {
            return Err(loc.invalid("the wavelengths of a spectrum must rise"));
        }
        Ok(Self::Curve(curve))
    }

    fn at(curve: &[[f64; 2]], wavelength: f64) -> f64 {
        let next = curve.partition_point(|point| point[0] < wavelength);
        match (next.checked_sub(1).map(|last| curve[last]), curve.get(next)) {
            (Some([x0, y0]), Some([x1, y1])) => y0 + (y1 - y0) * (wavelength - x0) / (x1 - x0),
            (None, Some([x, y])) if *x == wavelength => *y,
            _ => 0.0,
        }
    }

    /// Linear sRGB of a curve under a light: daylight of luminance one, or equal power at all wavelengths.
    fn integrate(curve: &[[f64; 2]], daylight: bool) -> Rgb {
        let (mut xyz, mut luminance) = ([0.0; 3], 0.0);
        for i in 0..SAMPLES {
            let row = i as f64 / (SAMPLES - 1) as f64 * (cie::TABLE.len() - 1) as f64;
            let (k, f) =
                ((row as usize).min(cie::TABLE.len() - 2), row - (row as usize).min(cie::TABLE.len() - 2) as f64);
            let entry = |column: usize| cie::TABLE[k][column] * (1.0 - f) + cie::TABLE[k + 1][column] * f;
            let light = if daylight { entry(3) / DAYLIGHT } else { 1.0 };
            let value = Self::at(curve, cie::FIRST + cie::STEP * row) * light;
            (0..3).for_each(|c| xyz[c] += entry(c) * value);
            luminance += entry(1);
        }
        let [x, y, z] = xyz.map(|sum| sum / luminance);
        let rgb = vec3(
            (3.240_479 * x - 1.537_150 * y - 0.498_535 * z) as f32,
            (-0.969_256 * x + 1.875_991 * y + 0.041_556 * z) as f32,
            (0.055_648 * x - 0.204_043 * y + 1.057_311 * z) as f32,
        );
        rgb.max(Rgb::ZERO)
    }

    /// As a quantity that is seen in daylight, without bounds.
    pub fn in_daylight(&self) -> Rgb {
        match self {
            Self::Uniform(value) => Rgb::splat(*value),
            Self::Curve(curve) => Self::integrate(curve, true),
        }
    }

    /// As a reflectance; saturated curves would leave [0, 1].
    pub fn reflectance(&self) -> Rgb {
        match self {
            Self::Uniform(_) => self.in_daylight(),
            Self::Curve(_) => self.in_daylight().min(Rgb::ONE),
        }
    }

    /// As emitted light. Equal power at all wavelengths is not white in linear sRGB.
    pub fn emission(&self) -> Rgb {
        const EQUAL_POWER: Rgb = vec3(1.204_794, 0.948_291, 0.908_916);
        match self {
            Self::Uniform(value) => EQUAL_POWER * *value,
            Self::Curve(curve) => Self::integrate(curve, false),
        }
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    fn parse(text: &str) -> Result<Spectrum> {
        Spectrum::parse(text, &SourceLoc::file(Path::new("t")))
    }

    /// Expected colours are those that Mitsuba 3.9.1 shows for the same text.
    #[test]
    fn curves_have_the_colours_of_mitsuba() {
        let reflectance = parse("400:0.343, 500:0.747, 600:0.74, 700:0.137").unwrap().reflectance();
        assert!(reflectance.distance(vec3(0.596_924, 0.769_078, 0.536_862)) < 2e-5, "{reflectance}");
        let emission = parse("400:0, 500:8, 600:15.6, 700:18.4").unwrap().emission();
        assert!(emission.distance(vec3(20.7108, 10.8546, 2.77115)) < 2e-4, "{emission}");
        let index = parse("400:2, 500:1.8, 600:1.6, 700:1").unwrap().in_daylight();
        assert!(index.distance(vec3(1.42431, 1.71997, 1.9091)) < 5e-5, "{index}");
        let flat = parse("300:1 900:1").unwrap().emission();
        assert!(flat.distance(parse("1").unwrap().emission()) < 5e-4, "{flat}");
    }

    #[test]
    fn wavelengths_rise_and_numbers_are_numbers() {
        for text in ["500:1, 400:2", "400:1, 400:2", "400:x", "400;1:2", "", "nan"] {
            assert!(parse(text).is_err(), "{text}");
        }
    }
}
