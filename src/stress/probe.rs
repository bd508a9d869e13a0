//! Scenes from a few lines of XML, rendered in every way that must agree.

use std::sync::atomic::AtomicBool;

use super::Checks;
use super::frame::{average, not_finite};
use crate::error::Result;
use crate::film::{Film, Frame, Layer, Needs, Recorded};
use crate::mitsuba;
use crate::reconstruct::{Context, parse, solve};
use crate::render::{Budget, Control, RenderSettings, SHIFTS, Shift, render};
use crate::scene::Scene;

/// Size of the images: more than one tile, and one that is cut off.
const SIZE: (usize, usize) = (20, 14);

/// Independent renders of a scene, for errors of means.
const RUNS: u64 = 6;

/// A scene to be judged by the mean of its image.
pub struct Probe {
    scene: Scene,
    spp: u32,
}

/// A perspective camera.
pub fn camera(origin: &str, target: &str, fov: f32) -> String {
    format!(
        r#"<sensor type="perspective"><float name="fov" value="{fov}"/><float name="near_clip" value="1e-6"/>
        <float name="far_clip" value="1e9"/><transform name="to_world"><lookat origin="{origin}" target="{target}"
        up="0,1,0.01"/></transform><film type="hdrfilm"><integer name="width" value="{}"/><integer name="height"
        value="{}"/></film></sensor>"#,
        SIZE.0, SIZE.1
    )
}

/// A square of side `size` at `at` that faces the unit vector `towards`, with what is nested in it.
pub fn square(at: [f32; 3], towards: [f32; 3], size: f32, inside: &str) -> String {
    let [x, y, z] = at;
    // As far away as it is wide: at the same scale as everything else.
    let target = std::array::from_fn::<f32, 3, _>(|k| at[k] + size * towards[k]);
    let up = if towards[1].abs() > 0.9 { "0,0,1" } else { "0,1,0" };
    format!(
        r#"<shape type="rectangle"><transform name="to_world"><scale value="{}"/><lookat origin="{x},{y},{z}"
        target="{},{},{}" up="{up}"/></transform>{inside}</shape>"#,
        0.5 * size,
        target[0],
        target[1],
        target[2]
    )
}

/// Light all around.
pub fn sky(radiance: f32) -> String {
    format!(r#"<emitter type="constant"><rgb name="radiance" value="{radiance}"/></emitter>"#)
}

/// An area emitter, to be nested in a shape.
pub fn area_emitter(radiance: f32) -> String {
    format!(r#"<emitter type="area"><rgb name="radiance" value="{radiance:e}"/></emitter>"#)
}

/// A diffuse material of one grey, the same from behind.
pub fn grey(reflectance: f32) -> String {
    format!(
        r#"<bsdf type="twosided"><bsdf type="diffuse"><rgb name="reflectance" value="{reflectance}"/></bsdf></bsdf>"#
    )
}

impl Probe {
    /// A scene of some elements, with paths of up to `depth` edges and that many samples per pixel.
    pub fn new(elements: &[String], depth: i32, spp: u32) -> Result<Self> {
        let text = format!(
            r#"<scene version="3.0.0"><integrator type="path"><integer name="max_depth" value="{depth}"/></integrator>
            {}</scene>"#,
            elements.join("\n")
        );
        Ok(Self { scene: mitsuba::load_text(&text, &mitsuba::Options::default())?, spp })
    }

    fn film(&self, run: u64, needs: Needs, shift: Shift) -> Film {
        let settings = RenderSettings { seed: run, shift, ..RenderSettings::new(Budget::Spp(self.spp), needs) };
        let control = Control { stop: &AtomicBool::new(false), ..Control::QUIET };
        render(&self.scene, settings, &control).film
    }

    /// Means of all values of independent path-traced images.
    pub fn means(&self) -> Vec<f64> {
        (0..RUNS).map(|run| total(&self.film(run, Needs::default(), Shift::default()).develop())).collect()
    }

    /// Holds the mean of the image against a closed answer, path-traced and reconstructed, and the differences against
    /// those of the image. `bound` is the largest departure that passes, as a share of the answer.
    pub fn check(&self, checks: &mut Checks, subject: &str, expected: f64, bound: f64) -> Result<()> {
        let means = self.means();
        let mean = means.iter().sum::<f64>() / RUNS as f64;
        checks.add(format!("{subject}, path"), "departure of the mean", (mean / expected - 1.0).abs(), bound);
        let needs = Needs::EDGES.with(Recorded::Features);
        for name in SHIFTS.iter().map(|kind| kind.id) {
            let shift = Shift::named(name).unwrap_or_default();
            let films: Vec<Film> = (0..RUNS).map(|run| self.film(100 + run, needs, shift)).collect();
            let rejected: u64 = films.iter().map(Film::rejected).sum();
            checks.add(format!("{subject}, {name}"), "samples rejected", rejected as f64, 0.0);
            let frames: Vec<Frame> = films.iter().map(Film::develop).collect();
            checks.add(format!("{subject}, {name}"), "bias of differences, in deviations", bias(&frames), 8.0);
            if shift == Shift::default() {
                let solution = solve(parse("frgr")?.as_ref(), &frames[0], &Context::QUIET)?;
                checks.add(format!("{subject}, frgr"), "values not finite", not_finite(&solution), 0.0);
                // A filter that weighs by variances may lose some of what a few samples found.
                let totals: Vec<f64> = frames.iter().map(total).collect();
                let mean = totals.iter().sum::<f64>() / totals.len() as f64;
                let variance = totals.iter().map(|total| (total - mean).powi(2)).sum::<f64>() / totals.len() as f64;
                let kept = (average(&solution.image) - totals[0]).abs() / mean.abs().max(1e-30);
                let bound = 0.1 + 4.0 * variance.sqrt() / mean.abs().max(1e-30);
                checks.add(format!("{subject}, frgr"), "change of the mean", kept, bound);
            }
        }
        Ok(())
    }
}

/// Mean of a frame, with directly seen emitters.
fn total(frame: &Frame) -> f64 {
    [Layer::Color, Layer::Direct].iter().filter_map(|&layer| frame.get(layer)).map(average).sum()
}

/// Sums of differences less those of the colours, of every frame: by how many deviations of their mean that is not zero.
/// Sums over parts of the image are taken, so that what differs in sign is not lost.
fn bias(frames: &[Frame]) -> f64 {
    let mut worst = 0.0f64;
    for (layer, step) in [(Layer::Dx, (1, 0)), (Layer::Dy, (0, 1))] {
        for part in 0..4 {
            let sums: Vec<f64> = frames.iter().map(|frame| part_sum(frame, layer, step, part)).collect();
            let n = sums.len() as f64;
            let mean = sums.iter().sum::<f64>() / n;
            let variance = sums.iter().map(|sum| (sum - mean).powi(2)).sum::<f64>() / (n - 1.0) / n;
            // Single precision leaves a little where nothing varies at all.
            let rounding = 1e-5 * total(&frames[0]).abs() * (SIZE.0 * SIZE.1) as f64;
            worst = worst.max(mean.abs() / (variance.sqrt() + rounding).max(1e-30));
        }
    }
    worst
}

fn part_sum(frame: &Frame, layer: Layer, step: (usize, usize), part: usize) -> f64 {
    let (Some(edges), Some(color)) = (frame.get(layer), frame.get(Layer::Color)) else { return f64::NAN };
    let mut sum = 0.0;
    for (x, y) in (0..edges.height - step.1).flat_map(|y| (0..edges.width - step.0).map(move |x| (x, y))) {
        if 2 * (2 * y / edges.height) + 2 * x / edges.width == part {
            let apart = edges.rgb(x, y) - (color.rgb(x + step.0, y + step.1) - color.rgb(x, y));
            sum += f64::from(apart.x) + f64::from(apart.y) + f64::from(apart.z);
        }
    }
    sum
}
