//! Cameras: where the rays of a film position start and where they go.

mod film;

pub use self::film::Crop;
use self::film::FilmWindow;
use std::rc::Rc;

use crate::error::Result;
use crate::image::io::DataWindow;
use crate::math::lanes::{Lanes, Lanes3};
use crate::math::{Mat4, Vec2, Vec3, Vec4, vec2, warp};
use crate::scene::Ray;
use crate::scene::load::props::Object;
use crate::scene::load::{self, Loader};
use crate::scene::packet::Rays;

/// Films with more pixels than this are taken for a mistake.
const MAX_PIXELS: u64 = 1 << 28;

/// A sensor as a file names it.
#[derive(Clone, Debug)]
pub struct SensorInfo {
    /// Its `id`, if it has one.
    pub id: Option<String>,
    /// Its type.
    pub plugin: String,
}

impl SensorInfo {
    /// Name and type of a sensor, whether or not it can be built.
    pub fn new(object: &Object) -> Self {
        Self { id: object.id.clone(), plugin: object.plugin.clone() }
    }
}

/// Looks along its local +z with +x to the left and +y up.
#[derive(Clone, Debug)]
pub struct Sensor {
    /// Image width in pixels.
    pub width: usize,
    /// Image height in pixels.
    pub height: usize,
    /// Samples per pixel that the file suggests.
    pub spp: u32,
    film: FilmWindow,
    to_world: Mat4,
    /// Half the full film's extent, at distance one where the view widens.
    half_extent: Vec2,
    /// Shift of the image centre, as a share of the film.
    principal_point: Vec2,
    projection: Projection,
    near: f32,
    far: f32,
}

impl Default for Sensor {
    /// At the origin with a default film.
    fn default() -> Self {
        let film = FilmWindow::default();
        Self {
            width: film.size.0,
            height: film.size.1,
            spp: DEFAULT_SPP,
            film,
            to_world: Mat4::IDENTITY,
            half_extent: Vec2::ONE,
            principal_point: Vec2::ZERO,
            projection: Projection::Pinhole,
            near: NEAR,
            far: FAR,
        }
    }
}

impl Sensor {
    /// A normal in the camera's space, where x is to the left, y up and z into the picture.
    pub fn to_camera(&self, normal: Vec3) -> Vec3 {
        // Normals go from camera to world by the inverse's transpose, and back by the transpose.
        (self.to_world.transpose() * normal.extend(0.0)).truncate().normalize_or_zero()
    }
}

/// How a film position becomes a ray.
#[derive(Clone, Copy, Debug)]
enum Projection {
    /// Through a point.
    Pinhole,
    /// Through a disk, sharp at a distance along z.
    Lens { radius: f32, focus: f32 },
    /// Along z everywhere.
    Parallel,
}

/// Samples per pixel of files that do not say.
const DEFAULT_SPP: u32 = 64;
/// The clip planes of files that do not say.
const NEAR: f32 = 1e-2;
const FAR: f32 = 1e4;

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
pub fn load(object: &Object, loader: &Loader, options: FilmOptions) -> Result<Sensor> {
    let Some((_, parameters)) = PLUGINS.iter().find(|(name, _)| *name == object.plugin) else {
        return Err(load::unknown(object, PLUGINS.iter().map(|(name, _)| *name)));
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

fn film_and_spp(object: &Object, loader: &Loader) -> Result<(Option<Rc<Object>>, u32)> {
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

impl Sensor {
    /// The ray through a film position in pixels, (0, 0) being the upper left corner of the image, and through a
    /// point of the lens in [0, 1)². It runs from the near to the far clip plane.
    pub fn ray(&self, film: Vec2, lens: Vec2) -> Ray {
        self.rays([film.x, film.y].map(Lanes::splat), [lens.x, lens.y].map(Lanes::splat)).get(0)
    }

    /// [`Sensor::ray`] for sixteen film positions.
    pub fn rays(&self, film: [Lanes; 2], lens: [Lanes; 2]) -> Rays {
        view(self, film, lens)
    }

    /// Rays all over the whole film, the middle one first, whatever its size and the part of it that is rendered.
    pub fn overview(&self) -> Vec<Ray> {
        const SIDE: usize = 7;
        let whole = Self { width: SIDE, height: SIDE, film: FilmWindow::default(), ..self.clone() };
        let middles = (0..SIDE * SIDE).map(|i| vec2((i % SIDE) as f32 + 0.5, (i / SIDE) as f32 + 0.5));
        let mut rays: Vec<Ray> = middles.map(|at| whole.ray(at, Vec2::splat(0.5))).collect();
        rays.swap(0, SIDE * SIDE / 2);
        rays
    }

    /// The same camera without clip planes.
    pub fn unclipped(&self) -> Self {
        Self { near: 0.0, far: f32::INFINITY, ..self.clone() }
    }

    /// Depths of the clip planes, near and far.
    pub fn clip_planes(&self) -> (f32, f32) {
        (self.near, self.far)
    }

    /// Whether the file asks for an alpha channel.
    pub fn wants_alpha(&self) -> bool {
        self.film.alpha
    }

    /// Position of the rendered pixels in the whole film, where they are a part of it.
    pub fn window(&self) -> Option<DataWindow> {
        self.film.part.map(|(crop, full)| DataWindow { origin: (crop.x, crop.y), full })
    }

    /// The part of the rendered pixels that is wanted, where there are more around it.
    pub fn inner(&self) -> Option<Crop> {
        self.film.inner
    }

    /// Whether the lens has an extent, so that pixels differ by their positions on it, too.
    pub fn has_lens(&self) -> bool {
        matches!(self.projection, Projection::Lens { .. })
    }
}

vectorized! {
    fn view(sensor: &Sensor, [x, y]: [Lanes; 2], [lens_u, lens_v]: [Lanes; 2]) -> Rays {
        // Window to film and film to the plane at distance one are one scale and one shift together.
        let (start, end) = (sensor.film.position(Vec2::ZERO), sensor.film.position(Vec2::ONE));
        let scale = -2.0 * (end - start) * sensor.half_extent / vec2(sensor.width as f32, sensor.height as f32);
        let shift = (Vec2::ONE - 2.0 * (start + sensor.principal_point)) * sensor.half_extent;
        let along = |at: Lanes, scale: f32, shift: f32| at * Lanes::splat(scale) + Lanes::splat(shift);
        let (x, y) = (along(x, scale.x, shift.x), along(y, scale.y, shift.y));
        let one = Lanes::splat(1.0);
        let (origin, direction) = match sensor.projection {
            Projection::Pinhole => (Lanes3::ZERO, Lanes3 { x, y, z: one }),
            Projection::Lens { radius, focus } => {
                let [u, v] = warp::disk_lanes([lens_u, lens_v]);
                let origin = Lanes3 { x: u, y: v, z: Lanes::ZERO } * Lanes::splat(radius);
                (origin, Lanes3 { x, y, z: one } * Lanes::splat(focus) - origin)
            }
            Projection::Parallel => (Lanes3 { x, y, z: Lanes::ZERO }, Lanes3::splat(Vec3::Z)),
        };
        let axis = |column: Vec4| Lanes3::splat(column.truncate());
        let [right, up, forward, position] =
            [sensor.to_world.x_axis, sensor.to_world.y_axis, sensor.to_world.z_axis, sensor.to_world.w_axis].map(axis);
        let to_world = |v: Lanes3| right * v.x + up * v.y + forward * v.z;
        let local = direction.normalize_or(Lanes3::splat(Vec3::Z));
        let along = to_world(local);
        // Planes are at depths along z; a scaled camera has its planes scaled.
        let length = along.dot(along).sqrt();
        let direction = along * (one / length);
        let distance = |depth: f32| Lanes::splat(depth) / local.z * length;
        let origin = to_world(origin) + position + direction * distance(sensor.near);
        Rays { origin, direction, t_far: distance(sensor.far - sensor.near) }
    }
}
