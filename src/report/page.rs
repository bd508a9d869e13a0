//! The page: a template with its style and script, and all figures and pictures as JSON.

use std::collections::BTreeMap;

use serde::Serialize;
use serde_json::json;

use super::changes::Change;
use super::picture::{data_url, heat, tone_mapped, worst};
use super::summary::Summary;
use crate::bench::Results;
use crate::error::{Error, Result};
use crate::image::Image;
use crate::image::io::Picture;
use crate::metrics::{self, METRICS};

/// Pixels on each side of a crop, and how many are shown.
const CROP: usize = 40;
const CROPS: usize = 3;

/// Metrics with plots: those that are zero for the reference itself.
const PLOTTED: [&str; 4] = ["relmse", "smape", "flip", "mse"];

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
        let summaries: Option<BTreeMap<&str, Summary>> =
            self.results.map(|results| PLOTTED.iter().map(|&metric| (metric, Summary::new(results, metric))).collect());
        let floors: BTreeMap<&str, f64> = self.results.map_or_else(BTreeMap::new, |results| {
            results.records.iter().filter_map(|record| Some((record.scene.as_str(), record.floor?))).collect()
        });
        let about = self.results.and_then(|results| results.records.last());
        let data = json!({
            "title": self.title,
            "metrics": METRICS.iter().map(|metric| (metric.id, metric.summary)).collect::<BTreeMap<_, _>>(),
            "plotted": PLOTTED,
            "summaries": summaries,
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
    let metric = metrics::find("relmse").ok_or_else(|| Error::Usage("there is no metric relmse".into()))?;
    let mut maps = Vec::new();
    let reference = &view.reference.color;
    for Shown { label, picture } in &view.images {
        let map = metric.measure(&picture.color, reference);
        let map = map.map_err(|error| Error::Usage(format!("{label} of {}: {error}", view.name)))?.map;
        maps.push(map.unwrap_or_default());
    }
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
    Ok(json!({
        "name": view.name, "width": width, "height": height, "top": top, "pictures": pictures, "crops": crops(&maps),
    }))
}

/// Corners of the squares where errors are largest, by the median over the images, so that no single one decides.
fn crops(maps: &[Image]) -> Vec<(usize, usize)> {
    let Some(first) = maps.first() else { return Vec::new() };
    let side = CROP.min(first.width).min(first.height);
    let step = (side / 4).max(1);
    let mean = |map: &Image, x: usize, y: usize| -> f32 {
        let rows = (y..y + side).map(|y| (x..x + side).map(|x| map.pixel(x, y)[0]).sum::<f32>());
        rows.sum()
    };
    let mut squares = Vec::new();
    for y in (0..=first.height - side).step_by(step) {
        for x in (0..=first.width - side).step_by(step) {
            let mut errors: Vec<f32> = maps.iter().map(|map| mean(map, x, y)).collect();
            errors.sort_by(f32::total_cmp);
            squares.push((errors[errors.len() / 2], x, y));
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
