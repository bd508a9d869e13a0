//! `net` and `gradnet`: trained networks on frames whose truth is known.

use fluxion::film::{Frame, Layer};
use fluxion::image::Image;
use fluxion::internals::synthetic::{Distribution, Noise, change, noisy, picture};
use fluxion::metrics;
use fluxion::reconstruct::{Context, Solution, parse, solve};

fn frame((width, height): (usize, usize), noise: f32, seed: u64) -> Frame {
    noisy(
        &picture((width, height)),
        Noise { color: noise, edge: 0.3 * noise, distribution: Distribution::Normal },
        seed,
    )
}

fn solved(method: &str, frame: &Frame) -> Solution {
    solve(parse(method).unwrap().as_ref(), frame, &Context { notes: true, ..Context::QUIET }).unwrap()
}

fn mse(image: &Image, truth: &Image) -> f64 {
    metrics::find("mse").unwrap().measure(image, truth).unwrap().mean
}

#[test]
fn errors_are_those_that_are_claimed() {
    let truth = picture((61, 45));
    for (method, noise) in [("net", 0.4), ("net", 0.1), ("gradnet", 0.4), ("gradnet", 0.1)] {
        let solutions = [1, 2, 3].map(|seed| solved(method, &frame((61, 45), noise, seed)));
        let error = solutions.iter().map(|solution| mse(&solution.image, &truth)).sum::<f64>() / 3.0;
        let claims = solutions.iter().flat_map(|solution| solution.error.as_ref().unwrap().data.iter());
        let claimed = claims.map(|&claim| f64::from(claim)).sum::<f64>() / (3.0 * truth.data.len() as f64);
        assert!((0.2..5.0).contains(&(claimed / error)), "{method}: {claimed:.2e} for {error:.2e}");
    }
}

#[test]
fn corrections_that_samples_deny_are_taken_back() {
    // Colours that are all but certain leave no room for what the network believes.
    let truth = picture((48, 40));
    let frame = noisy(&truth, Noise { color: 1e-3, edge: 3e-4, distribution: Distribution::Normal }, 4);
    let [safe, frgr, free] =
        ["net:image=safe", "frgr", "net:image=network"].map(|method| mse(&solved(method, &frame).image, &truth));
    assert!(
        safe < 4.0 * frgr.max(1e-7) && free > 4.0 * safe,
        "net {safe:.1e}, frgr {frgr:.1e}, without the rule {free:.1e}"
    );
}

#[test]
fn a_firefly_does_not_leave_the_range_around_it() {
    let mut frame = frame((48, 40), 0.2, 5);
    let at = 20 * 48 + 24;
    change(&mut frame, Layer::Color, |i, value| if i / 3 == at { value + 1e4 } else { value });
    let net = solved("net:image=safe", &frame);
    let frgr = net.note("frgr").unwrap();
    let largest = |x: usize, y: usize, image: &Image| image.rgb(x, y).to_array().into_iter().fold(0.0f32, f32::max);
    for (x, y) in (0..40usize).flat_map(|y| (0..48usize).map(move |x| (x, y))) {
        let window = (y.saturating_sub(2)..(y + 3).min(40))
            .flat_map(|y| (x.saturating_sub(2)..(x + 3).min(48)).map(move |x| (x, y)));
        let most = window.map(|(x, y)| largest(x, y, frgr)).fold(0.0, f32::max);
        // Half of the luminance is allowed beyond, and a twentieth of the typical one.
        assert!(largest(x, y, &net.image) <= 2.5 * most + 0.2, "{x},{y}: {:?}", net.image.rgb(x, y));
    }
}

#[test]
fn weights_of_gradnet_come_from_a_file_of_either_preset() {
    let frame = frame((48, 40), 0.2, 6);
    let solution = solved("gradnet:weights=tests/data/gradnet-printed.safetensors,means=off", &frame);
    assert!(solution.image.not_finite().is_none());
    assert_ne!(solution.image, solved("gradnet:means=off", &frame).image);
    let why = |file: &str| parse(&format!("gradnet:weights={file}")).err().unwrap().to_string();
    assert!(why("nowhere.safetensors").contains("nowhere.safetensors"));
    assert!(why("tests/data/nn.safetensors").contains("nn.safetensors: lacks the array data.0.weight"));
    assert!(why("src/reconstruct/net/net.safetensors").contains("net.safetensors: lacks the array"));
}
