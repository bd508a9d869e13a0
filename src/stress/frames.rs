//! Hostile frames.

use super::frame::{COLOR, SIZE, average, denoisers, farthest, methods, mse, names, noisy, not_finite, run};
use super::{Case, Checks};
use crate::error::Result;
use crate::film::{BINS, Frame, Layer, Recorded};
use crate::image::Image;
use crate::math::vec3;
use crate::reconstruct::EdgeTrust;
use crate::synthetic::{SAMPLED, change, exact, expose, flat, picture, random};

pub const CASES: &[Case] = &[
    Case { name: "frames/black", summary: "nothing but zeros stays zero", run: black },
    Case { name: "frames/constant", summary: "one colour without noise stays what it is", run: constant },
    Case { name: "frames/sizes", summary: "every size: a frame without noise stays what it is", run: sizes },
    Case { name: "frames/firefly", summary: "one pixel of 1e8 among ones: what is far from it stays", run: firefly },
    Case { name: "frames/unlit", summary: "30 % of pixels with zero mean and variance", run: unlit },
    Case { name: "frames/variances", summary: "variances from 1e-12 to 1e12 side by side, no noise", run: variances },
    Case { name: "frames/edges", summary: "differences off by 1e6 with matching variance", run: wild_edges },
    Case { name: "frames/exposure", summary: "radiance of 1e-8 and 1e8: the same picture as of 1", run: exposure },
    Case { name: "frames/denormal", summary: "radiance of 1e-40", run: denormal },
    Case { name: "frames/not-finite", summary: "NaN or infinity in any layer is an error naming it", run: not_numbers },
    Case { name: "frames/negative", summary: "negative values in any layer", run: negative },
    Case { name: "frames/features", summary: "features without information, or with wrong one", run: features },
    Case { name: "frames/few", summary: "one and two samples per pixel", run: few },
    Case { name: "frames/missing", summary: "a layer that is not there is an error naming it", run: missing },
];

const FINITE: &str = "values not finite";
const FARTHEST: &str = "largest deviation, of the largest value";
const GAIN: &str = "squared error, of that before";

fn black(checks: &mut Checks) -> Result<()> {
    let black = flat(SIZE, 0.0);
    for method in methods() {
        let solution = run(method, &exact(&black))?;
        let most = solution.image.data.iter().map(|value| f64::from(value.abs())).fold(0.0, f64::max);
        checks.add(method.id, "largest value", most, 0.0);
        checks.add(method.id, FINITE, not_finite(&solution), 0.0);
    }
    Ok(())
}

fn constant(checks: &mut Checks) -> Result<()> {
    let image = Image::from_rgb(SIZE.0, SIZE.1, |_, _| vec3(0.25, 3.0, 0.0));
    for method in methods() {
        checks.add(method.id, FARTHEST, farthest(&run(method, &exact(&image))?.image, &image), 1e-5);
    }
    Ok(())
}

fn sizes(checks: &mut Checks) -> Result<()> {
    for method in methods() {
        for size in [(1, 1), (1, 7), (7, 1), (2, 2), (31, 37), (16384, 3)] {
            let image = picture(size);
            let found = farthest(&run(method, &exact(&image))?.image, &image);
            checks.add(format!("{} {}x{}", method.id, size.0, size.1), FARTHEST, found, 1e-3);
        }
    }
    Ok(())
}

fn firefly(checks: &mut Checks) -> Result<()> {
    let truth = flat(SIZE, 1.0);
    let mut frame = noisy(&truth, 1.0, 1);
    let at = 3 * (23 * SIZE.0 + 20);
    // A single one of 64 samples: the mean of its bin is eight times the mean of all.
    change(&mut frame, Layer::Color, |i, value| if i / 3 == at / 3 { 1e8 } else { value });
    change(&mut frame, Layer::ColorVariance, |i, value| if i / 3 == at / 3 { 1e16 } else { value });
    change(&mut frame, Layer::BinColor(2), |i, value| if i / 3 == at / 3 { 8e8 } else { value });
    let color = average(frame.require(Layer::Color)?);
    for method in methods() {
        let solution = run(method, &frame)?;
        checks.add(method.id, FINITE, not_finite(&solution), 0.0);
        let column = |i: usize| (i / 3 % SIZE.0).abs_diff(20);
        let row = |i: usize| (i / 3 / SIZE.0).abs_diff(23);
        let far = solution.image.data.iter().enumerate().filter(|&(i, _)| column(i).max(row(i)) > 16);
        let apart = far.map(|(_, &value)| f64::from((value - 1.0).abs())).fold(0.0, f64::max);
        if method.traits.keeps_mean {
            let kept = (average(&solution.image) / color - 1.0).abs();
            checks.add(method.id, "change of the mean", kept, 1e-4);
        } else if method.traits.robust {
            checks.add(method.id, "largest error beyond 16 pixels", apart, 4.0 * f64::from(COLOR));
        } else {
            // Least squares, or a few steps from there: a share of the firefly goes into the pixels around it.
            checks.add(method.id, "largest error beyond 16 pixels, of the firefly", apart / 1e8, 1e-3);
        }
    }
    Ok(())
}

fn unlit(checks: &mut Checks) -> Result<()> {
    let truth = flat(SIZE, 0.7);
    let mut frame = noisy(&flat(SIZE, 1.0), 1.0, 2);
    let unlit = |i: usize| random(9, i / 3) < 0.3;
    let bins = (0..BINS as u8).map(Layer::BinColor);
    for layer in [Layer::Color, Layer::ColorVariance].into_iter().chain(bins) {
        change(&mut frame, layer, |i, value| if unlit(i) { 0.0 } else { value });
    }
    let before = frame.require(Layer::Color)?.clone();
    for method in denoisers() {
        let solution = run(method, &frame)?;
        checks.add(method.id, FINITE, not_finite(&solution), 0.0);
        checks.add(method.id, GAIN, mse(&solution.image, &truth) / mse(&before, &truth), 1.0);
    }
    Ok(())
}

fn variances(checks: &mut Checks) -> Result<()> {
    let image = picture(SIZE);
    let mut frame = exact(&image);
    for (k, layer) in Layer::all().enumerate().filter(|(_, layer)| layer.name().ends_with("variance")) {
        change(&mut frame, layer, |i, _| 10f32.powf(24.0 * random(k as u64, i) - 12.0));
    }
    let (least, most) = (f64::from(0.3f32), 2.5);
    for method in methods() {
        let solution = run(method, &frame)?;
        checks.add(method.id, FINITE, not_finite(&solution), 0.0);
        let beyond = |&value: &f32| (least - f64::from(value)).max(f64::from(value) - most);
        let beyond = solution.image.data.iter().map(beyond).fold(0.0, f64::max);
        checks.add(method.id, "excess over the range of the frame", beyond, 0.25);
    }
    Ok(())
}

fn wild_edges(checks: &mut Checks) -> Result<()> {
    let truth = picture(SIZE);
    let mut frame = noisy(&truth, 1.0, 3);
    let before = frame.require(Layer::Color)?.clone();
    for (seed, (mean, variance)) in
        [(Layer::Dx, Layer::DxVariance), (Layer::Dy, Layer::DyVariance)].into_iter().enumerate()
    {
        change(&mut frame, mean, |i, _| 2e6 * (random(seed as u64, i) - 0.5));
        change(&mut frame, variance, |_, _| 1e12);
    }
    for k in 0..BINS as u8 {
        for (axis, layer) in [Layer::BinDx(k), Layer::BinDy(k)].into_iter().enumerate() {
            change(&mut frame, layer, |i, _| 6e6 * (random(10 + 2 * u64::from(k) + axis as u64, i) - 0.5));
        }
    }
    for method in methods() {
        let solution = run(method, &frame)?;
        checks.add(method.id, FINITE, not_finite(&solution), 0.0);
        if method.traits.keeps_mean {
            let kept = (average(&solution.image) - average(&before)).abs() / 1e6;
            checks.add(method.id, "change of the mean, of the differences", kept, 1e-6);
        } else if method.traits.edges != EdgeTrust::Always {
            checks.add(method.id, GAIN, mse(&solution.image, &truth) / mse(&before, &truth), 1.0);
        }
    }
    Ok(())
}

fn exposure(checks: &mut Checks) -> Result<()> {
    let frame = noisy(&picture(SIZE), 1.0, 4);
    for method in methods() {
        let normal = run(method, &frame)?.image;
        for factor in [1e-8, 1e8] {
            let mut scaled = frame.clone();
            expose(&mut scaled, factor);
            let mut image = run(method, &scaled)?.image;
            image.data.iter_mut().for_each(|value| *value /= factor);
            let bound = f64::from(method.traits.exposure_tolerance);
            checks.add(format!("{} {factor:.0e}", method.id), FARTHEST, farthest(&image, &normal), bound);
        }
    }
    Ok(())
}

fn denormal(checks: &mut Checks) -> Result<()> {
    let mut frame = noisy(&picture(SIZE), 1.0, 5);
    expose(&mut frame, 1e-40);
    let before = frame.require(Layer::Color)?.clone();
    for method in methods() {
        let solution = run(method, &frame)?;
        checks.add(method.id, FINITE, not_finite(&solution), 0.0);
        checks.add(method.id, FARTHEST, farthest(&solution.image, &before), 1.0);
    }
    Ok(())
}

/// Layers that every method gets to see at least through the check for numbers.
fn not_numbers(checks: &mut Checks) -> Result<()> {
    let frame = noisy(&picture((9, 7)), 1.0, 6);
    for method in methods() {
        let mut silent = 0;
        for layer in Layer::all() {
            for poison in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
                let mut frame = frame.clone();
                change(&mut frame, layer, |i, value| if i == 5 { poison } else { value });
                let named = run(method, &frame).err().is_some_and(|error| {
                    let text = error.to_string();
                    names(&text, layer) && text.contains("pixel")
                });
                silent += u32::from(!named);
            }
        }
        checks.add(method.id, "layers without an error that names them", f64::from(silent), 0.0);
    }
    Ok(())
}

fn negative(checks: &mut Checks) -> Result<()> {
    let frame = noisy(&picture(SIZE), 1.0, 7);
    for method in methods() {
        let mut bad = 0.0;
        for layer in Layer::all() {
            let mut frame = frame.clone();
            change(&mut frame, layer, |i, value| if random(3, i) < 0.2 { -value.abs() - 0.1 } else { value });
            // An error is an answer, too, if it says which layer is not what it should be.
            match run(method, &frame) {
                Ok(solution) => bad += not_finite(&solution),
                Err(error) => bad += f64::from(u8::from(!names(&error.to_string(), layer))),
            }
        }
        checks.add(method.id, "values not finite, all layers in turn", bad, 0.0);
    }
    Ok(())
}

fn features(checks: &mut Checks) -> Result<()> {
    let truth = picture(SIZE);
    let frame = noisy(&truth, 1.0, 8);
    let before = frame.require(Layer::Color)?.clone();
    let lies = |i: usize| f32::from(u8::from((i / 3 % SIZE.0 / 4 + i / 3 / SIZE.0 / 4).is_multiple_of(2)));
    type Make<'a> = &'a dyn Fn(&mut Frame);
    let kinds: [(&str, Make); 4] = [
        ("constant", &|_| {}),
        ("saturated", &|frame| {
            [Layer::Albedo, Layer::Normal].into_iter().for_each(|layer| change(frame, layer, |_, _| 1.0));
            change(frame, Layer::Depth, |_, _| 1e9);
        }),
        ("duplicated", &|frame| {
            for layer in [Layer::Albedo, Layer::Normal] {
                change(frame, layer, |i, _| truth.data[i]);
            }
            change(frame, Layer::Depth, |i, _| truth.data[3 * i]);
        }),
        ("contradicting", &|frame| {
            [Layer::Albedo, Layer::Normal].iter().for_each(|&layer| change(frame, layer, |i, _| lies(i)))
        }),
    ];
    for method in denoisers() {
        for (kind, make) in &kinds {
            let mut frame = frame.clone();
            make(&mut frame);
            let solution = run(method, &frame)?;
            let gain = mse(&solution.image, &truth) / mse(&before, &truth);
            checks.add(format!("{} {kind}", method.id), GAIN, gain, 1.0);
        }
    }
    Ok(())
}

fn few(checks: &mut Checks) -> Result<()> {
    let truth = flat(SIZE, 1.0);
    for spp in [1u32, 2] {
        let mut frame = noisy(&truth, 1.0, 9);
        change(&mut frame, Layer::Samples, |_, _| spp as f32);
        // As many bins have a sample; of one sample the variance is its square.
        for k in spp as u8..BINS as u8 {
            let bins = [Layer::BinColor(k), Layer::BinDx(k), Layer::BinDy(k)];
            bins.into_iter().for_each(|layer| change(&mut frame, layer, |_, _| 0.0));
        }
        for (whole, variance, bin) in SAMPLED {
            let bins: Vec<Vec<f32>> =
                (0..spp as u8).map(|k| frame.require(bin(k)).map(|image| image.data.clone())).collect::<Result<_>>()?;
            let mean = |i: usize| bins.iter().map(|bin| bin[i]).sum::<f32>() / spp as f32;
            change(&mut frame, whole, |i, _| mean(i));
            let square = |i: usize| bins.iter().map(|bin| (bin[i] - mean(i)).powi(2)).sum::<f32>() / 2.0;
            change(&mut frame, variance, |i, _| if spp == 1 { mean(i).powi(2) } else { square(i) });
        }
        let before = frame.require(Layer::Color)?.clone();
        for method in denoisers() {
            let solution = run(method, &frame)?;
            let subject = format!("{} {spp} spp", method.id);
            checks.add(subject.clone(), FINITE, not_finite(&solution), 0.0);
            checks.add(subject, GAIN, mse(&solution.image, &truth) / mse(&before, &truth), 1.0);
        }
    }
    Ok(())
}

fn missing(checks: &mut Checks) -> Result<()> {
    let frame = exact(&picture((9, 7)));
    for method in methods() {
        let made = crate::reconstruct::parse(method.id)?;
        let needs = made.needs();
        let lost: Vec<Layer> = [
            (true, Layer::Color),
            (needs.edges.is_on(), Layer::Dx),
            (needs.edges.is_on(), Layer::DyVariance),
            (needs.has(Recorded::Bins), Layer::BinColor(3)),
            (needs.has(Recorded::Bins) && needs.edges.is_on(), Layer::BinDx(7)),
            (needs.has(Recorded::Features), Layer::Normal),
        ]
        .into_iter()
        .filter_map(|(needed, layer)| needed.then_some(layer))
        .collect();
        for layer in lost {
            let mut less = Frame::new(frame.width, frame.height);
            frame
                .present()
                .filter(|(other, _)| *other != layer)
                .for_each(|(other, image)| less.set(other, image.clone()));
            let named = match run(method, &less) {
                Err(error) => error.to_string().contains(&layer.channel_names()[0]),
                // Done without it, and well.
                Ok(solution) => {
                    let expected = frame.get(Layer::Color).cloned().unwrap_or_default();
                    farthest(&solution.image, &expected) < 1e-3
                }
            };
            checks.add(
                format!("{} without {}", method.id, layer.name()),
                "silent failures",
                f64::from(u8::from(!named)),
                0.0,
            );
        }
    }
    Ok(())
}
