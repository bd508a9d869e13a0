//! `fluxion info`.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use super::terminal::out;
use anyhow::{Result, bail};
use fluxion::adaptive::ALLOCATORS;
use fluxion::bench;
use fluxion::error::Error;
use fluxion::film::{Layer, Needs};
use fluxion::internals::plan::Plan;
use fluxion::metrics::METRICS;
use fluxion::mitsuba;
use fluxion::mitsuba::integrator;
use fluxion::neighbours::KERNELS;
use fluxion::reconstruct::{self, METHODS, Method};
use fluxion::render::EPOCH;
use fluxion::scene::plugin::UNSUPPORTED;
use fluxion::scene::shape::Geometry;
use fluxion::scene::{Scene, bsdf, emitter, sensor, shape, texture};

/// Options of `info`.
#[derive(clap::Args)]
pub struct Args {
    /// Scene file to describe, or a checkpoint, or an EXR file of layers
    #[arg(value_name = "FILE")]
    scene: Option<PathBuf>,
    /// Method whose needs the plan is made for
    #[arg(long, default_value = reconstruct::DEFAULT, value_name = "NAME[:KEY=VALUE,...]")]
    method: String,
    /// Add version, machine and the scene's warnings, without any path, as the report of a wrong picture needs them
    #[arg(long, requires = "scene")]
    report: bool,
    /// List the methods with their parameters
    #[arg(long)]
    methods: bool,
    /// List the layers that files hold, as a Markdown table
    #[arg(long)]
    layers: bool,
    /// List what scene files may contain, as a Markdown table
    #[arg(long)]
    plugins: bool,
    /// List the kernels: neighbours that paths can be shifted to
    #[arg(long)]
    kernels: bool,
    /// List the metrics
    #[arg(long)]
    metrics: bool,
    #[command(flatten)]
    options: super::scene::Args,
}

/// Prints the requested lists.
pub fn run(args: &Args) -> Result<ExitCode> {
    if args.methods {
        methods()?;
    }
    if args.layers {
        layers()?;
    }
    if args.plugins {
        plugins()?;
    }
    if args.metrics {
        METRICS.iter().try_for_each(|metric| out!("{:>10}  {}", metric.id, metric.summary))?;
    }
    if args.kernels {
        KERNELS.iter().try_for_each(|kernel| out!("{:>10}  {}; {}", kernel.id, kernel.summary, kernel.takes()))?;
    }
    match &args.scene {
        Some(path) => file(path, args)?,
        None if !(args.methods || args.kernels || args.layers || args.plugins || args.metrics) => {
            bail!(Error::Usage(
                "give a scene file, or one of --methods, --kernels, --layers, --plugins, --metrics".into()
            ));
        }
        None => {}
    }
    Ok(ExitCode::SUCCESS)
}

/// Describes a scene, a checkpoint or a file of layers.
fn file(path: &Path, args: &Args) -> Result<()> {
    if super::stored::describe(path)? {
        if args.report {
            bail!(Error::Usage("--report is about scenes: give the scene's file".into()));
        }
        return Ok(());
    }
    let options = mitsuba::Options { sensor_optional: true, ..args.options.options() };
    // Elsewhere warnings are shown as they are found, with their paths.
    let scene = if args.report { mitsuba::load(path, &options)? } else { super::scene::load(path, &options)? };
    if args.report {
        report(&scene, path)?;
    }
    describe(&scene, &args.method)
}

fn methods() -> Result<()> {
    for method in METHODS {
        out!("{}  {}", method.id, method.summary)?;
        for parameter in method.parameters {
            out!("    {}={}  {}", parameter.name, parameter.default, parameter.summary)?;
        }
    }
    let estimates = |method: &&Method| reconstruct::parse(method.id).is_ok_and(|made| made.estimates_error());
    let names: Vec<_> = METHODS.iter().filter(estimates).map(|method| method.id).collect();
    out!("\nof which {} estimate their error, for --adaptive and --target-error", names.join(", "))?;
    out!("\nallocators of --adaptive:")?;
    ALLOCATORS.iter().try_for_each(|allocator| out!("    {}  {}", allocator.id(), allocator.summary()))
}

fn layers() -> Result<()> {
    out!("| channels | unit | range | recorded with | what |\n|---|---|---|---|---|")?;
    for layer in Layer::all().filter(|layer| layer.bin_number().unwrap_or(0) == 0) {
        let info = layer.info();
        let names = layer.channel_names().iter().map(|name| format!("`{name}`")).collect::<Vec<_>>().join(" ");
        out!("| {names} | {} | {} | {} | {} |", info.unit, info.range, info.flag, info.summary)?;
    }
    Ok(())
}

fn plugins() -> Result<()> {
    out!("| element | type | parameters |\n|---|---|---|")?;
    let row = |class: &str, name: &str, parameters: &str| out!("| {class} | `{name}` | {parameters} |");
    shape::PLUGINS.iter().try_for_each(|plugin| row("shape", plugin.name, plugin.parameters))?;
    mitsuba::CONTAINERS.iter().try_for_each(|(name, parameters)| row("shape", name, parameters))?;
    bsdf::PLUGINS.iter().try_for_each(|plugin| row("bsdf", plugin.name, plugin.parameters))?;
    texture::PLUGINS.iter().try_for_each(|plugin| row("texture", plugin.name, plugin.parameters))?;
    row("emitter", "area", "radiance (in a shape)")?;
    emitter::PLUGINS.iter().try_for_each(|plugin| row("emitter", plugin.name, plugin.parameters))?;
    sensor::PLUGINS.iter().try_for_each(|(name, parameters)| row("sensor", name, parameters))?;
    integrator::PLUGINS.iter().try_for_each(|(name, parameters)| row("integrator", name, parameters))?;
    out!("\n| left out | type | why, or what to do |\n|---|---|---|")?;
    UNSUPPORTED.iter().try_for_each(|(class, name, reason)| row(class, name, reason))
}

/// Everything besides [`describe`] that somebody needs who looks into a wrong picture.
fn report(scene: &Scene, path: &Path) -> Result<()> {
    out!("fluxion      {}, epoch {} of samples", env!("CARGO_PKG_VERSION"), EPOCH)?;
    out!("machine      {}, {}", std::env::consts::OS, bench::machine())?;
    let folder = path.parent().unwrap_or(Path::new(""));
    for warning in scene.warnings() {
        out!("warning      {}", without_folder(warning, folder))?;
    }
    Ok(())
}

/// A warning whose file is named without its folders: the scene's, or those of a name that leads elsewhere.
fn without_folder(warning: &str, folder: &Path) -> String {
    let below = warning.strip_prefix(&*folder.to_string_lossy()).unwrap_or(warning);
    let (file, what) = below.split_once(": ").unwrap_or((below, ""));
    let name = file.rsplit(['/', '\\']).next().unwrap_or(file);
    format!("{name}: {what}")
}

fn describe(scene: &Scene, method: &str) -> Result<()> {
    let (mut meshes, mut triangles) = (0, 0);
    for shape in scene.shapes() {
        if let Geometry::Mesh(mesh) = &*shape.geometry {
            meshes += 1;
            triangles += mesh.triangles.len();
        }
    }
    let others = scene.shapes().len() - meshes;
    let (sensor, integrator) = (scene.sensor(), scene.integrator());
    let depth = if integrator.max_depth == u32::MAX { "unbounded".into() } else { integrator.max_depth.to_string() };
    let (major, minor, patch) = scene.embree_version();
    for (number, sensor) in scene.sensors().iter().enumerate() {
        let id = sensor.id.as_ref().map_or(String::new(), |id| format!(" `{id}`"));
        out!("sensor {number:<5} {}{id}", sensor.plugin)?;
    }
    match scene.sensors().is_empty() {
        true => out!("sensor       none: the scene cannot be rendered")?,
        false => out!("film         {}x{}, {} spp", sensor.width, sensor.height, sensor.spp)?,
    }
    out!("paths        depth {depth}, Russian roulette from {}", integrator.rr_depth)?;
    out!("shapes       {meshes} meshes with {triangles} triangles, {others} others")?;
    let mut names: Vec<_> = scene.emitters().iter().map(|emitter| emitter.name()).collect();
    names.sort_unstable();
    names.dedup();
    out!("emitters     {} ({})", scene.emitters().len(), names.join(", "))?;
    let bounds = scene.bounds();
    if !bounds.is_empty() {
        let origin = scene.origin().as_vec3();
        out!("bounds       {} to {}", bounds.lower + origin, bounds.upper + origin)?;
    }
    out!("hierarchy    Embree {major}.{minor}.{patch}")?;
    out!("fingerprint  {}", scene.fingerprint_hex())?;
    out!("with method {method}:")?;
    let needs = reconstruct::parse(method)?.needs();
    let plan = Plan::new(scene, needs, Needs::default());
    out!("  film         {} bytes a pixel, 24 more where the camera sees an emitter", plan.needs.bytes_per_pixel())?;
    for item in plan.items {
        let verb = if item.computed { "computed" } else { "left out" };
        out!("  {:<12} {verb}: {}", item.name, item.reason)?;
    }
    Ok(())
}
