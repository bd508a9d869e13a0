//! The sun's position by date and place (Blanco-Muriel et al. 2001).

use std::f64::consts::TAU;

use crate::error::Result;
use crate::scene::plugin::Object;

/// Properties that say when and where; Tokyo on a summer afternoon unless they are given.
pub const PROPERTIES: [&str; 9] =
    ["latitude", "longitude", "timezone", "year", "month", "day", "hour", "minute", "second"];

/// Zenith angle, and azimuth clockwise from north, both in radians.
pub struct Position {
    /// Angle from straight up.
    pub zenith: f64,
    /// Angle from north towards the east.
    pub azimuth: f64,
}

impl Position {
    /// From the properties of an emitter.
    pub fn load(object: &Object) -> Result<Self> {
        const DEFAULTS: [f32; 9] = [35.6894, 139.6917, 9.0, 2010.0, 7.0, 10.0, 15.0, 0.0, 0.0];
        let mut values = [0.0; 9];
        for (value, (name, default)) in values.iter_mut().zip(PROPERTIES.into_iter().zip(DEFAULTS)) {
            *value = f64::from(object.float(name, default)?);
        }
        Ok(Self::new(values))
    }

    fn new([latitude, longitude, timezone, year, month, day, hour, minute, second]: [f64; 9]) -> Self {
        let hour = hour - timezone + (minute + second / 60.0) / 60.0;
        let days = {
            let a = ((month - 14.0) / 12.0).trunc();
            let julian = (1461.0 * (year + 4800.0 + a) / 4.0).trunc()
                + (367.0 * (month - 2.0 - 12.0 * a) / 12.0).trunc()
                - (3.0 * ((year + 4900.0 + a) / 100.0).trunc() / 4.0).trunc()
                + day
                - 32075.5;
            julian + hour / 24.0 - 2_451_545.0
        };
        let omega = 2.1429 - 0.001_039_459_4 * days;
        let mean_longitude = 4.895_063 + 0.017_202_791_698 * days;
        let anomaly = 6.240_060 + 0.017_201_969_9 * days;
        let ecliptic = mean_longitude + 0.033_416_07 * anomaly.sin() + 0.000_348_94 * (2.0 * anomaly).sin()
            - 0.000_113_4
            - 0.000_020_3 * omega.sin();
        let obliquity = 0.409_092_8 - 6.214e-9 * days + 0.000_039_6 * omega.cos();
        let right_ascension = (obliquity.cos() * ecliptic.sin()).atan2(ecliptic.cos()).rem_euclid(TAU);
        let declination = (obliquity.sin() * ecliptic.sin()).asin();
        let sidereal = 6.697_424_324_2 + 0.065_709_828_3 * days + hour;
        let hour_angle = (15.0 * sidereal + longitude).to_radians() - right_ascension;
        let (sin, cos) = latitude.to_radians().sin_cos();
        let zenith = (cos * hour_angle.cos() * declination.cos() + declination.sin() * sin).clamp(-1.0, 1.0).acos();
        let azimuth = (-hour_angle.sin()).atan2(declination.tan() * cos - sin * hour_angle.cos()).rem_euclid(TAU);
        // The earth has an extent.
        let parallax = 6371.01 / 149_597_890.0 * zenith.sin();
        Self { zenith: zenith + parallax, azimuth }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_sun_is_where_almanacs_have_it() {
        let tokyo = Position::new([35.6894, 139.6917, 9.0, 2010.0, 7.0, 10.0, 15.0, 0.0, 0.0]);
        let degrees = [tokyo.zenith.to_degrees(), tokyo.azimuth.to_degrees()];
        assert!((degrees[0] - 43.920_7).abs() < 1e-3 && (degrees[1] - 265.752).abs() < 1e-2, "{degrees:?}");
        // At noon of an equinox on the equator it is overhead, and twelve hours later below one's feet.
        let equator = |hour: f64| Position::new([0.0, 0.0, 0.0, 2024.0, 3.0, 20.0, hour, 7.0, 0.0]).zenith.to_degrees();
        assert!(equator(12.0) < 0.5 && equator(0.0) > 179.0, "{} {}", equator(12.0), equator(0.0));
    }
}
