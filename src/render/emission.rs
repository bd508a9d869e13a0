//! Emitters that paths hit by scattering, weighted against next-event estimation (Veach 1997).

use super::paths::Packet;
use super::vertices::Vertices;
use crate::math::Rgb;
use crate::scene::Scene;
use crate::scene::emitter::{EnvmapHits, LightPoint, Receiver};

/// An emitter that a path has hit.
pub struct EmitterHit {
    /// The point of the emitter.
    pub point: LightPoint,
    /// Radiance that it sends back along the path.
    pub radiance: Rgb,
    /// Density per solid angle with which next-event estimation would have sampled it; 0 after a delta lobe.
    pub light_pdf: f32,
    /// MIS-weighted contribution to the sample's colour.
    pub color: Rgb,
}

/// The emitter at the end of a path's latest segment: the surface that it has hit if `hit`, else the environment, which is
/// looked up already if it is an image.
pub fn emitter_hit(
    scene: &Scene,
    packet: &Packet,
    (vertices, lane): (&Vertices, usize),
    (hit, envmap): (bool, Option<&EnvmapHits>),
) -> Option<EmitterHit> {
    let direction = packet.rays.direction.get(lane);
    let envmap = envmap.filter(|_| !hit);
    let (point, radiance) = match envmap {
        Some(envmap) => (envmap.point(direction, lane), envmap.radiance.get(lane)),
        None => {
            let point =
                if hit { scene.light_point_of(&vertices.surfaces, lane) } else { scene.environment(direction) }?;
            (point, scene.radiance(&point, -direction))
        }
    };
    if radiance == Rgb::ZERO {
        return None;
    }
    let light_pdf = match envmap {
        _ if !packet.smooth.get(lane) => 0.0,
        Some(envmap) => envmap.pdf.0[lane],
        None => scene.emitter_pdf(&Receiver { p: packet.from.get(lane), n: packet.facing.get(lane) }, &point),
    };
    // Power heuristic with exponent two.
    let ratio = light_pdf / packet.pdf.0[lane];
    let color = packet.throughput.get(lane) * radiance / (1.0 + ratio * ratio);
    Some(EmitterHit { point, radiance, light_pdf, color })
}
