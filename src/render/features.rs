//! What a camera path tells of the surface it shows: colour, normal, distance, how open it lies.

use crate::film::Features;
use crate::math::frame::Frame;
use crate::math::{Rgb, Vec2, Vec3, warp};
use crate::scene::bsdf::{BsdfSample, Lobe};
use crate::scene::packet::{Materials, Surfaces};
use crate::scene::{Ray, Scene};

/// Follows a path to the first surface with a smooth lobe, keeping the colour of what it passes.
#[derive(Clone, Copy, Default)]
pub struct FeatureWalk {
    found: bool,
    length: f32,
    tint: Option<Rgb>,
}

impl FeatureWalk {
    /// Whether it has been found.
    pub fn is_done(&self) -> bool {
        self.found
    }

    /// Comes to a surface from the point given.
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
        // The first surface stands in until a better one is found.
        if smooth || self.tint.is_none() {
            let tint = self.tint.unwrap_or(Rgb::ONE);
            let side = if surfaces.wi.z.0[lane] < 0.0 { -1.0 } else { 1.0 };
            let albedo = materials.albedo(scene, surfaces, lane) * tint;
            let (normal, depth) = (surfaces.frame.n.get(lane) * side, self.length);
            *features = Features { albedo, normal, depth, position: p, ..*features };
        }
        self.found = smooth;
    }

    /// Goes on through the surface.
    pub fn pass(&mut self, scattered: &BsdfSample) {
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
    f32::from(u8::from(scene.is_unoccluded(features.position, features.normal, direction, OPEN)))
}

/// The features of a ray that meets nothing: beyond everything.
pub fn far(scene: &Scene, Ray { origin, direction, .. }: Ray) -> Features {
    let (center, radius) = scene.bounds().sphere();
    let depth = origin.distance(center) + radius;
    Features { depth, position: origin + direction * depth, occlusion: 1.0, ..Features::default() }
}
