//! `fluxion info`.

use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::{Result, bail};
use fluxion::adaptive::ALLOCATORS;
use fluxion::error::Error;
use fluxion::film::{Layer, Needs};
use fluxion::metrics::METRICS;
use fluxion::plan::Plan;
use fluxion::reconstruct::{self, METHODS, Method};
use fluxion::reference::fingerprint;
use fluxion::scene::load::integrator;
use fluxion::scene::shape::Geometry;
use fluxion::scene::{Scene, bsdf, emitter, load, sensor, shape, texture};

/// Options of `info`.
#[derive(clap::Args)]
pub struct Args {
    /// Scene file to describe
    scene: Option<PathBuf>,
    /// Method whose needs the plan is made for
    #[arg(long, default_value = reconstruct::DEFAULT, value_name = "NAME[:KEY=VALUE,...]")]
    method: String,
    /// List the methods with their parameters
    #[arg(long)]
    methods: bool,
    /// List the layers that files hold, as a Markdown table
    #[arg(long)]
    layers: bool,
    /// List what scene files may contain, as a Markdown table
    #[arg(long)]
    plugins: bool,
    /// List the metrics
    #[arg(long)]
    metrics: bool,
    /// Value of a scene parameter, over its <default>
    #[arg(short = 'D', value_parser = super::parse_definition, value_name = "NAME=VALUE")]
    define: Vec<(String, String)>,
}

/// Prints the requested lists.
pub fn run(args: &Args) -> Result<ExitCode> {
    if args.methods {
        methods();
    }
    if args.layers {
        layers();
    }
    if args.plugins {
        plugins();
    }
    if args.metrics {
        METRICS.iter().for_each(|metric| println!("{:>10}  {}", metric.id, metric.summary));
    }
    match &args.scene {
        Some(path) => {
            let options = load::Options { parameters: args.define.clone(), ..load::Options::default() };
            describe(&load::load(path, &options)?, &args.method)?;
        }
        None if !(args.methods || args.layers || args.plugins || args.metrics) => {
            bail!(Error::Usage("give a scene file, or one of --methods, --layers, --plugins, --metrics".into()));
        }
        None => {}
    }
    Ok(ExitCode::SUCCESS)
}

fn methods() {
    for method in METHODS {
        println!("{}  {}", method.id, method.summary);
        for parameter in method.parameters {
            println!("    {}={}  {}", parameter.name, parameter.default, parameter.summary);
        }
    }
    let estimates = |method: &&Method| reconstruct::parse(method.id).is_ok_and(|made| made.estimates_error());
    let names: Vec<_> = METHODS.iter().filter(estimates).map(|method| method.id).collect();
    println!("\nof which {} estimate their error, for --adaptive and --target-error", names.join(", "));
    println!("\nallocators of --adaptive:");
    ALLOCATORS.iter().for_each(|allocator| println!("    {}  {}", allocator.id(), allocator.summary()));
}

fn layers() {
    println!("| channels | unit | range | recorded with | what |\n|---|---|---|---|---|");
    for layer in Layer::all().filter(|layer| layer.bin_number().unwrap_or(0) == 0) {
        let info = layer.info();
        let names = layer.channel_names().iter().map(|name| format!("`{name}`")).collect::<Vec<_>>().join(" ");
        println!("| {names} | {} | {} | {} | {} |", info.unit, info.range, info.flag, info.summary);
    }
}

fn plugins() {
    println!("| element | type | parameters |\n|---|---|---|");
    let row = |class: &str, name: &str, parameters: &str| println!("| {class} | `{name}` | {parameters} |");
    shape::PLUGINS.iter().for_each(|plugin| row("shape", plugin.name, plugin.parameters));
    load::CONTAINERS.iter().for_each(|(name, parameters)| row("shape", name, parameters));
    bsdf::PLUGINS.iter().for_each(|plugin| row("bsdf", plugin.name, plugin.parameters));
    texture::PLUGINS.iter().for_each(|plugin| row("texture", plugin.name, plugin.parameters));
    row("emitter", "area", "radiance (in a shape)");
    emitter::PLUGINS.iter().for_each(|plugin| row("emitter", plugin.name, plugin.parameters));
    sensor::PLUGINS.iter().for_each(|(name, parameters)| row("sensor", name, parameters));
    integrator::PLUGINS.iter().for_each(|(name, parameters)| row("integrator", name, parameters));
    println!("\n| left out | type | why, or what to do |\n|---|---|---|");
    load::UNSUPPORTED.iter().for_each(|(class, name, reason)| row(class, name, reason));
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
    println!("film         {}x{}, {} spp", sensor.width, sensor.height, sensor.spp);
    println!("paths        depth {depth}, Russian roulette from {}", integrator.rr_depth);
    println!("shapes       {meshes} meshes with {triangles} triangles, {others} others");
    let mut names: Vec<_> = scene.emitters().iter().map(|emitter| emitter.name()).collect();
    names.sort_unstable();
    names.dedup();
    println!("emitters     {} ({})", scene.emitters().len(), names.join(", "));
    let bounds = scene.bounds();
    if !bounds.is_empty() {
        println!("bounds       {} to {}", bounds.lower, bounds.upper);
    }
    println!("hierarchy    Embree {major}.{minor}.{patch}");
    println!("fingerprint  {}", fingerprint(scene));
    println!("with method {method}:");
    let needs = reconstruct::parse(method)?.needs();
    let plan = Plan::new(scene, needs, Needs::default());
    println!("  film         {} bytes a pixel, 24 more where the camera sees an emitter", plan.needs.bytes_per_pixel());
    for item in plan.items {
        let verb = if item.computed { "computed" } else { "left out" };
        println!("  {:<12} {verb}: {}", item.name, item.reason);
    }
    Ok(())
}
