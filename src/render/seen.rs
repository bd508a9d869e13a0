//! Emitters that the camera sees, by rays of their own where they vary within pixels: at the edges of lamps and windows most
//! of the error would be theirs, and such rays end at the first surface.

use super::camera::CameraSamples;
use crate::film::Sample;
use crate::math::Rgb;
use crate::math::lanes::{Bits, LANES, Lanes, Mask};
use crate::scene::Scene;
use crate::scene::packet::Surfaces;

/// Replaces the directly seen light of samples by the mean over a grid of cells, with a ray through each. `grids` has the
/// number of cells along a side for every sample; one leaves it as it is.
pub fn refine(scene: &Scene, camera: &CameraSamples, grids: &[u32], samples: &mut [Sample], surfaces: &mut Surfaces) {
    let refined = grids.iter().enumerate().filter(|&(_, &side)| side > 1);
    let cells: Vec<_> = refined.flat_map(|(i, &side)| (0..side * side).map(move |cell| (i, side, cell))).collect();
    for &(i, _, cell) in &cells {
        if cell == 0 {
            samples[i].direct = Rgb::ZERO;
        }
    }
    for packet in cells.chunks(LANES) {
        let (mut hashes, mut numbers) = (Bits::ZERO, Bits::ZERO);
        for (lane, &(i, _, cell)) in packet.iter().enumerate() {
            (hashes.0[lane], numbers.0[lane]) = (camera.hash(i), cell);
        }
        let ([u, v], hashes) = camera.sampler.cell(hashes, numbers);
        let mut at = [Lanes::ZERO; 2];
        for (lane, &(i, side, cell)) in packet.iter().enumerate() {
            let (x, y) = camera.pixels[i];
            at[0].0[lane] = x as f32 + ((cell % side) as f32 + u.0[lane]) / side as f32;
            at[1].0[lane] = y as f32 + ((cell / side) as f32 + v.0[lane]) / side as f32;
        }
        let rays = camera.rays_through(scene, at, hashes);
        let active = Mask::first(packet.len());
        let mut hit = scene.intersect_packet(&rays, active, true, surfaces);
        if scene.integrator().pass_emitters {
            scene.pass_emitters(&rays, &mut hit, surfaces);
        }
        let radiance = scene.seen_radiance(&rays, surfaces, (active, hit));
        for (lane, &(i, side, _)) in packet.iter().enumerate() {
            samples[i].direct += radiance.get(lane) / (side * side) as f32;
        }
    }
}
