//! The perspective camera and its film size.

use crate::error::Result;
use crate::math::{Mat4, Vec2, Vec3, vec2};
use crate::scene::Ray;
use crate::scene::load::Loader;
use crate::scene::load::props::Object;

/// A pinhole camera that looks along its local +z with +x to the left and +y up.
#[derive(Clone, Debug)]
pub struct Sensor {
    /// Film width in pixels.
    pub width: usize,
    /// Film height in pixels.
    pub height: usize,
    /// Samples per pixel that the file suggests.
    pub spp: u32,
    origin: Vec3,
    to_world: Mat4,
    /// Half the film's extent at distance one.
    half_extent: Vec2,
    /// Shift of the image centre, as a share of the film.
    principal_point: Vec2,
    near: f32,
}

/// Its properties, for messages and documentation.
pub const PARAMETERS: &str = "fov, focal_length, fov_axis (x, y, diagonal, smaller, larger), to_world, near_clip, far_clip, \
    principal_point_offset_x, principal_point_offset_y, film, sampler";

/// Builds the sensor; `size` overrides the film's.
pub fn load(object: &Object, loader: &mut Loader, size: Option<(usize, usize)>, max_pixels: u64) -> Result<Sensor> {
    if object.plugin != "perspective" {
        let what = format!("sensor `{}` is not known; there is perspective", object.plugin);
        return Err(object.place.unsupported(what));
    }
    let (mut film, mut spp) = ((768, 576), 64);
    for property in object.nested() {
        let nested = loader.resolve(property)?;
        property.take();
        match nested.class.as_str() {
            "film" => film = film_size(&nested)?,
            "sampler" => {
                spp = nested.integer("sample_count", 64)?;
                nested.ignore(&["seed"]);
                nested.all_used("sample_count, seed")?;
            }
            other => return Err(nested.place.unsupported(format!("a {other} in a sensor; it takes film and sampler"))),
        }
    }
    let (width, height) = size.unwrap_or(film);
    let pixels = (width as u64).saturating_mul(height as u64);
    if pixels == 0 || pixels > max_pixels {
        return Err(object.place.invalid(format!("a film of {width}x{height} pixels; it may have 1 to {max_pixels}")));
    }
    let spp = u32::try_from(spp).ok().filter(|&spp| spp > 0);
    let spp = spp.ok_or_else(|| object.place.invalid("`sample_count` must be at least 1"))?;
    let aspect = width as f32 / height as f32;
    let half_width = half_width(object, aspect)?;
    let to_world = object.transform("to_world")?;
    let principal_point =
        vec2(object.float("principal_point_offset_x", 0.0)?, object.float("principal_point_offset_y", 0.0)?);
    let near = object.float("near_clip", 1e-2)?;
    // Lenses and far planes do not apply to a pinhole that sees to infinity.
    object.ignore(&["far_clip", "focus_distance"]);
    object.all_used(PARAMETERS)?;
    let half_extent = vec2(half_width, half_width / aspect);
    let origin = to_world.transform_point3(Vec3::ZERO);
    Ok(Sensor { width, height, spp, origin, to_world, half_extent, principal_point, near })
}

fn half_width(object: &Object, aspect: f32) -> Result<f32> {
    let diagonal = (1.0 + 1.0 / (aspect * aspect)).sqrt();
    let focal_length = object.string("focal_length", "")?;
    if !focal_length.is_empty() {
        let millimetres = focal_length.trim_end_matches("mm").trim().parse::<f32>().ok().filter(|&f| f > 0.0);
        let place = object.place_of("focal_length");
        let millimetres = millimetres.ok_or_else(|| place.invalid(format!("`{focal_length}` is not like 50mm")))?;
        // The diagonal of 35 mm film is the film's diagonal.
        return Ok(0.5 * 36f32.hypot(24.0) / millimetres / diagonal);
    }
    // Without either, a 50 mm lens.
    let default = 2.0 * (0.5 * 36f32.hypot(24.0) / 50.0).atan().to_degrees();
    let axes = ["x", "y", "diagonal", "smaller", "larger"];
    let axis = object.choice("fov_axis", &axes, if object.get("fov").is_some() { 0 } else { 2 })?;
    let fov = object.float("fov", default)?;
    if !(fov > 0.0 && fov < 180.0) {
        return Err(object
            .place_of("fov")
            .invalid(format!("a field of view of {fov} degrees; it must be in (0, 180)")));
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

fn film_size(object: &Object) -> Result<(usize, usize)> {
    let dimension = |name: &str, default| {
        let value = object.integer(name, default)?;
        usize::try_from(value).map_err(|_| object.place_of(name).invalid(format!("`{name}` cannot be negative")))
    };
    let size = (dimension("width", 768)?, dimension("height", 576)?);
    // The output's format is the command line's to say, and pixels are means over their squares: gradients
    // between pixels are only defined for the box filter.
    object.ignore(&[
        "file_format",
        "pixel_format",
        "component_format",
        "banner",
        "high_quality_edges",
        "sample_border",
    ]);
    for property in object.nested() {
        if let super::load::props::Value::Object(filter) = &property.value {
            property.take();
            if filter.class != "rfilter" {
                return Err(filter.place.unsupported(format!("a {} in a film", filter.class)));
            }
        }
    }
    object.all_used("width, height, file_format, pixel_format, component_format, rfilter (taken as box)")?;
    Ok(size)
}

impl Sensor {
    /// The ray through a film position in pixels: (0, 0) is the upper left corner of the image.
    pub fn ray(&self, film: Vec2) -> Ray {
        let at = film / vec2(self.width as f32, self.height as f32) + self.principal_point;
        let local = ((Vec2::ONE - 2.0 * at) * self.half_extent).extend(1.0).normalize();
        let direction = self.to_world.transform_vector3(local).normalize();
        Ray { origin: self.origin + direction * (self.near / local.z), direction }
    }
}
