//! `fluxion compare`.

use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::{Context, Result};
use fluxion::error::Error;
use fluxion::image::{Image, io};
use fluxion::math::{Rgb, vec3};
use fluxion::metrics::{self, METRICS};

use super::outputs::Claims;

/// Options of `compare`.
#[derive(clap::Args)]
pub struct Args {
    /// Image to judge
    image: PathBuf,
    /// Reference to judge it by
    reference: PathBuf,
    /// Write the figures as one JSON object; `-` is standard output
    #[arg(long, value_name = "FILE", num_args = 0..=1, default_missing_value = "-")]
    json: Option<PathBuf>,
    /// Image of the error per pixel: blue is none, red the worst hundredth
    #[arg(long, value_name = "FILE")]
    map: Option<PathBuf>,
    /// Metric that the map shows
    #[arg(long, default_value = "relmse", requires = "map")]
    metric: String,
}

/// Measures with every metric.
pub fn run(args: &Args) -> Result<ExitCode> {
    let metric = metrics::find(&args.metric).ok_or_else(|| {
        let names: Vec<_> = METRICS.iter().map(|metric| metric.id).collect();
        Error::Usage(format!("metric `{}` is not known; there are {}", args.metric, names.join(", ")))
    })?;
    let [image, reference] = [&args.image, &args.reference].map(|path| io::read_color(path));
    let (image, reference) = (image?, reference?);
    let maps: Vec<_> = args.map.iter().cloned().collect();
    let to_stdout = args.json.as_ref().is_some_and(|path| path.as_os_str() == "-");
    let json_file = args.json.clone().filter(|_| !to_stdout);
    let _claims = Claims::new(&maps, &[&json_file], None)?;
    let mut object = serde_json::Map::new();
    for metric in METRICS {
        object.insert(metric.id.into(), metric.measure(&image, &reference)?.mean.into());
    }
    if let Some(path) = &args.map {
        let map = metric.measure(&image, &reference)?.map;
        let map = map.ok_or_else(|| Error::Usage(format!("metric `{}` has no map", args.metric)))?;
        io::write_color(path, &heat(&map), None, &[])?;
    }
    let text = serde_json::to_string_pretty(&object)? + "\n";
    match (&json_file, to_stdout) {
        (Some(path), _) => std::fs::write(path, text).with_context(|| format!("cannot write {}", path.display()))?,
        (None, true) => print!("{text}"),
        (None, false) => METRICS.iter().for_each(|metric| {
            let value = object[metric.id].as_f64().unwrap_or(f64::NAN);
            println!("{:>10}  {value:<12.6}  {}", metric.id, metric.summary);
        }),
    }
    Ok(ExitCode::SUCCESS)
}

/// Errors as colours from blue over white to red, on the scale of the 99th percentile.
fn heat(map: &Image) -> Image {
    let mut sorted = map.data.clone();
    sorted.sort_by(f32::total_cmp);
    let top = sorted[(sorted.len() - 1) * 99 / 100].max(f32::MIN_POSITIVE);
    let (cold, middle, hot) = (vec3(0.02, 0.05, 0.3), vec3(0.9, 0.9, 0.9), vec3(0.6, 0.0, 0.02));
    Image::from_rgb(map.width, map.height, |x, y| {
        let share = (map.pixel(x, y)[0] / top).clamp(0.0, 1.0);
        let color: Rgb = if share < 0.5 { cold.lerp(middle, 2.0 * share) } else { middle.lerp(hot, 2.0 * share - 1.0) };
        color
    })
}
