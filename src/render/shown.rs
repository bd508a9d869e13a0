//! Shapes that the camera sees, and their shares of pixels.

use rayon::prelude::*;

use super::camera::CameraSamples;
use crate::film::TILE;
use crate::math::lanes::{LANES, Mask};
use crate::math::rng;
use crate::scene::bsdf::Lobe;
use crate::scene::packet::Surfaces;
use crate::scene::{Purpose, Ray, Scene, Surface};

/// A shape, by its number, and the instance that it is in, `u32::MAX` if it is in none.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shown {
    /// Number of the shape.
    pub shape: u32,
    /// Number of the instance.
    pub instance: u32,
}

/// Shapes that a pixel shows, and how many of its samples show each.
pub type ShownShapes = Vec<(Shown, u32)>;

/// Surfaces that are passed before one counts whatever its material: more is a mistake of rounding.
const MOST_PASSED: u32 = 256;

/// Shapes of all pixels, row by row, by the camera rays of samples 0 to `spp`. Rays pass holes as often as light does.
pub fn shown_shapes(scene: &Scene, seed: u64, spp: u32) -> Vec<ShownShapes> {
    let (width, height) = (scene.sensor().width, scene.sensor().height);
    let rows = (0..height).step_by(TILE).collect::<Vec<_>>();
    let of_rows = |&top: &usize| {
        let bottom = (top + TILE).min(height);
        let pixels: Vec<_> = (top..bottom).flat_map(|y| (0..width).map(move |x| (x, y))).collect();
        let mut shown = vec![ShownShapes::new(); pixels.len()];
        let mut surfaces = Surfaces::default();
        for index in 0..spp {
            let camera = CameraSamples::new(scene, seed, index, &pixels);
            for first in (0..pixels.len()).step_by(LANES) {
                let hashes = camera.hashes(first);
                let rays = camera.rays(scene, first, hashes, &[]);
                let active = Mask::first(pixels.len() - first);
                let mut hit = scene.intersect_packet(&rays, active, Purpose::Camera, &mut surfaces);
                if scene.integrator().pass_emitters {
                    scene.pass_emitters(&rays, &mut hit, &mut surfaces);
                }
                for lane in hit.lanes() {
                    let mut shape = Some(Shown { shape: surfaces.shape.0[lane], instance: surfaces.instance.0[lane] });
                    if scene.shapes()[surfaces.shape.0[lane] as usize].bsdf.transmits() {
                        let (x, y) = pixels[first + lane];
                        let hash = rng::combine(seed, (y * width + x) as u64);
                        shape = behind_holes(scene, rays.get(lane), surfaces.get(lane), (hash, index));
                    }
                    let Some(shape) = shape else { continue };
                    let of_pixel = &mut shown[first + lane];
                    match of_pixel.iter_mut().find(|(other, _)| *other == shape) {
                        Some((_, count)) => *count += 1,
                        None => of_pixel.push((shape, 1)),
                    }
                }
            }
        }
        shown
    };
    rows.par_iter().flat_map_iter(of_rows).collect()
}

/// The golden ratio's share of one, by which numbers that follow each other are spread evenly.
const GOLDEN: f32 = 0.618_034;

/// The shape that a ray shows from a surface on, whose holes it passes by chance. Sample number `index` of a pixel with its own `hash`.
fn behind_holes(scene: &Scene, mut ray: Ray, mut surface: Surface, (hash, index): (u64, u32)) -> Option<Shown> {
    for passed in 0..MOST_PASSED {
        let hole = scene.bsdf(&surface).delta(&surface, surface.wi, Lobe::Null);
        let chance = hole.map_or(0.0, |hole| hole.probability);
        if (rng::unit(rng::combine(hash, u64::from(passed))) + GOLDEN * index as f32).fract() >= chance {
            break;
        }
        let origin = surface.leave(ray.direction);
        ray = Ray { origin, t_far: ray.t_far - origin.distance(ray.origin), ..ray };
        surface = scene.intersect_from_camera(ray)?;
    }
    Some(Shown { shape: surface.at.shape, instance: surface.instance })
}
