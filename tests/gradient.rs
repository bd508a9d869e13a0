//! The gradient estimator: unbiased over all edges, clean at borders, the same colour as path tracing, shifts that
//! can be undone.

mod common;

use common::{ALL, bundled, film};
use fluxion::film::{Layer, Needs};
use fluxion::math::{Vec3, rng, vec3};
use fluxion::render::gradient::shift::{half_vector, reconnect};

/// Differences of an independent path-traced image, in standard errors of both: over all edges they must be
/// centred, of unit spread at most, and without a tail.
fn check_unbiased(name: &str, size: (usize, usize), spp: u32) {
    let scene = bundled(name, size);
    let gradient = film(&scene, spp, 1, Needs { edges: true, ..Needs::default() }).develop();
    let image = film(&scene, 4 * spp, 2, Needs::default()).develop();
    let (color, variance) = (image.get(Layer::Color).unwrap(), image.get(Layer::ColorVariance).unwrap());
    for (mean, mean_variance, step) in [(Layer::Dx, Layer::DxVariance, (1, 0)), (Layer::Dy, Layer::DyVariance, (0, 1))]
    {
        let (mean, mean_variance) = (gradient.get(mean).unwrap(), gradient.get(mean_variance).unwrap());
        let (mut sum, mut squares, mut beyond, mut count) = (0.0, 0.0, 0, 0);
        let (mut total, mut total_variance) = ([0.0f64; 3], [0.0f64; 3]);
        for y in 0..size.1 - step.1 {
            for x in 0..size.0 - step.0 {
                for c in 0..3 {
                    let here = f64::from(color.pixel(x, y)[c]);
                    let there = f64::from(color.pixel(x + step.0, y + step.1)[c]);
                    let v = mean_variance.pixel(x, y)[c] + variance.pixel(x, y)[c];
                    let v = f64::from(v + variance.pixel(x + step.0, y + step.1)[c]);
                    let difference = f64::from(mean.pixel(x, y)[c]) - (there - here);
                    if v <= 0.0 {
                        assert!(difference.abs() < 1e-6, "{name}: {difference} without variance at {x},{y}");
                        continue;
                    }
                    let z = difference / v.sqrt();
                    (sum, squares, count) = (sum + z, squares + z * z, count + 1);
                    beyond += usize::from(z.abs() > 4.0);
                    total[c] += difference;
                    total_variance[c] += v;
                }
            }
        }
        let n = f64::from(count);
        // Neighbouring differences share a pixel, so the mean of all is better known than n says: no bound is lost.
        assert!((sum / n).abs() < 6.0 / n.sqrt() + 0.02, "{name}: mean z {}", sum / n);
        assert!((squares / n).sqrt() < 1.15, "{name}: rms z {}", (squares / n).sqrt());
        assert!(beyond as f64 <= 0.01 * n, "{name}: {beyond} of {n} beyond four standard errors");
        for c in 0..3 {
            assert!(
                total[c].abs() < 5.0 * total_variance[c].sqrt(),
                "{name}: sum {} ± {}",
                total[c],
                total_variance[c].sqrt()
            );
        }
    }
}

macro_rules! unbiased {
    ($($test:ident: $scene:literal, $spp:literal;)*) => {
        $(#[test] fn $test() { check_unbiased($scene, (24, 18), $spp); })*
    };
}

unbiased! {
    unbiased_between_diffuse_surfaces: "unit/diffuse", 512;
    unbiased_on_rough_conductors: "unit/rough-conductor", 1024;
    unbiased_through_glass: "unit/dielectric", 512;
    unbiased_under_an_environment: "unit/environment", 1024;
    unbiased_around_occluders: "unit/occluder", 512;
    unbiased_on_plastic: "unit/plastic", 1024;
    unbiased_through_masks: "unit/mask", 1024;
    unbiased_on_bumps: "unit/bump", 512;
    unbiased_behind_a_pane: "unit/thin-pane", 1024;
    unbiased_under_sphere_lights: "unit/sphere-light", 512;
    unbiased_between_mirrors: "unit/mirror-rooms", 1024;
    unbiased_in_a_closed_box: "cornell-box", 256;
}

#[test]
fn colour_is_the_path_tracers_bit_for_bit_with_and_without_gradients() {
    for name in ["cornell-box", "glossy-metal", "glass-caustic"] {
        let scene = bundled(name, (24, 20));
        let plain = film(&scene, 9, 5, Needs::default()).develop();
        let full = film(&scene, 9, 5, ALL).develop();
        for layer in [Layer::Color, Layer::ColorVariance, Layer::Direct] {
            assert_eq!(plain.get(layer), full.get(layer), "{name}: {}", layer.name());
        }
    }
}

#[test]
fn in_a_furnace_every_pixel_is_one_and_borders_are_like_the_inside() {
    let scene = bundled("unit/furnace", (21, 13));
    let frame = film(&scene, 64, 1, ALL).develop();
    let mut image = frame.get(Layer::Color).unwrap().clone();
    image.add(frame.get(Layer::Direct).unwrap());
    let mean = |inside: bool| {
        let border = |x: usize, y: usize| x == 0 || y == 0 || x == 20 || y == 12;
        let pixels: Vec<_> = (0..21 * 13).filter(|i| border(i % 21, i / 21) != inside).collect();
        pixels.iter().map(|i| f64::from(image.rgb(i % 21, i / 21).x)).sum::<f64>() / pixels.len() as f64
    };
    assert!((mean(true) - 1.0).abs() < 0.02, "{}", mean(true));
    assert!((mean(false) - 1.0).abs() < 0.02, "{}", mean(false));
    // The last column and row have no edge.
    let (dx, dy) = (frame.get(Layer::Dx).unwrap(), frame.get(Layer::Dy).unwrap());
    assert!((0..13).all(|y| dx.pixel(20, y) == [0.0; 3]) && (0..21).all(|x| dy.pixel(x, 12) == [0.0; 3]));
}

#[test]
fn correlation_makes_gradients_far_less_noisy_than_colours() {
    let scene = bundled("cornell-box", (64, 64));
    let frame = film(&scene, 64, 1, ALL).develop();
    let sum = |layer| frame.get(layer).unwrap().data.iter().map(|&v| f64::from(v)).sum::<f64>();
    assert!(sum(Layer::DxVariance) < 0.15 * 2.0 * sum(Layer::ColorVariance));
}

fn direction(i: u64) -> Vec3 {
    let u = |k| rng::unit(rng::combine(rng::mix(i), k));
    vec3(2.0 * u(0) - 1.0, 2.0 * u(1) - 1.0, 0.1 + u(2)).normalize()
}

/// The area that two small changes of a direction span after a map, over the area before.
fn numeric_jacobian(wo: Vec3, map: impl Fn(Vec3) -> Vec3) -> f32 {
    let (a, h) = (wo.any_orthonormal_vector(), 2e-3);
    let b = wo.cross(a);
    let slope = |t: Vec3| (map((wo + t * h).normalize()) - map((wo - t * h).normalize())) / (2.0 * h);
    slope(a).cross(slope(b)).length()
}

#[test]
fn half_vector_copies_can_be_undone_and_their_jacobian_is_the_change_of_solid_angle() {
    for i in 0..200 {
        let (wi, wo, other_wi) = (direction(3 * i), direction(3 * i + 1), direction(3 * i + 2));
        let Some((other_wo, jacobian)) = half_vector::reflect(wi, wo, other_wi) else { continue };
        let (back, inverse) = half_vector::reflect(other_wi, other_wo, wi).unwrap();
        assert!(back.distance(wo) < 1e-4 && (jacobian * inverse - 1.0).abs() < 1e-3);
        if jacobian < 20.0 {
            let numeric =
                numeric_jacobian(wo, |wo| half_vector::reflect(wi, wo, other_wi).map_or(Vec3::ZERO, |(w, _)| w));
            assert!((numeric / jacobian - 1.0).abs() < 0.05, "{numeric} {jacobian}");
        }
    }
}

#[test]
fn reconnection_jacobians_invert_each_other_and_are_the_change_of_solid_angle() {
    let scene = bundled("unit/diffuse", (8, 6));
    let target = scene.intersect(scene.sensor().ray(fluxion::math::vec2(4.0, 5.0))).unwrap();
    for i in 0..100 {
        let (base, offset) = (
            target.p + target.frame.to_world(direction(i)) * 1.5,
            target.p + target.frame.to_world(direction(i + 500)),
        );
        let jacobian = reconnect::jacobian(base, offset, &target);
        assert!((jacobian * reconnect::jacobian(offset, base, &target) - 1.0).abs() < 1e-4);
        // Directions from the base, by way of the target's plane, as directions from the offset.
        let map = |w: Vec3| {
            let t = (target.p - base).dot(target.n) / w.dot(target.n);
            (base + w * t - offset).normalize()
        };
        let numeric = numeric_jacobian((target.p - base).normalize(), map);
        assert!((numeric / jacobian - 1.0).abs() < 0.05, "{numeric} {jacobian}");
    }
}
