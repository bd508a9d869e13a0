//! Films fed by hand.

use super::{Case, Checks};
use crate::error::Result;
use crate::film::{Differences, Film, Frame, Layer, Needs, Sample, Taken};
use crate::math::Rgb;
use crate::synthetic::random;

pub const CASES: &[Case] = &[
    Case { name: "film/samples", summary: "samples that are NaN, or too large to be squared", run: samples },
    Case { name: "film/many", summary: "a million samples of a pixel", run: many },
    Case { name: "film/merge", summary: "films of quarters of the samples, in any order, and of all", run: merge },
];

fn value(frame: &Frame, layer: Layer) -> f64 {
    frame.get(layer).map_or(f64::NAN, |image| f64::from(image.data[0]))
}

fn samples(checks: &mut Checks) -> Result<()> {
    for (name, bad) in [
        ("NaN", f32::NAN),
        ("infinity", f32::INFINITY),
        ("1e30", 1e30),
        ("-1e30", -1e30),
        ("1e15", 1e15),
        ("1e-42", 1e-42),
    ] {
        type Set = fn(&mut Sample, &mut [Rgb], f32);
        let fields: [(&str, Set); 4] = [
            ("color", |sample, _, bad| sample.color.y = bad),
            ("direct", |sample, _, bad| sample.direct.y = bad),
            ("depth", |sample, _, bad| sample.features.depth = bad),
            ("edges", |_, edges, bad| edges[2].x = bad),
        ];
        for (field, set) in fields {
            let mut film = Film::new(1, 1, Needs::ALL);
            for i in 0..64 {
                let mut edges = [Rgb::ZERO; 4];
                let mut sample = Sample { color: Rgb::splat(random(1, i)), ..Sample::default() };
                if i == 20 {
                    set(&mut sample, &mut edges, bad);
                }
                // Rejected or not: what is left must be numbers.
                let differences = Differences { color: &edges, ambient: &[Rgb::ZERO; 4] };
                let _ = film.tiles_mut()[0].add(0, Taken { differences: Some(differences), ..Taken::alone(&sample) });
            }
            let frame = film.develop();
            let bad = frame.present().filter(|(_, image)| image.not_finite().is_some()).count();
            checks.add(format!("{name} in {field}"), "layers not finite", bad as f64, 0.0);
            let lost = 64 - film.samples();
            checks.add(format!("{name} in {field}"), "samples that are not counted", lost as f64, 0.0);
        }
    }
    Ok(())
}

fn many(checks: &mut Checks) -> Result<()> {
    for (mean, spread) in [(0.0f32, 1.0f32), (1000.0, 1.0)] {
        let mut film = Film::new(1, 1, Needs::default());
        let (mut sum, mut squares, count) = (0.0, 0.0, 1_000_000);
        for i in 0..count {
            let value = mean + spread * random(2, i);
            let sample = Sample { color: Rgb::splat(value), ..Sample::default() };
            let _ = film.tiles_mut()[0].add(0, Taken::alone(&sample));
            let apart = f64::from(value) - f64::from(mean);
            (sum, squares) = (sum + apart, squares + apart * apart);
        }
        let n = count as f64;
        let exact = f64::from(mean) + sum / n;
        let variance = (squares - sum * sum / n) / (n - 1.0) / n;
        let frame = film.develop();
        let subject = format!("mean {mean}");
        checks.add(
            subject.clone(),
            "error of the mean, of it",
            (value(&frame, Layer::Color) / exact - 1.0).abs(),
            1e-4,
        );
        let ratio = value(&frame, Layer::ColorVariance) / variance;
        checks.add(subject, "error of the variance, of it", (ratio - 1.0).abs(), 2e-2);
    }
    Ok(())
}

fn merge(checks: &mut Checks) -> Result<()> {
    let film = |range: std::ops::Range<usize>| {
        let mut film = Film::new(1, 1, Needs::ALL);
        for i in range {
            let color = Rgb::splat(random(3, i));
            let differences = Differences { color: &[color; 4], ambient: &[Rgb::ZERO; 4] };
            let sample = Sample { color, direct: color * 2.0, ..Sample::default() };
            let _ = film.tiles_mut()[0].add(0, Taken { differences: Some(differences), ..Taken::alone(&sample) });
        }
        film
    };
    // Quarters that are no whole number of bins.
    let whole = film(0..52).develop();
    for order in [[0, 1, 2, 3], [3, 1, 0, 2]] {
        let mut parts = order.map(|k| film(13 * k..13 * k + 13)).into_iter();
        let Some(mut all) = parts.next() else { continue };
        parts.for_each(|part| all.merge(&part));
        let merged = all.develop();
        for layer in [Layer::Color, Layer::ColorVariance, Layer::Direct, Layer::DirectVariance, Layer::Samples] {
            let apart = (value(&merged, layer) / value(&whole, layer) - 1.0).abs();
            checks.add(format!("{} {order:?}", layer.name()), "departure from the whole", apart, 1e-6);
        }
        let bins = |frame: &Frame| {
            let of_half = |first| frame.color_half(first).map(|[mean, _]| f64::from(mean.data[0]));
            Ok::<_, crate::error::Error>(0.5 * (of_half(0)? + of_half(1)?))
        };
        // Halves of the bins have half of the samples each, whatever was merged.
        checks.add(
            format!("bins {order:?}"),
            "departure from the mean",
            (bins(&merged)? / value(&whole, Layer::Color) - 1.0).abs(),
            1e-5,
        );
    }
    Ok(())
}
