//! `blend`: convex combinations of its candidates, which become the sampled colours where all candidates are biased.

use fluxion::film::{Frame, Layer};
use fluxion::image::Image;
use fluxion::math::vec3;
use fluxion::metrics;
use fluxion::reconstruct::{Context, Solution, parse, solve};
use fluxion::synthetic::{Distribution, Noise, change, noisy, picture};

const SIZE: (usize, usize) = (48, 40);

fn frame(noise: f32, seed: u64) -> Frame {
    noisy(&picture(SIZE), Noise { color: noise, edge: 0.3 * noise, distribution: Distribution::Normal }, seed)
}

fn solved(method: &str, frame: &Frame) -> Solution {
    solve(parse(method).unwrap().as_ref(), frame, &Context { notes: true, ..Context::QUIET }).unwrap()
}

fn mse(image: &Image, truth: &Image) -> f64 {
    metrics::find("mse").unwrap().measure(image, truth).unwrap().mean
}

#[test]
fn every_value_lies_among_those_of_the_candidates() {
    for safety in ["on", "off"] {
        let frame = frame(0.3, 1);
        let (blend, frgr) = (solved(&format!("blend:safety={safety}"), &frame), solved("frgr", &frame));
        let note = |name: &str| &frgr.notes.iter().find(|note| note.name == name).unwrap().image;
        let candidates = [&frgr.image, note("denoised"), note("level0_enhanced"), frame.get(Layer::Color).unwrap()]
            .map(|image| &image.data);
        for (i, value) in blend.image.data.iter().enumerate() {
            let of = |choose: fn(f32, f32) -> f32| candidates.iter().map(|data| data[i]).reduce(choose).unwrap();
            assert!((of(f32::min) - 1e-4..=of(f32::max) + 1e-4).contains(value), "{value}");
        }
        let weights = |i: usize| blend.notes.iter().map(|note| note.image.data[i]).sum::<f32>();
        assert_eq!(blend.notes.len(), candidates.len());
        assert!((0..blend.image.data.len()).all(|i| (weights(i) - 1.0).abs() < 1e-5));
    }
}

#[test]
fn errors_fall_with_the_noise_and_their_estimates_with_them() {
    let truth = picture(SIZE);
    let [coarse, fine] = [0.4, 0.05].map(|noise| {
        let solutions = [1, 2, 3].map(|seed| solved("blend", &frame(noise, seed)));
        let error = solutions.iter().map(|solution| mse(&solution.image, &truth)).sum::<f64>() / 3.0;
        let claims = solutions.iter().flat_map(|solution| solution.error.as_ref().unwrap().data.iter());
        let claimed = claims.map(|&claim| f64::from(claim)).sum::<f64>() / (3.0 * truth.data.len() as f64);
        assert!(error < 0.2 * f64::from(noise * noise), "{error:.2e} of noise {noise}");
        assert!((0.2..5.0).contains(&(claimed / error)), "{claimed:.2e} for {error:.2e}");
        error
    });
    assert!(fine < 0.05 * coarse, "{fine:.2e} after {coarse:.2e}");
}

#[test]
fn where_no_candidate_can_be_right_the_colours_stay() {
    // A pattern that no feature shows, with differences that deny it and claim to be certain, in colours without noise.
    let truth =
        Image::from_rgb(SIZE.0, SIZE.1, |x, y| vec3(1.0, 1.0, 1.0) * (1.0 + 0.5 * ((x * 7 + y * 11) % 5) as f32));
    let mut frame = noisy(&truth, Noise { color: 1e-3, edge: 1e-4, distribution: Distribution::Normal }, 4);
    [Layer::Dx, Layer::Dy].into_iter().for_each(|layer| change(&mut frame, layer, |_, _| 0.0));
    let (blend, frgr) = (mse(&solved("blend", &frame).image, &truth), mse(&solved("frgr", &frame).image, &truth));
    let free = mse(&solved("blend:safety=off", &frame).image, &truth);
    assert!(
        blend < 1e-4 && frgr > 1e-2 && free > 10.0 * blend,
        "blend {blend:.1e}, frgr {frgr:.1e}, without the rule {free:.1e}"
    );
}
