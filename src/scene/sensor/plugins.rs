//! Sensors from their objects.

use std::rc::Rc;

use super::film::FilmWindow;
use super::{Crop, MAX_PIXELS, Projection, Sensor};
use crate::error::Result;
use crate::math::vec2;
use crate::scene::plugin::{Loader, Object, unknown};

/// Samples per pixel of files that do not say.
pub(super) const DEFAULT_SPP: u32 = 64;
/// The clip planes of files that do not say.
pub(super) const NEAR: f32 = 1e-2;
pub(super) const FAR: f32 = 1e4;

const VIEW: &str = "fov or focal_length = 50mm, fov_axis = x (y, diagonal, smaller, larger), to_world, near_clip = 0.01, \
    far_clip = 10000, principal_point_offset_x = 0, principal_point_offset_y = 0, film, sampler";
const LENS: &str = "aperture_radius, focus_distance = far_clip, fov or focal_length = 50mm, \
    fov_axis = x (y, diagonal, smaller, larger), to_world, near_clip = 0.01, far_clip = 10000, \
    principal_point_offset_x = 0, principal_point_offset_y = 0, film, sampler";

/// Plugins and their parameters.
pub const PLUGINS: &[(&str, &str)] = &[
    ("perspective", VIEW),
    ("thinlens", LENS),
    ("orthographic", "to_world, near_clip = 0.01, far_clip = 10000, film, sampler"),
];

/// Changes of a sensor's film.
#[derive(Clone, Copy, Debug, Default)]
pub struct FilmOptions {
    /// Numbers of pixels of the whole film.
    pub size: Option<(usize, usize)>,
    /// The window of it that is rendered.
    pub crop: Option<Crop>,
    /// Pixels that are rendered around a window, too.
    pub overscan: usize,
}

/// Builds the sensor, with changes of its film.
pub fn load(object: &Object, loader: &dyn Loader, options: FilmOptions) -> Result<Sensor> {
    let Some((_, parameters)) = PLUGINS.iter().find(|(name, _)| *name == object.plugin) else {
        return Err(unknown(object, PLUGINS.iter().map(|(name, _)| *name)));
    };
    let (film, spp) = film_and_spp(object, loader)?;
    let film = FilmWindow::load(film.as_deref(), loader, options.size, options.crop)?;
    let film = film.with_overscan(options.overscan)?;
    let (width, height) = film.size;
    let pixels = (width as u64).saturating_mul(height as u64);
    if pixels == 0 || pixels > MAX_PIXELS {
        return Err(object.loc.invalid(format!("a film of {width}x{height} pixels; it may have 1 to {MAX_PIXELS}")));
    }
    // The window's own shape, were it as large as the whole film.
    let aspect = (width as f32 / film.extent.x) / (height as f32 / film.extent.y);
    let (near, far) = (object.float("near_clip", NEAR)?, object.float("far_clip", FAR)?);
    if !(near > 0.0 && far > near) {
        return Err(object.loc_of("near_clip").invalid(format!("clip planes at {near} and {far}")));
    }
    let projection = projection(object, far)?;
    let half_width = if let Projection::Parallel = projection { 1.0 } else { half_width(object, aspect)? };
    let sensor = Sensor {
        width,
        height,
        spp,
        film,
        to_world: loader.to_world(object)?,
        half_extent: vec2(half_width, half_width / aspect),
        principal_point: vec2(
            object.float("principal_point_offset_x", 0.0)?,
            object.float("principal_point_offset_y", 0.0)?,
        ),
        projection,
        near,
        far,
    };
    // Files name shutter times and the focus of pinholes; neither has a meaning here.
    object.ignore(&["focus_distance", "shutter_open", "shutter_close"]);
    loader.all_used(object, parameters)?;
    Ok(sensor)
}

fn film_and_spp(object: &Object, loader: &dyn Loader) -> Result<(Option<Rc<Object>>, u32)> {
    let (mut film, mut spp) = (None, i64::from(DEFAULT_SPP));
    for property in object.nested() {
        let nested = loader.resolve(property)?;
        property.take();
        match nested.class.as_str() {
            "film" => film = Some(nested),
            // Sample patterns are ours.
            "sampler" => spp = nested.integer("sample_count", spp)?,
            other => return Err(nested.loc.unsupported(format!("a {other} in a sensor; it takes film and sampler"))),
        }
    }
    let spp = u32::try_from(spp).ok().filter(|&spp| spp > 0);
    Ok((film, spp.ok_or_else(|| object.loc.invalid("`sample_count` is a number from 1 to four billion"))?))
}

fn projection(object: &Object, far: f32) -> Result<Projection> {
    match object.plugin.as_str() {
        "orthographic" => Ok(Projection::Parallel),
        "thinlens" => {
            let (radius, focus) = (object.float("aperture_radius", 0.0)?, object.float("focus_distance", far)?);
            if object.get("aperture_radius").is_none() || radius < 0.0 || focus <= 0.0 {
                let what = "`thinlens` needs an `aperture_radius` and a positive `focus_distance`";
                return Err(object.loc_of("aperture_radius").invalid(what));
            }
            Ok(Projection::Lens { radius, focus })
        }
        _ => Ok(Projection::Pinhole),
    }
}

/// Half the film's width at distance one.
pub fn half_width(object: &Object, aspect: f32) -> Result<f32> {
    let diagonal = (1.0 + 1.0 / (aspect * aspect)).sqrt();
    let focal_length = object.string("focal_length", "")?;
    if !focal_length.is_empty() {
        let millimetres = focal_length.trim_end_matches("mm").trim().parse::<f32>().ok().filter(|&f| f > 0.0);
        let loc = object.loc_of("focal_length");
        let millimetres = millimetres.ok_or_else(|| loc.invalid(format!("`{focal_length}` is not like 50mm")))?;
        // The diagonal of 35 mm film is the film's diagonal.
        return Ok(0.5 * 36f32.hypot(24.0) / millimetres / diagonal);
    }
    // Without either, a 50 mm lens.
    let default = 2.0 * (0.5 * 36f32.hypot(24.0) / 50.0).atan().to_degrees();
    let axes = ["x", "y", "diagonal", "smaller", "larger"];
    let axis = object.choice("fov_axis", &axes, if object.get("fov").is_some() { 0 } else { 2 })?;
    let fov = object.float("fov", default)?;
    if !(fov > 0.0 && fov < 180.0) {
        return Err(object.loc_of("fov").invalid(format!("a field of view of {fov} degrees; it must be in (0, 180)")));
    }
    let half = (0.5 * fov.to_radians()).tan();
    Ok(match axes[axis] {
        "y" => half * aspect,
        "diagonal" => half / diagonal,
        "smaller" if aspect > 1.0 => half * aspect,
        "larger" if aspect < 1.0 => half * aspect,
        _ => half,
    })
}
