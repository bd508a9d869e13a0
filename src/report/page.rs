//! The page: a template with its style and script, and all figures and pictures as JSON.

use std::collections::BTreeMap;

use serde::Serialize;
use serde_json::json;

use super::changes::Change;
use super::picture::{data_url, heat, tone_mapped, worst};
use super::summary::each_once;
use super::tables::{SceneErrors, scene_errors, summaries};
use crate::bench::{MEASURES, Results};
use crate::error::{Error, Result};
use crate::image::Image;
use crate::image::io::Picture;
use crate::metrics::{self, METRICS};

/// Pixels on each side of a crop, and how many are shown.
const CROP: usize = 64;
const CROPS: usize = 3;

/// An image with its name.
pub struct Shown {
    /// Name of the scene.
    pub label: String,
    /// Linear radiance.
    pub picture: Picture,
}

/// Images of the same scene and their reference.
pub struct View {
    /// Name of the scene.
    pub name: String,
    /// The reference image.
    pub reference: Picture,
    /// The images.
    pub images: Vec<Shown>,
}

/// Content of the page.
#[derive(Default)]
pub struct Page<'a> {
    /// The heading.
    pub title: String,
    /// Results for plots and tables.
    pub results: Option<&'a Results>,
    /// Changes since earlier results.
    pub changes: Vec<Change>,
    /// Images for the viewer.
    pub views: Vec<View>,
}

/// A picture as the page holds it.
#[derive(Serialize)]
struct Encoded {
    label: String,
    source: String,
    map: Option<String>,
    metrics: BTreeMap<&'static str, f64>,
}

impl Page<'_> {
    /// The whole page.
    pub fn html(&self) -> Result<String> {
        let views = self.views.iter().map(view).collect::<Result<Vec<_>>>()?;
        let summaries = self.results.map(summaries);
        let errors: Option<Vec<SceneErrors>> = self.results.zip(summaries.as_ref()).map(|(results, summaries)| {
            let budgets = each_once(results.records.iter().map(|record| record.budget.as_str()));
            budgets.into_iter().flat_map(|budget| scene_errors(results, summaries, budget)).collect()
        });
        let floors: BTreeMap<&str, f64> = self.results.map_or_else(BTreeMap::new, |results| {
            results.records.iter().filter_map(|record| Some((record.scene.as_str(), record.floor?))).collect()
        });
        let about = self.results.and_then(|results| results.records.last());
        let data = json!({
            "title": self.title,
            "metrics": METRICS.iter().map(|metric| (metric.id, metric.summary)).collect::<BTreeMap<_, _>>(),
            "measures": MEASURES,
            "summaries": summaries,
            "errors": errors,
            "floors": floors,
            "leftOut": self.results.map(|results| &results.left_out),
            "changes": self.changes,
            "machine": about.map(|record| &record.machine),
            "version": about.map(|record| &record.version),
            "crop": CROP,
            "views": views,
        });
        let data = serde_json::to_string(&data).map_err(|error| Error::backend("json", error))?;
        // Nothing in the data may end the element that holds it.
        let data = data.replace('<', "\\u003c");
        Ok(include_str!("page.html")
            .replace("{{title}}", &self.title.replace('&', "&amp;").replace('<', "&lt;"))
            .replace("{{style}}", include_str!("page.css"))
            .replace("{{script}}", include_str!("page.js"))
            .replace("{{data}}", &data))
    }
}

fn view(view: &View) -> Result<serde_json::Value> {
    let maps = maps(view, "relmse")?;
    let reference = &view.reference.color;
    // All maps of a scene share their colours.
    let mut tops: Vec<f32> = maps.iter().map(worst).collect();
    tops.sort_by(f32::total_cmp);
    let top = tops.get(tops.len() / 2).copied();
    let mut pictures = Vec::new();
    for (Shown { label, picture }, map) in view.images.iter().zip(&maps) {
        let mut metrics = BTreeMap::new();
        for metric in METRICS {
            metrics.insert(metric.id, metric.measure(&picture.color, reference)?.mean);
        }
        let (source, map) = (data_url(&tone_mapped(picture))?, Some(data_url(&heat(map, top))?));
        pictures.push(Encoded { label: label.clone(), source, map, metrics });
    }
    let source = data_url(&tone_mapped(&view.reference))?;
    pictures.push(Encoded { label: "reference".into(), source, map: None, metrics: BTreeMap::new() });
    let (width, height) = (reference.width, reference.height);
    let crops = crops(&self::maps(view, "flip")?);
    Ok(json!({
        "name": view.name, "width": width, "height": height, "top": top, "pictures": pictures, "crops": crops,
    }))
}

/// A metric of every pixel of every image.
fn maps(view: &View, metric: &str) -> Result<Vec<Image>> {
    let metric = metrics::find(metric).ok_or_else(|| Error::Usage(format!("there is no metric {metric}")))?;
    let map = |Shown { label, picture }: &Shown| {
        let measured = metric.measure(&picture.color, &view.reference.color);
        let measured = measured.map_err(|error| Error::Usage(format!("{label} of {}: {error}", view.name)))?;
        Ok(measured.map.unwrap_or_default())
    };
    view.images.iter().map(map).collect()
}

/// Corners of the squares on which the images differ most to the eye: the largest mean FLIP less the smallest, or with a single
/// image its own.
fn crops(maps: &[Image]) -> Vec<(usize, usize)> {
    let Some(first) = maps.first() else { return Vec::new() };
    let side = CROP.min(first.width).min(first.height);
    let step = (side / 4).max(1);
    let sum = |map: &Image, x: usize, y: usize| -> f32 {
        let rows = (y..y + side).map(|y| (x..x + side).map(|x| map.pixel(x, y)[0]).sum::<f32>());
        rows.sum()
    };
    let mut squares = Vec::new();
    for y in (0..=first.height - side).step_by(step) {
        for x in (0..=first.width - side).step_by(step) {
            let errors: Vec<f32> = maps.iter().map(|map| sum(map, x, y)).collect();
            let largest = errors.iter().copied().fold(0.0, f32::max);
            let smallest = if errors.len() > 1 { errors.iter().copied().fold(f32::INFINITY, f32::min) } else { 0.0 };
            squares.push((largest - smallest, x, y));
        }
    }
    squares.sort_by(|a, b| b.0.total_cmp(&a.0));
    let mut chosen: Vec<(usize, usize)> = Vec::new();
    for (_, x, y) in squares {
        let apart = |&(a, b): &(usize, usize)| a.abs_diff(x) >= side || b.abs_diff(y) >= side;
        if chosen.len() < CROPS && chosen.iter().all(apart) {
            chosen.push((x, y));
        }
    }
    chosen
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn crops_are_where_images_differ_from_each_other() {
        let spot = |x: usize, y: usize| {
            let inside = move |a: usize, b: usize| a / CROP == x && b / CROP == y;
            let mut map = Image::new(4 * CROP, 3 * CROP, 1);
            for (k, value) in map.data.iter_mut().enumerate() {
                *value = if inside(k % (4 * CROP), k / (4 * CROP)) { 1.0 } else { 0.0 };
            }
            map
        };
        let mut common = spot(0, 0);
        common.data.iter_mut().zip(&spot(2, 1).data).for_each(|(value, other)| *value += other);
        // Both are wrong in the first square, one of them in the other.
        assert_eq!(crops(&[spot(0, 0), common])[0], (2 * CROP, CROP));
        assert_eq!(crops(&[spot(3, 2)])[0], (3 * CROP, 2 * CROP));
    }
}
