//! A scene: geometry in Embree, materials, emitters, a sensor. Immutable once loaded and shared by all threads;
//! nothing here fails after [`load::load`].

pub mod accel;
pub mod bsdf;
mod census;
pub mod emitter;
pub mod load;
pub mod packet;
mod ray_log;
pub mod sensor;
pub mod shape;
pub mod surface;
pub mod texture;

use std::sync::Arc;

use self::accel::Accel;
use self::bsdf::Bsdf;
pub use self::census::Census;
use self::emitter::{Choice, Emitter, LightPoint};
use self::packet::{Finish, Lamp};
use self::sensor::Sensor;
pub use self::shape::Bounds;
use self::shape::Geometry;
pub use self::surface::Surface;
use crate::error::Result;
use crate::math::{Mat4, Rgb, Vec3};
use std::path::PathBuf;

/// A ray with a unit direction.
#[derive(Clone, Copy, Debug)]
pub struct Ray {
    /// Where it starts.
    pub origin: Vec3,
    /// Where it goes, of length one.
    pub direction: Vec3,
    /// Where it ends.
    pub t_far: f32,
}

impl Ray {
    /// A ray without end.
    pub fn new(origin: Vec3, direction: Vec3) -> Self {
        Self { origin, direction, t_far: f32::INFINITY }
    }
}

/// How deep paths go, as Mitsuba's `path` integrator counts: edges from the sensor to the light.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Integrator {
    /// Longest path in edges: 1 is visible emitters only, 2 adds direct light. `u32::MAX`: no bound.
    pub max_depth: u32,
    /// Number of scattering events after which Russian roulette begins.
    pub rr_depth: u32,
    /// Whether the camera looks through emitters as if they were not there.
    pub hide_emitters: bool,
}

impl Default for Integrator {
    fn default() -> Self {
        Self { max_depth: u32::MAX, rr_depth: 5, hide_emitters: false }
    }
}

/// A surface with what it is made of.
pub struct Shape {
    /// Its surface.
    pub geometry: Arc<Geometry>,
    /// Its material.
    pub bsdf: Arc<dyn Bsdf>,
    /// Its number among the emitters, if it glows.
    pub emitter: Option<u32>,
}

/// Shapes that are placed in the world together, any number of times.
pub struct Group {
    /// The shapes, in the group's own coordinates.
    pub shapes: Vec<Shape>,
    /// Group to world.
    pub placements: Vec<Mat4>,
}

/// What a loader hands over.
pub struct Parts {
    /// Shapes that stand by themselves, in the order of the file.
    pub shapes: Vec<Shape>,
    /// Shapes that are placed as groups.
    pub groups: Vec<Group>,
    /// Emitters, numbered as the shapes name them.
    pub emitters: Vec<Box<dyn Emitter>>,
    /// The camera.
    pub sensor: Sensor,
    /// Path depths.
    pub integrator: Integrator,
    /// Hash of the scene's text.
    pub fingerprint: u64,
    /// Meshes and images that it was read from.
    pub files: Vec<PathBuf>,
}

/// Everything a path can meet.
pub struct Scene {
    accel: Accel,
    /// Those that stand by themselves, then those of the groups.
    shapes: Vec<Shape>,
    emitters: Vec<Box<dyn Emitter>>,
    /// `None` when nothing emits.
    emitter_choice: Option<Choice>,
    /// What packets have to know of the shapes, and of the emitters.
    finishes: Vec<Finish>,
    lamps: Vec<Lamp>,
    environment: Option<u32>,
    /// The environment, if it is an image that is chosen with the same chance everywhere.
    map: Option<u32>,
    sensor: Sensor,
    integrator: Integrator,
    fingerprint: u64,
    files: Vec<PathBuf>,
}

impl Scene {
    /// Builds the acceleration structure and the emitter choice.
    pub fn build(parts: Parts, threads: usize) -> Result<Self> {
        let Parts { mut shapes, groups, mut emitters, sensor, integrator, fingerprint, files } = parts;
        let accel = Accel::build(&shapes, &groups, threads)?;
        shapes.extend(groups.into_iter().flat_map(|group| group.shapes));
        let numbered = (0u32..).zip(&emitters);
        let surrounding: Vec<_> = numbered.filter(|(_, emitter)| emitter.is_environment()).map(|(i, _)| i).collect();
        if surrounding.len() > 1 {
            let what = "the scene has more than one environment (envmap or constant emitter); it can have one";
            return Err(crate::error::Error::Usage(what.into()));
        }
        emitters.iter_mut().for_each(|emitter| emitter.enclose(accel.bounds()));
        let emitter_choice = Choice::new(&emitters);
        let chance = |index| emitter_choice.as_ref().and_then(|choice| choice.constant(index));
        let lamps = emitters.iter().enumerate().map(|(i, emitter)| Lamp::new(&**emitter, chance(i))).collect();
        let finishes = shapes.iter().map(Finish::new).collect();
        let environment = surrounding.first().copied();
        let map = environment.filter(|&index| emitters[index as usize].map().is_some());
        Ok(Self {
            accel,
            shapes,
            emitters,
            emitter_choice,
            finishes,
            lamps,
            environment,
            map,
            sensor,
            integrator,
            fingerprint,
            files,
        })
    }

    /// The first surface along a ray.
    pub fn intersect(&self, ray: Ray) -> Option<Surface> {
        let hit = self.accel.intersect(ray)?;
        let mut surface = self.accel.surface(&self.shapes, &hit, ray);
        surface.epsilon = self.epsilon(surface.p);
        Some(surface)
    }

    /// The first surface along a camera ray, which passes emitters when they are to be hidden.
    pub fn intersect_from_camera(&self, mut ray: Ray) -> Option<Surface> {
        loop {
            let surface = self.intersect(ray)?;
            if !self.integrator.hide_emitters || self.shapes[surface.at.shape as usize].emitter.is_none() {
                return Some(surface);
            }
            let origin = surface.leave(ray.direction);
            ray = Ray { origin, t_far: ray.t_far - origin.distance(ray.origin), ..ray };
        }
    }

    fn epsilon(&self, p: Vec3) -> f32 {
        surface::epsilon(p, self.accel.size())
    }

    /// Whether nothing is met from a point on a surface with this normal along `direction`, for a `share` of the scene's
    /// size.
    pub fn is_open(&self, p: Vec3, n: Vec3, direction: Vec3, share: f32) -> bool {
        let from = surface::offset(p, n, self.epsilon(p), direction);
        !self.accel.blocked(from, from + direction * (share * self.accel.size()))
    }

    /// The material of a surface.
    pub fn bsdf(&self, surface: &Surface) -> &dyn Bsdf {
        &*self.shapes[surface.at.shape as usize].bsdf
    }

    /// Density with which [`Scene::sample_lights`] finds `point` from `from`.
    pub fn emitter_pdf(&self, from: Vec3, point: &LightPoint) -> f32 {
        let chance =
            self.emitter_choice.as_ref().map_or(0.0, |choice| choice.probability(from, point.emitter as usize));
        if chance > 0.0 { chance * self.emitters[point.emitter as usize].pdf(from, point) } else { 0.0 }
    }

    /// Radiance that `point` sends along `direction`, which points away from the emitter.
    pub fn radiance(&self, point: &LightPoint, direction: Vec3) -> Rgb {
        self.emitters[point.emitter as usize].radiance(point, direction)
    }

    /// The surface as a point of its emitter, if it is one.
    pub fn light_point(&self, surface: &Surface) -> Option<LightPoint> {
        let emitter = self.shapes[surface.at.shape as usize].emitter?;
        Some(LightPoint::on_surface(surface, emitter))
    }

    /// The environment as seen along `direction`, if there is one.
    pub fn environment(&self, direction: Vec3) -> Option<LightPoint> {
        let emitter = self.environment?;
        Some(LightPoint { emitter, ..self.emitters[emitter as usize].around(direction) })
    }

    /// The camera.
    pub fn sensor(&self) -> &Sensor {
        &self.sensor
    }

    /// Path depths.
    pub fn integrator(&self) -> Integrator {
        self.integrator
    }

    /// Shapes with their materials; those of a group once, however often it is placed.
    pub fn shapes(&self) -> &[Shape] {
        &self.shapes
    }

    /// All emitters.
    pub fn emitters(&self) -> &[Box<dyn Emitter>] {
        &self.emitters
    }

    /// Whether an environment surrounds the scene.
    pub fn has_environment(&self) -> bool {
        self.environment.is_some()
    }

    /// The box around all shapes.
    pub fn bounds(&self) -> Bounds {
        self.accel.bounds()
    }

    /// Hash of the scene's text, to tell scenes apart.
    pub fn fingerprint(&self) -> u64 {
        self.fingerprint
    }

    /// Meshes and images that it was read from.
    pub fn files(&self) -> &[PathBuf] {
        &self.files
    }

    /// Keeps every ray that is traced from now on, to know what they take by themselves.
    pub fn log_rays(&mut self) {
        self.accel.log_rays();
    }

    /// Traces all rays kept once more and does nothing else; returns their number, and that of those which met something.
    pub fn replay_rays(&self) -> (usize, usize) {
        self.accel.replay_rays()
    }

    /// Embree's version, for `info`.
    pub fn embree_version(&self) -> (u32, u32, u32) {
        self.accel.version()
    }
}
