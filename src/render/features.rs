//! Features of camera paths: albedo, normal, depth, position and ambient occlusion of the surface that a pixel shows.

use crate::film::{Features, Recorded, Sample, Scattering};
use crate::math::frame::Frame;
use crate::math::{Rgb, Vec2, Vec3, warp};
use crate::scene::bsdf::{BsdfSample, Lobe};
use crate::scene::packet::{Materials, Surfaces};
use crate::scene::{Ray, Scene};

/// State of the search for a path's first surface with a smooth lobe, with the throughput of the delta lobes before it.
#[derive(Clone, Copy, Default)]
pub struct FeatureWalk {
    found: bool,
    /// Whether the first surface has been left.
    left: bool,
    length: f32,
    tint: Option<Rgb>,
}

impl FeatureWalk {
    /// Whether the surface has been found.
    pub fn is_done(&self) -> bool {
        self.found
    }

    /// Visits a surface that the path reaches from the given point.
    pub fn visit(
        &mut self,
        sample: &mut Sample,
        scene: &Scene,
        (surfaces, materials, lane): (&Surfaces, &Materials, usize),
        from: Vec3,
    ) {
        let smooth = materials.smooth().get(lane);
        let p = surfaces.p.get(lane);
        self.length += p.distance(from);
        // The first surface is taken until one with a smooth lobe is found.
        if smooth || self.tint.is_none() {
            let tint = self.tint.unwrap_or(Rgb::ONE);
            let side = if surfaces.wi.z.0[lane] < 0.0 { -1.0 } else { 1.0 };
            let albedo = materials.albedo(scene, surfaces, lane) * tint;
            let (normal, depth) = (surfaces.frame.n.get(lane) * side, self.length);
            let (lobes, seen_through) = (materials.roughness().0[lane], self.tint.is_some());
            let scattering = sample
                .features
                .scattering
                .with(Scattering::DIFFUSE, lobes == f32::INFINITY)
                .with(Scattering::GLOSSY, smooth && lobes < f32::INFINITY)
                .with(Scattering::SPECULAR, seen_through || !smooth)
                .with(Scattering::EMISSION, surfaces.emissive.get(lane));
            let roughness = lobes.clamp(0.0, 1.0);
            sample.features = Features { albedo, normal, depth, roughness, scattering };
            sample.values.set(Recorded::Position, p.to_array());
        }
        self.found = smooth;
    }

    /// Leaves a surface; `same_side` of the first one as it was reached.
    pub fn leave(&mut self, features: &mut Features, same_side: bool) {
        if !self.left {
            let kind = if same_side { Scattering::REFLECTION } else { Scattering::TRANSMISSION };
            features.scattering = features.scattering.with(kind, true);
        }
        self.left = true;
    }

    /// Continues through a delta lobe.
    pub fn pass(&mut self, scattered: &BsdfSample) {
        // The change of radiance at a refracting boundary is not part of its colour.
        let color = match scattered.lobe {
            Lobe::DeltaTransmit => scattered.weight * (scattered.eta * scattered.eta),
            _ => scattered.weight,
        };
        self.tint = Some(self.tint.unwrap_or(Rgb::ONE) * color.clamp(Rgb::ZERO, Rgb::ONE));
    }
}

/// Range of ambient occlusion, as a share of the scene's size.
const RANGE: f32 = 0.1;

/// Sets the occlusion to 1 if a cosine-distributed direction from the surface that the sample shows is unoccluded, else to 0.
pub fn set_occlusion(sample: &mut Sample, scene: &Scene, u: Vec2) {
    let normal = sample.features.normal;
    let is_free = normal == Vec3::ZERO || {
        let direction = Frame::around(normal).to_world(warp::cosine_hemisphere(u));
        scene.is_unoccluded(sample.values.get(Recorded::Position).into(), normal, direction, RANGE)
    };
    sample.values.set(Recorded::Occlusion, [f32::from(u8::from(is_free))]);
}

/// Describes a camera ray that hits nothing, as far as it is known: a point beyond the scene.
pub fn set_far(sample: &mut Sample, scene: &Scene, Ray { origin, direction, .. }: Ray) {
    let (center, radius) = scene.bounds().sphere();
    let depth = origin.distance(center) + radius;
    sample.features = Features { depth, roughness: 1.0, ..Features::default() };
    sample.values.set(Recorded::Position, (origin + direction * depth).to_array());
    sample.values.set(Recorded::Occlusion, [1.0]);
}
