//! Features of camera paths: albedo, normal, depth, position and ambient occlusion of the surface that a pixel shows.

use crate::film::{Features, Scattering};
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
        features: &mut Features,
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
            let scattering = features
                .scattering
                .with(Scattering::DIFFUSE, lobes == f32::INFINITY)
                .with(Scattering::GLOSSY, smooth && lobes < f32::INFINITY)
                .with(Scattering::SPECULAR, seen_through || !smooth)
                .with(Scattering::EMISSION, surfaces.emissive.get(lane));
            let roughness = lobes.clamp(0.0, 1.0);
            *features = Features { albedo, normal, depth, position: p, roughness, scattering, ..*features };
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

/// 1 if a cosine-distributed direction from the features' surface is unoccluded, else 0.
pub fn occlusion(scene: &Scene, features: &Features, u: Vec2) -> f32 {
    if features.normal == Vec3::ZERO {
        return 1.0;
    }
    let direction = Frame::around(features.normal).to_world(warp::cosine_hemisphere(u));
    f32::from(u8::from(scene.is_unoccluded(features.position, features.normal, direction, RANGE)))
}

/// Features of a camera ray that hits nothing: a point beyond the scene.
pub fn far(scene: &Scene, Ray { origin, direction, .. }: Ray) -> Features {
    let (center, radius) = scene.bounds().sphere();
    let depth = origin.distance(center) + radius;
    Features { depth, position: origin + direction * depth, occlusion: 1.0, roughness: 1.0, ..Features::default() }
}
