//! Path tracing with next-event estimation and multiple importance sampling (Veach 1997), depths as Mitsuba's
//! `path` integrator counts them.

use super::{Sampler, View};
use crate::film::{Features, Sample};
use crate::math::frame::Frame;
use crate::math::{Rgb, Vec2, Vec3, vec2, warp};
use crate::scene::bsdf::{BsdfSample, Eval, Lobe};
use crate::scene::emitter::LightPoint;
use crate::scene::{Ray, Scene, Surface};

/// Chance of surviving Russian roulette is never above this, so that paths in white rooms end.
const MAX_SURVIVAL: f32 = 0.95;

/// A point on an emitter chosen at a vertex, seen from there and lighting it.
#[derive(Clone, Copy, Debug)]
pub struct Light {
    /// The point.
    pub point: LightPoint,
    /// Radiance it sends to the vertex.
    pub radiance: Rgb,
    /// Local direction towards it.
    pub wo: Vec3,
    /// Scattering from it: f |cos θ|, and the density of choosing the direction by the BSDF.
    pub eval: Eval,
    /// Density of choosing the point, per solid angle.
    pub pdf: f32,
}

/// The direction a path takes at a vertex.
#[derive(Clone, Copy, Debug)]
pub struct Scatter {
    /// The sampled direction.
    pub bsdf: BsdfSample,
    /// Chance of having survived Russian roulette after it.
    pub survival: f32,
}

/// An emitter that a path has run into by scattering.
#[derive(Clone, Copy, Debug)]
pub struct Emission {
    /// The point that was met.
    pub point: LightPoint,
    /// Radiance it sends back.
    pub radiance: Rgb,
    /// Density with which next-event estimation would have chosen it; 0 after a delta lobe.
    pub light_pdf: f32,
}

/// Watches a path as it is traced.
pub trait Recorder {
    /// A surface is reached with this throughput: f cos / pdf of everything before.
    fn vertex(&mut self, _surface: &Surface, _throughput: Rgb, _roughness: Option<f32>) {}
    /// The latest vertex is lit by a visible emitter point.
    fn light(&mut self, _light: Light) {}
    /// The path goes on from the latest vertex.
    fn scatter(&mut self, _scatter: Scatter) {}
    /// Going on from the latest vertex, the path meets an emitter.
    fn emission(&mut self, _emission: Emission) {}
}

impl Recorder for () {}

/// Power heuristic with exponent two, for a sample drawn with density `p` against one with `q`.
fn power_heuristic(p: f32, q: f32) -> f32 {
    let ratio = q / p;
    1.0 / (1.0 + ratio * ratio)
}

/// Traces the path of a view. Edges are left zero.
pub fn trace(scene: &Scene, sampler: &Sampler, view: View, recorder: &mut impl Recorder) -> Sample {
    let integrator = scene.integrator();
    let mut ray = view.ray(scene);
    let mut sample = Sample { features: far(scene, ray), ..Sample::default() };
    let (mut throughput, mut eta, mut depth) = (Rgb::ONE, 1.0, 0);
    let mut features = FeatureWalk::default();
    // Where the last direction came from, with its density; none for the camera.
    let mut last: Option<(Vec3, BsdfSample)> = None;
    loop {
        let hit = if last.is_none() { scene.intersect_from_camera(ray) } else { scene.intersect(ray) };
        let point = hit.as_ref().map_or_else(|| scene.environment(ray.direction), |hit| scene.light_point(hit));
        if let Some(point) = point.filter(|_| integrator.max_depth > 0) {
            let radiance = scene.radiance(&point, -ray.direction);
            if radiance != Rgb::ZERO {
                match last {
                    None if integrator.hide_emitters => {}
                    None => sample.direct = radiance,
                    Some((from, bsdf)) => {
                        let light_pdf = if bsdf.lobe.is_delta() { 0.0 } else { scene.emitter_pdf(from, &point) };
                        sample.color += throughput * radiance * power_heuristic(bsdf.pdf, light_pdf);
                        recorder.emission(Emission { point, radiance, light_pdf });
                    }
                }
            }
        }
        let Some(surface) = hit else { break };
        let bsdf = scene.bsdf(&surface);
        let roughness = bsdf.roughness(&surface);
        features.visit(&mut sample.features, scene, &surface, ray.origin, roughness.is_some());
        if depth + 1 >= integrator.max_depth {
            break;
        }
        recorder.vertex(&surface, throughput, roughness);
        let [choice, u, v, survival] = sampler.light(depth);
        if roughness.is_some() {
            if let Some(light) = light(scene, &surface, choice, vec2(u, v)) {
                let weight = power_heuristic(light.pdf, light.eval.pdf) / light.pdf;
                sample.color += throughput * light.eval.value * light.radiance * weight;
                recorder.light(light);
            }
        }
        let [lobe, u, v, _] = sampler.scatter(depth);
        let Some(scattered) = bsdf.sample(&surface, surface.wi, lobe, vec2(u, v)) else { break };
        throughput *= scattered.weight;
        eta *= scattered.eta;
        depth += 1;
        let brightest = throughput.max_element();
        let roulette = depth >= integrator.rr_depth;
        let chance = if roulette { (brightest * eta * eta).min(MAX_SURVIVAL) } else { 1.0 };
        if brightest <= 0.0 || (roulette && survival >= chance) {
            break;
        }
        throughput /= chance;
        sample.ambient.color += throughput;
        recorder.scatter(Scatter { bsdf: scattered, survival: chance });
        features.pass(&scattered);
        last = Some((surface.p, scattered));
        ray = surface.ray(scattered.wo);
    }
    sample
}

/// A visible emitter point that lights the surface, or none.
fn light(scene: &Scene, surface: &Surface, choice: f32, u: Vec2) -> Option<Light> {
    let (point, pdf) = scene.sample_emitter(surface, choice, u)?;
    let direction = point.direction(surface.p);
    let wo = surface.to_local(direction);
    let mut eval = scene.bsdf(surface).eval(surface, surface.wi, wo);
    eval.pdf = point.scatter_pdf(eval.pdf);
    let radiance = scene.radiance(&point, -direction);
    let lit = eval.value * radiance != Rgb::ZERO && scene.visible(surface, &point);
    lit.then_some(Light { point, radiance, wo, eval, pdf })
}

/// Follows a path to the first surface with a smooth lobe, keeping the colour of what it passes.
#[derive(Default)]
struct FeatureWalk {
    found: bool,
    length: f32,
    tint: Option<Rgb>,
}

impl FeatureWalk {
    fn visit(&mut self, features: &mut Features, scene: &Scene, surface: &Surface, from: Vec3, smooth: bool) {
        if self.found {
            return;
        }
        self.length += surface.p.distance(from);
        // The first surface stands in until a better one is found.
        if smooth || self.tint.is_none() {
            let tint = self.tint.unwrap_or(Rgb::ONE);
            let side = if surface.wi.z < 0.0 { -1.0 } else { 1.0 };
            let albedo = scene.bsdf(surface).albedo(surface) * tint;
            let (normal, depth) = (surface.frame.n * side, self.length);
            *features = Features { albedo, normal, depth, position: surface.p, ..*features };
        }
        self.found = smooth;
    }

    fn pass(&mut self, scattered: &BsdfSample) {
        // What a boundary squeezes radiance by is not its colour.
        let color = match scattered.lobe {
            Lobe::DeltaTransmit => scattered.weight * (scattered.eta * scattered.eta),
            _ => scattered.weight,
        };
        self.tint = Some(self.tint.unwrap_or(Rgb::ONE) * color.clamp(Rgb::ZERO, Rgb::ONE));
    }
}

/// Ambient occlusion reaches so far, over the size of the scene.
const OPEN: f32 = 0.1;

/// Whether a direction from the features' surface, chosen by its cosine, is open: 1 or 0.
pub fn occlusion(scene: &Scene, features: &Features, u: Vec2) -> f32 {
    if features.normal == Vec3::ZERO {
        return 1.0;
    }
    let direction = Frame::around(features.normal).to_world(warp::cosine_hemisphere(u));
    f32::from(u8::from(scene.is_open(features.position, features.normal, direction, OPEN)))
}

/// The features of a ray that meets nothing: beyond everything.
fn far(scene: &Scene, Ray { origin, direction, .. }: Ray) -> Features {
    let (center, radius) = scene.bounds().sphere();
    let depth = origin.distance(center) + radius;
    Features { depth, position: origin + direction * depth, occlusion: 1.0, ..Features::default() }
}
