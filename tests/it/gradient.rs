//! The gradient estimator: unbiased over all edges, clean at borders, the same colour as path tracing, shifts that
//! can be undone.

use crate::common::{bundled, check_zero, film, shifted_film};
use fluxion::film::{EdgeNeed, Frame, Layer, Needs};
use fluxion::image::Image;
use fluxion::internals::math::lanes::{Lanes, Lanes3, Mask};
use fluxion::internals::math::{Vec3, rng, vec2, vec3};
use fluxion::render::Shift;
use fluxion::render::gradient::reconnect::{connection, half_vector};

/// Independent pairs of a gradient render and a path-traced one.
const RUNS: u64 = 16;

/// In every run and for every edge, the sampled difference minus that of an independent path-traced image has mean
/// zero. Over all edges the means must look like it: centred, spread as Student's t with 15 degrees of freedom, without
/// a tail.
fn check_unbiased(name: &str, spp: u32, shift: Shift) {
    let size = (24, 18);
    let scene = bundled(name, size);
    for (layer, step) in [(Layer::Dx, (1, 0)), (Layer::Dy, (0, 1))] {
        let runs: Vec<Vec<f64>> = (0..RUNS)
            .map(|run| {
                let edges = Needs::EDGES;
                let gradient = shifted_film(&scene, spp, 2 * run, edges, shift).develop();
                let image = film(&scene, 2 * spp, 2 * run + 1, Needs::default()).develop();
                errors(gradient.get(layer).unwrap(), image.get(Layer::Color).unwrap(), step)
            })
            .collect();
        // Every colour is in up to four edges, in both directions, so their sum is known better than n says.
        check_zero(name, &runs);
        let n = RUNS as f64;
        // The sum over all edges of a run, whose mean is known best.
        let totals: Vec<f64> = runs.iter().map(|run| run.iter().sum()).collect();
        let mean = totals.iter().sum::<f64>() / n;
        let variance = totals.iter().map(|total| (total - mean).powi(2)).sum::<f64>() / (n - 1.0) / n;
        assert!(mean.abs() < 5.0 * variance.sqrt(), "{name}: sum of all edges off by {mean} ± {}", variance.sqrt());
    }
}

/// Sampled differences minus those of an image, edge by edge and channel by channel.
fn errors(gradient: &Image, image: &Image, step: (usize, usize)) -> Vec<f64> {
    let mut errors = Vec::new();
    for y in 0..image.height - step.1 {
        for x in 0..image.width - step.0 {
            let error = gradient.rgb(x, y) - (image.rgb(x + step.0, y + step.1) - image.rgb(x, y));
            errors.extend(error.to_array().map(f64::from));
        }
    }
    errors
}

macro_rules! unbiased {
    ($($test:ident: $scene:literal, $spp:literal, $shift:expr;)*) => {
        $(#[test] fn $test() { check_unbiased($scene, $spp, $shift); })*
    };
}

unbiased! {
    unbiased_between_diffuse_surfaces: "unit/diffuse", 64, Shift::default();
    unbiased_on_rough_conductors: "unit/rough-conductor", 64, Shift::default();
    unbiased_through_glass: "unit/dielectric", 64, Shift::default();
    unbiased_under_an_environment: "unit/environment", 64, Shift::default();
    unbiased_around_occluders: "unit/occluder", 64, Shift::default();
    unbiased_on_plastic: "unit/plastic", 64, Shift::default();
    unbiased_through_masks: "unit/mask", 64, Shift::default();
    unbiased_on_rough_plastic: "unit/rough-plastic", 64, Shift::default();
    unbiased_on_bumps: "unit/bump", 64, Shift::default();
    unbiased_behind_a_pane: "unit/thin-pane", 64, Shift::default();
    unbiased_under_sphere_lights: "unit/sphere-light", 64, Shift::default();
    unbiased_between_mirrors: "unit/mirror-rooms", 64, Shift::default();
    unbiased_in_a_closed_box: "cornell-box", 64, Shift::default();
    unbiased_on_glossy_metals: "glossy-metal", 64, Shift::default();
    unbiased_through_a_lens_under_points_of_light: "unit/lens", 64, Shift::default();
    unbiased_through_rough_glass: "unit/rough-glass", 64, Shift::default();
    unbiased_where_rough_glass_is_refracted_about_half_vectors: "unit/rough-glass", 64, Shift::default().with_threshold(0.5);
    unbiased_on_instances: "unit/instances", 64, Shift::default();
    unbiased_on_principled_materials: "unit/principled", 64, Shift::default();
    unbiased_on_bent_and_blended_materials: "unit/normal-map", 64, Shift::default();
    unbiased_on_layered_materials: "unit/layered", 64, Shift::default();
    unbiased_under_sun_and_sky: "unit/sun-and-sky", 64, Shift::default();
    unbiased_by_replay: "unit/occluder", 64, Shift::named("replay").unwrap();
    unbiased_by_replay_through_glass: "unit/dielectric", 64, Shift::named("replay").unwrap();
}

#[test]
fn colour_is_the_path_tracers_bit_for_bit_with_and_without_gradients() {
    for name in ["cornell-box", "glossy-metal", "glass-caustic"] {
        let scene = bundled(name, (24, 20));
        let plain = film(&scene, 9, 5, Needs::default()).develop();
        let full = film(&scene, 9, 5, Needs::ALL).develop();
        for layer in [Layer::Color, Layer::ColorVariance, Layer::Direct] {
            assert_eq!(plain.get(layer), full.get(layer), "{name}: {}", layer.name());
        }
    }
}

#[test]
fn in_a_furnace_every_pixel_is_one_and_borders_are_like_the_inside() {
    let scene = bundled("unit/furnace", (21, 13));
    let frame = film(&scene, 64, 1, Needs::ALL).develop();
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
fn replayed_paths_resemble_each_other_less_than_reconnected_ones_and_more_than_strangers() {
    let scene = bundled("cornell-box", (64, 64));
    let edges = Needs::EDGES;
    let ratio = |shift| {
        let frame = shifted_film(&scene, 64, 1, edges, shift).develop();
        let sum = |layer| frame.get(layer).unwrap().data.iter().map(|&v| f64::from(v)).sum::<f64>();
        sum(Layer::DxVariance) / (2.0 * sum(Layer::ColorVariance))
    };
    let (replayed, reconnected) = (ratio(Shift::named("replay").unwrap()), ratio(Shift::default()));
    // Each end of an edge takes half of the difference: of strangers their sum would have half of both variances.
    assert!(replayed < 0.3 * 0.5 && reconnected < replayed, "{replayed} {reconnected}");
}

#[test]
fn correlation_makes_gradients_far_less_noisy_than_colours() {
    let scene = bundled("cornell-box", (64, 64));
    let frame = film(&scene, 64, 1, Needs::ALL).develop();
    let sum = |layer| frame.get(layer).unwrap().data.iter().map(|&v| f64::from(v)).sum::<f64>();
    assert!(sum(Layer::DxVariance) < 0.15 * 2.0 * sum(Layer::ColorVariance));
}

#[test]
fn differences_are_left_out_where_they_are_costly_and_stay_right() {
    let scene = bundled("glass-caustic", (64, 48));
    let thinned = Needs { edges: EdgeNeed::Thinned, ..Needs::EDGES };
    let [few, all] = [thinned, Needs::EDGES].map(|needs| film(&scene, 47, 1, needs).develop());
    // Colours do not know of differences.
    assert_eq!(few.get(Layer::Color), all.get(Layer::Color));
    // The first eight, then one, two or all of every three.
    let counts = &few.get(Layer::EdgeSamples).unwrap().data;
    assert!(counts.iter().all(|count| [8.0 + 13.0, 8.0 + 26.0, 47.0].contains(count)));
    let mean = counts.iter().sum::<f32>() / counts.len() as f32;
    assert!((21.0..44.0).contains(&mean), "{mean}");
    // The same differences within the noise of both, and that much more noise.
    let of = |frame: &Frame, layer| frame.get(layer).unwrap().data.iter().map(|&v| f64::from(v)).sum::<f64>();
    let noise = (of(&few, Layer::DxVariance) + of(&all, Layer::DxVariance)).sqrt();
    let apart = (of(&few, Layer::Dx) - of(&all, Layer::Dx)).abs();
    assert!(apart < 4.0 * noise, "{apart} {noise}");
    // Where they cost little, nearly all samples have them.
    let frame = film(&bundled("door-ajar", (64, 48)), 47, 1, thinned).develop();
    let cheap = frame.get(Layer::EdgeSamples).map_or(47.0, |counts| counts.data.iter().sum::<f32>() / 64.0 / 48.0);
    assert!(cheap > 43.0, "{cheap}");
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

/// A direction and its Jacobian, of vectors of one.
type Copied = (Lanes3<1>, Lanes<1>, Mask<1>);

fn alone((direction, jacobian, possible): Copied) -> Option<(Vec3, f32)> {
    possible.get(0).then(|| (direction.get(0), jacobian.0[0]))
}

fn reflect(wi: Vec3, wo: Vec3, other_wi: Vec3) -> Option<(Vec3, f32)> {
    let [wi, wo, other_wi] = [wi, wo, other_wi].map(Lanes3::splat);
    alone(half_vector::reflect(wi, wo, other_wi))
}

fn refract(wi: Vec3, wo: Vec3, other_wi: Vec3, eta: f32) -> Option<(Vec3, f32)> {
    let [wi, wo, other_wi] = [wi, wo, other_wi].map(Lanes3::splat);
    alone(half_vector::refract(wi, wo, other_wi, Lanes::splat(eta)))
}

#[test]
fn half_vector_copies_can_be_undone_and_their_jacobian_is_the_change_of_solid_angle() {
    for i in 0..200 {
        let (wi, wo, other_wi) = (direction(3 * i), direction(3 * i + 1), direction(3 * i + 2));
        let Some((other_wo, jacobian)) = reflect(wi, wo, other_wi) else { continue };
        let (back, inverse) = reflect(other_wi, other_wo, wi).unwrap();
        assert!(back.distance(wo) < 1e-4 && (jacobian * inverse - 1.0).abs() < 1e-3);
        if jacobian < 20.0 {
            let numeric = numeric_jacobian(wo, |wo| reflect(wi, wo, other_wi).map_or(Vec3::ZERO, |(w, _)| w));
            assert!((numeric / jacobian - 1.0).abs() < 0.05, "{numeric} {jacobian}");
        }
    }
}

#[test]
fn half_vector_refractions_can_be_undone_and_their_jacobian_is_the_change_of_solid_angle() {
    let mut possible = 0;
    for i in 0..400 {
        let eta = if i % 2 == 0 { 1.5 } else { 1.0 / 1.33 };
        let (wi, wo, other_wi) = (direction(3 * i), -direction(3 * i + 1), direction(3 * i + 2));
        let Some((other_wo, jacobian)) = refract(wi, wo, other_wi, eta) else { continue };
        let Some((back, inverse)) = refract(other_wi, other_wo, wi, eta) else { continue };
        possible += 1;
        assert!(back.distance(wo) < 1e-3 && (jacobian * inverse - 1.0).abs() < 1e-2, "{wi} {wo} {other_wi}");
        if (0.05..20.0).contains(&jacobian) {
            let map = |wo| refract(wi, wo, other_wi, eta).map_or(Vec3::ZERO, |(w, _)| w);
            let numeric = numeric_jacobian(wo, map);
            assert!((numeric / jacobian - 1.0).abs() < 0.05, "{numeric} {jacobian}");
        }
    }
    assert!(possible > 50, "{possible}");
}

#[test]
fn reconnection_jacobians_invert_each_other_and_are_the_change_of_solid_angle() {
    let scene = bundled("unit/diffuse", (8, 6));
    let target = scene.intersect(scene.sensor().ray(vec2(4.0, 5.0), vec2(0.5, 0.5))).unwrap();
    for i in 0..100 {
        let (base, offset) = (
            target.p + target.frame.to_world(direction(i)) * 1.5,
            target.p + target.frame.to_world(direction(i + 500)),
        );
        let change = |from: Vec3, to: Vec3| {
            let [from, to, p, n] = [from, to, target.p, target.n].map(Lanes3::splat);
            connection::jacobian(from, to, (p, n)).0[3]
        };
        let jacobian = change(base, offset);
        assert!((jacobian * change(offset, base) - 1.0).abs() < 1e-4);
        // Directions from the base, by way of the target's plane, as directions from the offset.
        let map = |w: Vec3| {
            let t = (target.p - base).dot(target.n) / w.dot(target.n);
            (base + w * t - offset).normalize()
        };
        let numeric = numeric_jacobian((target.p - base).normalize(), map);
        assert!((numeric / jacobian - 1.0).abs() < 0.05, "{numeric} {jacobian}");
    }
}
