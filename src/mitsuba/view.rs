//! The scene as its camera sees it: an origin for scenes whose coordinates are large, as those of maps are, and clip planes that
//! leave nothing.

use glam::DVec3;

use crate::scene::{Ray, Scene};

/// Rays start a ten-thousandth of their coordinates off surfaces. Up to this many times of what the camera sees, that is
/// less than a hundredth of it.
const FARTHEST: f32 = 64.0;

/// A new origin for a scene whose camera is much farther from its present one than from what it sees; none for others.
pub fn near_camera(scene: &Scene) -> Option<DVec3> {
    let rays = scene.sensor().overview();
    let mut distances: Vec<f32> =
        rays.iter().filter_map(|&ray| Some(scene.intersect(ray)?.p.distance(ray.origin))).collect();
    distances.sort_by(f32::total_cmp);
    let (_, radius) = scene.bounds().sphere();
    let seen = distances.get(distances.len() / 2).copied().unwrap_or(radius);
    let camera = rays.first()?.origin;
    (camera.is_finite() && camera.length() > FARTHEST * seen).then(|| camera.as_dvec3())
}

/// The warning that everything in front of a camera is cut off by its clip planes.
pub fn clipped(scene: &Scene) -> Option<String> {
    let sensor = scene.sensor();
    let meets = |ray: &Ray| scene.intersect(*ray).is_some();
    if sensor.overview().iter().any(meets) || !sensor.unclipped().overview().iter().any(meets) {
        return None;
    }
    let (near, far) = sensor.clip_planes();
    Some(format!(
        "nothing is between the camera's near_clip {near} and its far_clip {far}, but there are surfaces nearer or farther: \
         the picture will be empty"
    ))
}
