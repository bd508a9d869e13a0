//! A scene: geometry in Embree, materials, emitters, a sensor. Immutable once loaded and shared by all threads;
//! nothing fails after [`Scene::build`]. [`plugin`] is the wall to the files that it is read from.

pub mod accel;
pub mod bsdf;
pub mod closure;
pub mod emitter;
mod light_groups;
mod light_point;
pub mod packet;
pub mod plugin;
mod ray_log;
pub mod sensor;
pub mod shape;
pub mod spectrum;
mod stats;
pub mod surface;
pub mod texture;

use std::sync::Arc;

use glam::DVec3;

use self::accel::Accel;
use self::bsdf::Bsdf;
use self::emitter::{Candidate, Choice, Emitter, LightPoint, Receiver};
pub use self::light_groups::LightGroups;
use self::packet::{EmitterInfo, ShapeInfo};
pub use self::ray_log::{Purpose, Tally};
use self::sensor::{Sensor, SensorInfo};
pub use self::shape::Bounds;
use self::shape::Geometry;
pub use self::stats::SceneStats;
pub use self::surface::Surface;
use crate::error::Result;
use crate::math::{Mat4, Rgb, Vec3};
use std::path::PathBuf;

/// A ray with a unit direction.
#[derive(Clone, Copy, Debug)]
pub struct Ray {
    /// Origin.
    pub origin: Vec3,
    /// Direction, of length one.
    pub direction: Vec3,
    /// Length of the ray.
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
    /// Whether emitters that the camera sees are black.
    pub hide_emitters: bool,
    /// Whether, besides, the camera looks through shapes that emit as if they were not there.
    pub pass_emitters: bool,
}

impl Default for Integrator {
    fn default() -> Self {
        Self { max_depth: u32::MAX, rr_depth: 5, hide_emitters: false, pass_emitters: false }
    }
}

/// A surface with its material.
pub struct Shape {
    /// Its id in the scene file, or its type and line.
    pub name: Arc<str>,
    /// The same of the material.
    pub material: Arc<str>,
    /// The surface.
    pub geometry: Arc<Geometry>,
    /// The material.
    pub bsdf: Arc<dyn Bsdf>,
    /// Index among the emitters, if it is emissive.
    pub emitter: Option<u32>,
}

/// Shapes that are instanced together, any number of times.
pub struct Group {
    /// The shapes, in the group's own coordinates.
    pub shapes: Vec<Shape>,
    /// Group to world.
    pub placements: Vec<Mat4>,
    /// Ids of the instances, or their types and lines.
    pub names: Vec<Arc<str>>,
}

/// Everything that a scene is built from, as loaders find it.
pub struct SceneDescription {
    /// Shapes in world space, in the order of the file.
    pub shapes: Vec<Shape>,
    /// Shapes that are instanced.
    pub groups: Vec<Group>,
    /// Emitters, in the order of the shapes' indices.
    pub emitters: Vec<Box<dyn Emitter>>,
    /// Their ids, those of their shapes, or their types and lines.
    pub emitter_names: Vec<Arc<str>>,
    /// Factors of their chances to be sampled.
    pub emitter_weights: Vec<f32>,
    /// The camera.
    pub sensor: Sensor,
    /// Path depths.
    pub integrator: Integrator,
    /// The file's position of the origin that all coordinates are measured from.
    pub origin: DVec3,
    /// Hash of the scene's text.
    pub fingerprint: u64,
    /// Mesh and image files that it was read from.
    pub files: Vec<PathBuf>,
    /// Every sensor of the file.
    pub sensors: Vec<SensorInfo>,
    /// The loader's warnings.
    pub warnings: Vec<String>,
}

/// How a scene is built from its description.
#[derive(Clone, Copy, Debug)]
pub struct BuildOptions<'a> {
    /// Threads that build the hierarchy (0: all).
    pub threads: usize,
    /// Groups of emitters whose light is recorded by itself, as [`LightGroups::parse`] reads them.
    pub light_groups: Option<&'a str>,
    /// Whether packets evaluate materials and skip texture coordinates in faster ways where they can.
    pub fast_paths: bool,
    /// Whether every ray is kept, to measure the time of tracing alone.
    pub log_rays: bool,
}

/// Geometry, materials, emitters and sensor.
pub struct Scene {
    accel: Accel,
    /// Shapes in world space, then those of the groups.
    shapes: Vec<Shape>,
    instance_names: Vec<Arc<str>>,
    emitters: Vec<Box<dyn Emitter>>,
    light_groups: LightGroups,
    /// `None` when nothing emits.
    emitter_choice: Option<Choice>,
    /// Properties that packets use in place of virtual calls.
    shape_infos: Vec<ShapeInfo>,
    emitter_infos: Vec<EmitterInfo>,
    environment: Option<u32>,
    /// The environment, if it is an image.
    envmap: Option<u32>,
    sensor: Sensor,
    integrator: Integrator,
    origin: DVec3,
    fingerprint: u64,
    files: Vec<PathBuf>,
    sensors: Vec<SensorInfo>,
    warnings: Vec<String>,
}

impl Scene {
    /// Builds the acceleration structure and the emitter choice.
    pub fn build(parts: SceneDescription, options: BuildOptions) -> Result<Self> {
        let SceneDescription { mut shapes, groups, mut emitters, sensor, integrator, fingerprint, files, .. } = parts;
        let mut accel = Accel::build(&shapes, &groups, options.threads)?;
        if options.log_rays {
            accel.log_rays();
        }
        let instance_names = groups.iter().flat_map(|group| group.names.iter().cloned()).collect();
        shapes.extend(groups.into_iter().flat_map(|group| group.shapes));
        let numbered = (0u32..).zip(&emitters);
        let environments: Vec<_> = numbered.filter(|(_, emitter)| emitter.is_environment()).map(|(i, _)| i).collect();
        if environments.len() > 1 {
            let what = "the scene has more than one environment (envmap or constant emitter); it can have one";
            return Err(crate::error::Error::BadData(what.into()));
        }
        emitters.iter_mut().for_each(|emitter| emitter.enclose(accel.bounds()));
        let mut emitter_infos: Vec<_> = emitters.iter().map(|emitter| EmitterInfo::new(&**emitter)).collect();
        let candidates: Vec<_> = (0..emitters.len())
            .map(|i| Candidate {
                emitter: &*emitters[i],
                factor: parts.emitter_weights[i],
                triangles: emitter_infos[i].triangles(),
            })
            .collect();
        let emitter_choice = Choice::new(&candidates);
        for (i, info) in emitter_infos.iter_mut().enumerate() {
            info.set_chance(emitter_choice.as_ref().and_then(|choice| choice.constant(i)));
        }
        let light_groups =
            options.light_groups.map(|text| LightGroups::parse(text, &parts.emitter_names)).transpose()?;
        let info = |shape| if options.fast_paths { ShapeInfo::new(shape) } else { ShapeInfo::new(shape).general() };
        let shape_infos = shapes.iter().map(info).collect();
        let environment = environments.first().copied();
        let envmap = environment.filter(|&index| emitters[index as usize].envmap().is_some());
        Ok(Self {
            accel,
            shapes,
            emitters,
            instance_names,
            light_groups: light_groups.unwrap_or_default(),
            emitter_choice,
            shape_infos,
            emitter_infos,
            environment,
            envmap,
            sensor,
            integrator,
            origin: parts.origin,
            fingerprint,
            files,
            sensors: parts.sensors,
            warnings: parts.warnings,
        })
    }

    /// The first surface along a ray.
    pub fn intersect(&self, ray: Ray) -> Option<Surface> {
        let hit = self.accel.intersect(ray)?;
        let mut surface = self.accel.surface((&self.shapes, &self.shape_infos), &hit, ray);
        surface.epsilon = self.epsilon(surface.p);
        Some(surface)
    }

    /// The first surface along a camera ray, which passes emitters when they are to be hidden.
    pub fn intersect_from_camera(&self, mut ray: Ray) -> Option<Surface> {
        loop {
            let surface = self.intersect(ray)?;
            if !self.integrator.pass_emitters || self.shapes[surface.at.shape as usize].emitter.is_none() {
                return Some(surface);
            }
            let origin = surface.leave(ray.direction);
            ray = Ray { origin, t_far: ray.t_far - origin.distance(ray.origin), ..ray };
        }
    }

    fn epsilon(&self, p: Vec3) -> f32 {
        surface::epsilon(p, self.accel.size())
    }

    /// Whether a ray from a point on a surface with this normal is unoccluded for a `share` of the scene's size.
    pub fn is_unoccluded(&self, p: Vec3, n: Vec3, direction: Vec3, share: f32) -> bool {
        let from = surface::offset(p, n, self.epsilon(p), direction);
        !self.accel.blocked(from, from + direction * (share * self.accel.size()))
    }

    /// The material of a surface.
    pub fn bsdf(&self, surface: &Surface) -> &dyn Bsdf {
        &*self.shapes[surface.at.shape as usize].bsdf
    }

    /// Density with which [`Scene::sample_lights`] finds `point` from `from`.
    pub fn emitter_pdf(&self, from: &Receiver, point: &LightPoint) -> f32 {
        let Some(choice) = &self.emitter_choice else { return 0.0 };
        let chance = choice.probability(from, point.emitter as usize, point.at.primitive);
        if chance > 0.0 { chance * self.emitters[point.emitter as usize].pdf(from.p, point) } else { 0.0 }
    }

    /// Radiance that `point` sends along `direction`, which points away from the emitter.
    pub fn radiance(&self, point: &LightPoint, direction: Vec3) -> Rgb {
        self.emitters[point.emitter as usize].radiance(point, direction)
    }

    /// The surface as a point of its emitter, if it is emissive.
    pub fn light_point(&self, surface: &Surface) -> Option<LightPoint> {
        let emitter = self.shapes[surface.at.shape as usize].emitter?;
        Some(LightPoint::on_surface(surface, emitter))
    }

    /// The environment as seen along `direction`, if there is one.
    pub fn environment(&self, direction: Vec3) -> Option<LightPoint> {
        let emitter = self.environment?;
        Some(LightPoint { emitter, ..self.emitters[emitter as usize].environment_point(direction) })
    }

    /// A point of the environment in a direction, if there is one; its texture coordinates are left to the caller.
    pub fn far_point(&self, direction: Vec3) -> Option<LightPoint> {
        Some(LightPoint::at_infinity(direction, self.environment?))
    }

    /// Index of the emitter at the end of a ray, if there is one: the surface that it has hit if it has, else the environment.
    pub fn emitter_at(&self, shape: Option<u32>) -> Option<u32> {
        match shape {
            Some(shape) => self.shapes[shape as usize].emitter,
            None => self.environment,
        }
    }

    /// Groups of emitters whose light is recorded by itself.
    pub fn light_groups(&self) -> &LightGroups {
        &self.light_groups
    }

    /// The camera.
    pub fn sensor(&self) -> &Sensor {
        &self.sensor
    }

    /// Every sensor of the file, in order.
    pub fn sensors(&self) -> &[SensorInfo] {
        &self.sensors
    }

    /// Everything that the loader found to mean something else than it says.
    pub fn warnings(&self) -> &[String] {
        &self.warnings
    }

    /// The scene with one more warning.
    #[must_use]
    pub fn with_warning(mut self, warning: String) -> Self {
        self.warnings.push(warning);
        self
    }

    /// Path depths.
    pub fn integrator(&self) -> Integrator {
        self.integrator
    }

    /// Shapes with their materials; those of a group once, however often it is placed.
    pub fn shapes(&self) -> &[Shape] {
        &self.shapes
    }

    /// Ids of the instances of groups, or their types and lines, by number.
    pub fn instance_names(&self) -> &[Arc<str>] {
        &self.instance_names
    }

    /// All emitters.
    pub fn emitters(&self) -> &[Box<dyn Emitter>] {
        &self.emitters
    }

    /// Whether an environment surrounds the scene.
    pub fn has_environment(&self) -> bool {
        self.environment.is_some()
    }

    /// The file's position of the origin that coordinates here are measured from: zero, but for scenes far away from it.
    pub fn origin(&self) -> DVec3 {
        self.origin
    }

    /// The box around all shapes.
    pub fn bounds(&self) -> Bounds {
        self.accel.bounds()
    }

    /// Hash of the scene's text, which distinguishes scenes.
    pub fn fingerprint(&self) -> u64 {
        self.fingerprint
    }

    /// The fingerprint in hexadecimal, as headers have it.
    pub fn fingerprint_hex(&self) -> String {
        format!("{:016x}", self.fingerprint)
    }

    /// Mesh and image files that it was read from.
    pub fn files(&self) -> &[PathBuf] {
        &self.files
    }

    /// Traces all rays again that [`BuildOptions::log_rays`] has kept, or those of packets of one purpose, and does nothing else; returns their
    /// number and the number of hits.
    pub fn replay_rays(&self, purpose: Option<Purpose>) -> (usize, usize) {
        self.accel.replay_rays(purpose)
    }

    /// Numbers of the rays that [`BuildOptions::log_rays`] has kept, of a render on one thread.
    pub fn logged_rays(&self) -> Vec<Tally> {
        self.accel.logged_rays()
    }

    /// Embree's version, for `info`.
    pub fn embree_version(&self) -> (u32, u32, u32) {
        self.accel.version()
    }
}
