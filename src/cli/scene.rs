//! Common part of the commands that read scene files: options that override what is in them.

use std::path::Path;

use fluxion::error::Result;
use fluxion::mitsuba;
use fluxion::scene::Scene;
use fluxion::scene::sensor::Crop;

use super::host::warn;
use super::machine;

/// Options of a scene file.
#[derive(clap::Args)]
#[command(next_help_heading = "Scene")]
pub struct Args {
    /// Value of a scene parameter, over its <default>
    #[arg(short = 'D', value_parser = super::parse_definition, value_name = "NAME=VALUE")]
    pub define: Vec<(String, String)>,
    /// Sensor to look through, by its id or its number from 0 [default: the first]
    #[arg(long, value_name = "N|ID")]
    pub sensor: Option<String>,
    /// Film size in place of the scene's, as in 640x360
    #[arg(long, value_parser = super::parse_size, value_name = "WxH")]
    pub size: Option<(usize, usize)>,
    /// Part of the film to render, as its first column and row and its size: 100,50,320x180
    #[arg(long, value_parser = parse_crop, value_name = "X,Y,WxH")]
    pub crop: Option<Crop>,
    /// Pixels to render and reconstruct around the part, so that no seam shows where images of parts are put together; images have
    /// the part alone
    #[arg(long, default_value_t = 0, value_name = "N", hide_short_help = true)]
    pub overscan: usize,
    /// Longest paths in edges in place of the scene's: 1 is visible emitters only, 2 adds direct light, -1 is no limit
    #[arg(long, allow_negative_numbers = true, value_name = "N", value_parser = parse_depth)]
    pub max_depth: Option<u32>,
    /// Take every warning of the scene file's reader for an error
    #[arg(long)]
    strict: bool,
}

impl Args {
    /// The options of the loader that they are.
    pub fn options(&self) -> mitsuba::Options {
        mitsuba::Options {
            parameters: self.define.clone(),
            sensor: self.sensor.clone(),
            size: self.size,
            crop: self.crop,
            overscan: self.overscan,
            max_depth: self.max_depth,
            strict: self.strict,
            threads: machine::threads(),
            ..mitsuba::Options::default()
        }
    }

    /// The same as command line options, for messages.
    pub fn as_text(&self) -> String {
        let definitions = self.define.iter().map(|(name, value)| format!(" -D '{name}={value}'"));
        let sensor = self.sensor.iter().map(|sensor| format!(" --sensor {sensor}"));
        let size = self.size.iter().map(|(width, height)| format!(" --size {width}x{height}"));
        let crop = self.crop.iter().map(|crop| format!(" --crop {crop}"));
        let overscan = (self.overscan > 0).then(|| format!(" --overscan {}", self.overscan));
        let depth = self.max_depth.map(|depth| {
            if depth == u32::MAX { " --max-depth -1".to_owned() } else { format!(" --max-depth {depth}") }
        });
        definitions.chain(sensor).chain(size).chain(crop).chain(overscan).chain(depth).collect()
    }
}

/// Loads a scene and shows the loader's warnings.
pub fn load(path: &Path, options: &mitsuba::Options) -> Result<Scene> {
    read(|| mitsuba::load(path, options))
}

/// A scene that somebody loads, with the loader's warnings shown.
pub fn read(load: impl FnOnce() -> Result<Scene>) -> Result<Scene> {
    let scene = load()?;
    scene.warnings().iter().for_each(|warning| warn(warning));
    Ok(scene)
}

fn parse_depth(text: &str) -> Result<u32, String> {
    let depth = if text == "-1" { Some(u32::MAX) } else { text.parse().ok() };
    depth.ok_or_else(|| "a depth is a number of edges, or -1 for any".to_owned())
}

fn parse_crop(text: &str) -> Result<Crop, String> {
    let error = || "a part of the film is written X,Y,WIDTHxHEIGHT, as in 100,50,320x180".to_owned();
    let [x, y, size] = text.splitn(3, ',').collect::<Vec<_>>()[..] else { return Err(error()) };
    let (width, height) = super::parse_size(size.trim())?;
    let number = |text: &str| text.trim().parse().map_err(|_| error());
    Ok(Crop { x: number(x)?, y: number(y)?, width, height })
}
