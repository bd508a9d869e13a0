//! Content of checkpoints and of files of layers, for `fluxion info`.

use std::path::Path;

use anyhow::Result;
use fluxion::checkpoint::{self, Origin};
use fluxion::film::{Layer, exr};

use super::terminal::out;

/// Describes a file, if it is a checkpoint or one of layers.
pub fn describe(path: &Path) -> Result<bool> {
    if checkpoint::is_one(path) {
        describe_checkpoint(path)?;
        return Ok(true);
    }
    let is_image = path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("exr"));
    if is_image {
        describe_layers(path)?;
    }
    Ok(is_image)
}

fn describe_checkpoint(path: &Path) -> Result<()> {
    let checkpoint::Summary { origin, seconds, adaptive, rejected } = checkpoint::summary(path)?;
    let Origin { size, needs, kernel, shift, runs, .. } = &origin;
    out!("checkpoint   of fluxion {}", origin.version)?;
    out!("scene        {}, fingerprint {}", origin.scene, origin.fingerprint)?;
    out!("film         {}x{}, {} bytes a pixel", size.0, size.1, needs.bytes_per_pixel())?;
    out!("method       {}", origin.method)?;
    lights(origin.lights.iter())?;
    out!("plan         {}", origin.plan)?;
    if needs.edges.is_sampled() {
        out!("differences  to {kernel}, shifted by {}", shift.id())?;
    }
    for run in runs {
        out!("samples      {} from number {} on, seed {}", run.samples, run.first, run.seed)?;
    }
    out!("rendering    {seconds:.1} s{}", if adaptive { ", in passes" } else { "" })?;
    if let Some((id, reason)) = rejected {
        out!("not finite   sample {} of pixel {},{} ({}), and maybe others", id.index, id.x, id.y, reason.0)?;
    }
    Ok(())
}

/// Names of light groups, if there are any.
fn lights<'a>(names: impl Iterator<Item = &'a String>) -> Result<()> {
    let names: Vec<_> = names.map(String::as_str).collect();
    if names.is_empty() { Ok(()) } else { out!("lights       {}", names.join(" ")) }
}

fn describe_layers(path: &Path) -> Result<()> {
    let frame = exr::load(path)?;
    out!("film         {}x{}", frame.width, frame.height)?;
    for (name, value) in frame.provenance.attributes() {
        out!("{:<12} {value}", name.trim_start_matches("fluxion:"))?;
    }
    let counts = frame.get(Layer::Samples).map(|image| &image.data);
    if let Some(counts) = counts.filter(|counts| !counts.is_empty()) {
        let (least, most) = counts.iter().fold((f32::INFINITY, 0.0f32), |(a, b), &n| (a.min(n), b.max(n)));
        out!("samples      {least} to {most} a pixel")?;
    }
    let names: Vec<_> = frame.present().filter(|(layer, _)| layer.bin_number().unwrap_or(0) == 0).collect();
    let names: Vec<_> = names.iter().flat_map(|(layer, _)| layer.channel_names()).collect();
    out!("channels     {}", names.join(" "))?;
    lights(frame.lights.iter().map(|lights| &lights.name))?;
    if let Some(edges) = frame.own_edges() {
        let degree = 2.0 * edges.len() as f64 / edges.pixels().max(1) as f64;
        out!("edges        {}, {degree:.2} of every pixel, across {} steps", edges.len(), edges.offsets().len())?;
    }
    Ok(())
}
