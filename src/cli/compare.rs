//! `fluxion compare`.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::{Context, Result, bail};
use fluxion::error::Error;
use fluxion::image::io::{self, Picture};
use fluxion::internals::files;
use fluxion::metrics::{self, METRICS};
use fluxion::report::{Page, Shown, View, heat};

use super::json;
use super::outputs::Claims;
use super::terminal::{note, out};

/// Options of `compare`.
#[derive(clap::Args)]
pub struct Args {
    /// Images to judge, and last the reference to judge them by
    #[arg(required = true, num_args = 2.., value_name = "IMAGE")]
    images: Vec<PathBuf>,
    #[command(flatten)]
    json: json::Args,
    /// Image of the first image's error per pixel: blue is none, red the worst hundredth
    #[arg(long, value_name = "FILE")]
    map: Option<PathBuf>,
    /// Metric that the map shows
    #[arg(long, default_value = "relmse", requires = "map")]
    metric: String,
    /// Page to compare the images on, in a browser
    #[arg(long, value_name = "FILE")]
    html: Option<PathBuf>,
}

/// The figure of images with alpha, with its description. Colours are compared multiplied by theirs.
pub const ALPHA: (&str, &str) = ("alpha", "mean of |I - R| of the alpha channels");

/// Measures with every metric.
pub fn run(args: &Args) -> Result<ExitCode> {
    let unknown = || Error::unknown("metric", &args.metric, METRICS.iter().map(|metric| metric.id));
    let metric = metrics::find(&args.metric).ok_or_else(unknown)?;
    let Some((reference, paths)) = args.images.split_last() else { bail!("there is no image") };
    let images = paths.iter().map(|path| io::read_picture(path)).collect::<Result<Vec<_>, _>>()?;
    let path_of_reference = reference;
    let reference = io::read_picture(reference)?;
    check_finite(path_of_reference, &reference)?;
    for (path, image) in paths.iter().zip(&images) {
        check_finite(path, image)?;
        if image.window != reference.window && image.color.shape() == reference.color.shape() {
            note!("warning: {} and {} are different windows of a picture", path.display(), path_of_reference.display());
        }
    }
    let maps: Vec<_> = args.map.iter().cloned().collect();
    let inputs: Vec<_> = args.images.iter().map(PathBuf::as_path).collect();
    let _claims = Claims::new(&maps, &[&args.json.file(), &args.html], &inputs)?;
    let mut objects = Vec::new();
    for (path, image) in paths.iter().zip(&images) {
        let mut object = serde_json::Map::new();
        if images.len() > 1 {
            object.insert("image".into(), path.display().to_string().into());
        }
        for metric in METRICS {
            let measured =
                metric.measure(&image.color, &reference.color).with_context(|| path.display().to_string())?;
            object.insert(metric.id.into(), measured.mean.into());
        }
        if let (Some(alpha), Some(expected)) = (&image.alpha, &reference.alpha) {
            let apart = alpha.data.iter().zip(&expected.data).map(|(a, b)| f64::from((a - b).abs())).sum::<f64>();
            object.insert(ALPHA.0.into(), (apart / alpha.data.len() as f64).into());
        }
        objects.push(object);
    }
    if let Some(path) = &args.map {
        let map = metric.measure(&images[0].color, &reference.color)?.map;
        let map = map.ok_or_else(|| Error::Usage(format!("metric `{}` has no map", args.metric)))?;
        io::write_color(path, &heat(&map, None), &io::Extras::default())?;
    }
    match objects.as_slice() {
        objects if !args.json.is_wanted() => {
            objects.iter().zip(paths).try_for_each(|(object, path)| print(object, path))?;
        }
        [object] => args.json.write(object)?,
        several => args.json.write(&several)?,
    }
    if let Some(path) = &args.html {
        files::write(path, &page(paths, images, reference)?)?;
    }
    Ok(ExitCode::SUCCESS)
}

/// Fails with the name of the file whose colour is not finite.
fn check_finite(path: &Path, picture: &Picture) -> Result<()> {
    let Some((x, y, c)) = picture.color.not_finite() else { return Ok(()) };
    bail!(Error::BadData(format!("{}: {} is not finite at pixel {x},{y}", path.display(), ["R", "G", "B"][c])))
}

fn print(object: &serde_json::Map<String, serde_json::Value>, path: &Path) -> Result<()> {
    if object.contains_key("image") {
        out!("{}", path.display())?;
    }
    let summaries = METRICS.iter().map(|metric| (metric.id, metric.summary)).chain([ALPHA]);
    for (id, summary) in summaries.filter(|(id, _)| object.contains_key(*id)) {
        let value = object[id].as_f64().unwrap_or(f64::NAN);
        out!("{id:>10}  {value:<12.6}  {summary}")?;
    }
    Ok(())
}

fn page(paths: &[PathBuf], images: Vec<Picture>, reference: Picture) -> Result<String, Error> {
    let names: Vec<_> = paths.iter().map(|path| path.display().to_string()).collect();
    let shown = names.iter().zip(images).map(|(name, picture)| Shown { label: name.clone(), picture });
    let view = View { name: names.join(", "), reference, images: shown.collect() };
    Page { title: "Images compared".into(), views: vec![view], ..Page::default() }.html()
}
