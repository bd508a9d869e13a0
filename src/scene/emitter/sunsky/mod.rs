//! Sun and sky of a clear day: the sky of Hosek and Wilkie (2012) over the upper half of the environment, and the disk of
//! the sun.

mod position;
mod sun;

use std::f32::consts::{FRAC_PI_2, PI, TAU};

use hw_skymodel::rgb::{Channel, SkyParams, SkyState};

use self::position::Position;
use super::{Emitter, LightPoint, Position as PointPosition};
use crate::error::Result;
use crate::math::partition::Partition;
use crate::math::{Frame, Mat4, Rgb, Vec2, Vec3, luminance, vec2, vec3, warp};
use crate::scene::Bounds;
use crate::scene::plugin::{Loader, Object, Plugin};

const PARAMETERS: &str = "turbidity = 3, albedo = 0.3 (0.2 in files of version 0.6), sun_direction or latitude, \
    longitude, timezone, year, month, day, hour, minute, second; sun_scale = 1, sky_scale = 1, \
    sun_aperture = 0.5358 degrees, to_world; in version 0.6 scale, sun_radius_scale, stretch = 1, extend = false";

/// `sunsky`: z is up, or y in files of version 0.6.
pub const SUNSKY: Plugin<Box<dyn Emitter>> = Plugin { name: "sunsky", parameters: PARAMETERS, make };
/// `sky` of version 0.6.
pub const SKY: Plugin<Box<dyn Emitter>> = Plugin { name: "sky", parameters: "as sunsky, without the sun", make };
/// `sun` of version 0.6.
pub const SUN: Plugin<Box<dyn Emitter>> = Plugin { name: "sun", parameters: "as sunsky, without the sky", make };

/// Luminous efficacies of both renderers that radiances of the sky are divided by.
const SKY_UNITS: [f32; 2] = [106.750_26, 106.856_98];

fn make(object: &Object, loader: &mut dyn Loader) -> Result<Box<dyn Emitter>> {
    let is_old = object.string("convention", "3")? == "0.6";
    let to_world = object.transform("to_world")?;
    let turbidity = object.float("turbidity", 3.0)?;
    let albedo = object.color("albedo", Rgb::splat(if is_old { 0.2 } else { 0.3 }))?;
    // Resolutions are of images that the sky was baked into.
    object.ignore(&["resolution", "sampling_weight"]);
    if object.boolean("complex_sun", false)? {
        loader.warn(&object.loc_of("complex_sun"), "the sun's disk is equally bright everywhere")?;
    }
    let scale = object.float("scale", 1.0)?;
    let share = |name, of| if object.plugin == of { Ok(0.0) } else { object.float(name, scale) };
    let (sun_scale, sky_scale) = (share("sun_scale", "sky")?, share("sky_scale", "sun")?);
    let aperture = object.float("sun_aperture", 2.0 * sun::HALF_ANGLE.to_degrees())?;
    // A sun without extent would be a light of its own kind; a tiny one casts the same shadows.
    let half_angle = (0.5 * aperture.to_radians() * object.float("sun_radius_scale", 1.0)?).clamp(2e-4, FRAC_PI_2);
    let (stretch, extend) = (object.float("stretch", 1.0)?, object.boolean("extend", false)?);
    let to_sun = sun_direction(object, to_world, is_old)?;
    let elevation = to_sun.y.clamp(-1.0, 1.0).asin();
    if elevation <= 0.0 {
        loader.warn(&object.loc, "the sun is below the horizon: it is night")?;
    }
    let day = elevation > 0.0;
    let state = SkyState::new(&SkyParams { elevation: elevation.max(0.0), turbidity, albedo: albedo.to_array() });
    let state = state.map_err(|error| object.loc.invalid(error.to_string()))?;
    let disk = if is_old { sun::preetham(turbidity, elevation) } else { sun::hosek(turbidity, elevation) };
    // The same power, whatever the angle that it comes from.
    let solid_angle = |half: f32| 2.0 * TAU * (0.5 * half).sin().powi(2);
    let disk = disk * sun_scale * (solid_angle(sun::HALF_ANGLE) / solid_angle(half_angle));
    let sky = Sky { state, scale: sky_scale / SKY_UNITS[usize::from(is_old)], stretch, extend, to_sun, is_old, day };
    let disk = if day { disk } else { Rgb::ZERO };
    Ok(Box::new(SunSky::new(sky, disk, half_angle, to_world)))
}

/// Local direction towards the sun, with y up whatever the convention.
fn sun_direction(object: &Object, to_world: Mat4, is_old: bool) -> Result<Vec3> {
    if object.get("sun_direction").is_none() {
        let Position { zenith, azimuth } = Position::load(object)?;
        let ((sin, cos), (s, c)) = (zenith.sin_cos(), azimuth.sin_cos());
        return Ok(if is_old {
            vec3((s * sin) as f32, cos as f32, (-c * sin) as f32)
        } else {
            y_up(vec3((-c * sin) as f32, (-s * sin) as f32, cos as f32))
        });
    }
    if let Some(name) = position::PROPERTIES.into_iter().find(|name| object.get(name).is_some()) {
        return Err(object.loc_of(name).invalid(format!("give either `sun_direction` or `{name}`")));
    }
    let direction = to_world.inverse().transform_vector3(object.vector("sun_direction", Vec3::Y)?).try_normalize();
    let direction =
        direction.ok_or_else(|| object.loc_of("sun_direction").invalid("`sun_direction` has length zero"))?;
    Ok(if is_old { direction } else { y_up(direction) })
}

/// A direction of a frame with z up in one with y up.
fn y_up(direction: Vec3) -> Vec3 {
    vec3(direction.y, direction.z, direction.x)
}

fn z_up(direction: Vec3) -> Vec3 {
    vec3(direction.z, direction.x, direction.y)
}

/// Radiance of the sky alone.
struct Sky {
    state: SkyState,
    scale: f32,
    /// Factor by which the sky reaches below the horizon.
    stretch: f32,
    /// Whether it fades out below the horizon instead of ending there.
    extend: bool,
    /// Local direction towards the sun, y up.
    to_sun: Vec3,
    /// Conventions of version 0.6.
    is_old: bool,
    day: bool,
}

impl Sky {
    /// Radiance from a local direction, y up.
    fn radiance(&self, direction: Vec3) -> Rgb {
        let angle = direction.y.clamp(-1.0, 1.0).acos();
        let (mut theta, mut fade) = (angle / self.stretch, 1.0);
        if !self.day || (theta >= FRAC_PI_2 && !self.extend) {
            return Rgb::ZERO;
        }
        if self.extend && angle > FRAC_PI_2 {
            let rest = (2.0 - 2.0 * angle / PI).clamp(0.0, 1.0);
            fade = rest * rest * (3.0 - 2.0 * rest);
        }
        theta = theta.min(FRAC_PI_2 - 1e-4);
        let planar = vec2(direction.x, direction.z).normalize_or_zero() * theta.sin();
        let gamma = vec3(planar.x, theta.cos(), planar.y).dot(self.to_sun).clamp(-1.0, 1.0).acos();
        let channel = |channel| self.state.radiance(theta, gamma, channel).max(0.0);
        vec3(channel(Channel::R), channel(Channel::G), channel(Channel::B)) * (self.scale * fade)
    }
}

/// The sky with the sun's disk.
struct SunSky {
    sky: Sky,
    /// Radiance of the disk; zero without one.
    disk: Rgb,
    /// Local direction towards the disk's centre, y up.
    center: Vec3,
    /// One less the cosine of the disk's half angle.
    versine: f32,
    /// Share of samples that go to the disk.
    disk_share: f32,
    /// Density of the sky over azimuth and height, in which directions are even.
    partition: Option<Partition>,
    to_world: Mat4,
    to_local: Mat4,
    /// Power through an area of one.
    flux: f32,
    area: f32,
}

/// Cells of the grid around the sphere and from bottom to top.
const CELLS: (usize, usize) = (256, 256);

impl SunSky {
    fn new(sky: Sky, disk: Rgb, half_angle: f32, to_world: Mat4) -> Self {
        let direction = |i: usize| {
            let at = vec2((i % CELLS.0) as f32 + 0.5, (i / CELLS.0) as f32 + 0.5);
            direction(at / vec2(CELLS.0 as f32, CELLS.1 as f32))
        };
        let weights: Vec<f32> = (0..CELLS.0 * CELLS.1).map(|i| luminance(sky.radiance(direction(i)))).collect();
        let of_sky = weights.iter().sum::<f32>() / weights.len() as f32 * 2.0 * TAU;
        let versine = 2.0 * (0.5 * half_angle).sin().powi(2);
        let of_disk = luminance(disk) * TAU * versine;
        let flux = of_sky + of_disk;
        let (sin, cos) = (sky.to_sun.y.clamp(-1.0, 1.0).acos() * sky.stretch).sin_cos();
        let planar = vec2(sky.to_sun.x, sky.to_sun.z).normalize_or_zero() * sin;
        Self {
            center: vec3(planar.x, cos, planar.y),
            sky,
            disk,
            versine,
            disk_share: if flux > 0.0 { of_disk / flux } else { 0.0 },
            partition: Partition::new(&weights, CELLS.0),
            to_world,
            to_local: to_world.inverse(),
            flux,
            area: 1.0,
        }
    }

    fn to_world(&self, local: Vec3) -> Vec3 {
        let local = if self.sky.is_old { local } else { z_up(local) };
        self.to_world.transform_vector3(local).normalize_or(Vec3::Y)
    }

    fn to_local(&self, world: Vec3) -> Vec3 {
        let local = self.to_local.transform_vector3(world).normalize_or(Vec3::Y);
        if self.sky.is_old { local } else { y_up(local) }
    }

    /// Whether a local direction meets the disk. Its cosine would be too coarse.
    fn meets_disk(&self, local: Vec3) -> bool {
        self.disk != Rgb::ZERO && 0.5 * local.distance_squared(self.center) <= self.versine
    }
}

/// The local direction of a point of the unit square: azimuth, then height.
fn direction(at: Vec2) -> Vec3 {
    let (z, (sin, cos)) = (2.0 * at.y - 1.0, (TAU * at.x).sin_cos());
    let r = (1.0 - z * z).max(0.0).sqrt();
    vec3(r * sin, z, r * cos)
}

impl Emitter for SunSky {
    fn sample(&self, _from: Vec3, u: Vec2) -> Option<LightPoint> {
        let local = if u.x < self.disk_share {
            Frame::around(self.center).to_world(warp::cone(vec2(u.x / self.disk_share, u.y), self.versine))
        } else {
            let rest = (u.x - self.disk_share) / (1.0 - self.disk_share);
            direction(self.partition.as_ref()?.sample(vec2(rest, u.y)).0)
        };
        Some(LightPoint::at_infinity(self.to_world(local), 0))
    }

    fn pdf(&self, _from: Vec3, point: &LightPoint) -> f32 {
        let PointPosition::Infinity { direction } = point.position else { return 0.0 };
        let local = self.to_local(direction);
        let disk = if self.meets_disk(local) { self.disk_share / (TAU * self.versine) } else { 0.0 };
        let at = vec2((local.x.atan2(local.z) / TAU).rem_euclid(1.0), 0.5 * (local.y + 1.0));
        let sky = self.partition.as_ref().map_or(0.0, |partition| partition.pdf(at)) / (2.0 * TAU);
        disk + (1.0 - self.disk_share) * sky
    }

    fn radiance(&self, point: &LightPoint, _direction: Vec3) -> Rgb {
        let PointPosition::Infinity { direction } = point.position else { return Rgb::ZERO };
        let local = self.to_local(direction);
        self.sky.radiance(local) + if self.meets_disk(local) { self.disk } else { Rgb::ZERO }
    }

    fn power(&self) -> f32 {
        self.area * self.flux
    }

    fn enclose(&mut self, scene: Bounds) {
        self.area = scene.cross_section();
    }

    fn is_environment(&self) -> bool {
        true
    }

    fn name(&self) -> &'static str {
        "sunsky"
    }
}
