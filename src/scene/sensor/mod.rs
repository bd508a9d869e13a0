//! Cameras: where the rays of a film position start and where they go.

mod film;
mod plugins;

pub use self::film::Crop;
use self::film::FilmWindow;
use self::plugins::{DEFAULT_SPP, FAR, NEAR};
pub use self::plugins::{FilmOptions, PLUGINS, half_width, load};
use crate::image::io::DataWindow;
use crate::math::lanes::{Lanes, Lanes3};
use crate::math::{Mat4, Vec2, Vec3, Vec4, vec2, warp};
use crate::scene::Ray;
use crate::scene::packet::Rays;
use crate::scene::plugin::Object;

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
