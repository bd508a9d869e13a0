//! Emitters that the camera sees, by rays of their own where they vary within pixels. At the edges of luminaires and windows
//! most of the error would be theirs, and such rays end at the first surface.

use super::camera::CameraSamples;
use super::record::PathRecord;
use crate::math::lanes::{Bits, LANES, Lanes, Mask};
use crate::math::{Rgb, luminance};
use crate::scene::packet::Surfaces;
use crate::scene::{Integrator, Purpose, Scene};

/// Cost of a camera ray, in path samples.
const COST: f32 = 0.05;
/// Largest number of cells along a pixel's side.
const LARGEST_GRID: u32 = 4;
/// Standard deviation of a path sample that is usual where light is scattered, over its mean.
const USUAL_DEVIATION: f32 = 0.5;
/// Cells along a pixel's side that are looked at to decide.
const PROBES: u32 = 2;

/// A cell of a pixel: the pixel's position in the list, the number of cells along its side, the cell's own number.
type Cell = (usize, u32, u32);

/// Cells along the side of every pixel of a tile, row by row, over which samples of directly seen light had best be averaged;
/// empty for ones. It depends on the scene alone, so that samples stay the same in whatever order they are taken.
///
/// With n cells of a cost c in path samples the error for the time, (V_d / n + V) (1 + n c) by the variances of directly seen
/// light and of everything else, is least at n = √(V_d / (V c)).
pub fn grids(scene: &Scene, pixels: &[(usize, usize)]) -> Vec<u32> {
    let shown = scene.has_environment() || scene.shapes().iter().any(|shape| shape.emitter.is_some());
    let Integrator { max_depth, hide_emitters, .. } = scene.integrator();
    if !shown || hide_emitters || max_depth == 0 {
        return Vec::new();
    }
    let camera = CameraSamples::new(scene, 0, 0, pixels);
    let per_pixel = PROBES * PROBES;
    let cells: Vec<Cell> =
        (0..pixels.len()).flat_map(|pixel| (0..per_pixel).map(move |cell| (pixel, PROBES, cell))).collect();
    let mut moments = vec![[0.0f32; 2]; pixels.len()];
    let mut surfaces = Surfaces::default();
    look(scene, &camera, &cells, &mut surfaces, |(pixel, ..), radiance, _| {
        let value = luminance(radiance);
        moments[pixel][0] += value / per_pixel as f32;
        moments[pixel][1] += value * value / per_pixel as f32;
    });
    let width = pixels.iter().take_while(|pixel| pixel.1 == pixels[0].1).count();
    let height = pixels.len() / width;
    let grid = |pixel: usize| {
        let [mean, square] = moments[pixel];
        let around = |at: usize, size: usize| at.saturating_sub(1)..(at + 2).min(size);
        let near = around(pixel / width, height).flat_map(|y| around(pixel % width, width).map(move |x| y * width + x));
        let step = near.map(|other| (moments[other][0] - mean).abs()).fold(0.0, f32::max);
        // An edge between two pixels may pass through this one: a twentieth of its area on the other side, say.
        let variance = (square - mean * mean).max(0.05 * step * step);
        let usual = (USUAL_DEVIATION * mean.max(0.05 * step)).powi(2);
        let best = (variance / (usual * COST).max(f32::MIN_POSITIVE)).sqrt();
        (best.sqrt().round() as u32).clamp(1, LARGEST_GRID)
    };
    if moments.iter().all(|&[mean, _]| mean == 0.0) {
        return Vec::new();
    }
    (0..pixels.len()).map(grid).collect()
}

/// Replaces the directly seen light of samples by the mean over a grid of cells, with a ray through each. `grids` has the
/// number of cells along a side for every sample; one leaves it as it is.
pub fn refine(scene: &Scene, camera: &CameraSamples, grids: &[u32], record: &mut PathRecord, surfaces: &mut Surfaces) {
    let PathRecord { samples, lights, .. } = record;
    let refined = grids.iter().enumerate().filter(|&(_, &side)| side > 1);
    let cells: Vec<Cell> = refined.flat_map(|(i, &side)| (0..side * side).map(move |cell| (i, side, cell))).collect();
    for &(i, ..) in &cells {
        samples[i].direct = Rgb::ZERO;
        lights.clear_direct(i);
    }
    look(scene, camera, &cells, surfaces, |(i, side, _), radiance, shape| {
        let share = radiance / (side * side) as f32;
        samples[i].direct += share;
        if let Some(emitter) = scene.emitter_at(shape) {
            lights.add_direct(scene, i, (emitter, share));
        }
    });
}

/// Traces a camera ray through a point of every cell; `see` takes the emitted radiance at its end, and the shape there.
fn look(
    scene: &Scene,
    camera: &CameraSamples,
    cells: &[Cell],
    surfaces: &mut Surfaces,
    mut see: impl FnMut(Cell, Rgb, Option<u32>),
) {
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
        let mut hit = scene.intersect_packet(&rays, active, Purpose::Camera, surfaces);
        if scene.integrator().pass_emitters {
            scene.pass_emitters(&rays, &mut hit, surfaces);
        }
        let radiance = scene.seen_radiance(&rays, surfaces, (active, hit));
        let shape = |lane| hit.get(lane).then(|| surfaces.shape.0[lane]);
        packet.iter().enumerate().for_each(|(lane, &cell)| see(cell, radiance.get(lane), shape(lane)));
    }
}
