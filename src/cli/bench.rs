//! `fluxion bench`.

use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::atomic::Ordering;
use std::time::Duration;

use anyhow::{Result, bail};
use fluxion::adaptive;
use fluxion::bench::{Budget, Case, Results, Runner, Runs, Store, Truth};
use fluxion::error::Error;
use fluxion::reconstruct::{self, METHODS};
use fluxion::report::{Page, Shown, View, changes, errors, ratios, scene_errors, summaries};

use super::progress;
use super::terminal::{note, out};

/// Options of `bench`.
#[derive(clap::Args)]
pub struct Args {
    /// Scene files, or folders that hold a scene.xml or folders that do
    #[arg(required = true)]
    scenes: Vec<PathBuf>,
    /// Methods with their parameters, separated by commas, each also as METHOD+adaptive or METHOD+adaptive=ALLOCATOR
    /// [default: all]
    #[arg(long, value_name = "NAME[:KEY=VALUE,...],...")]
    methods: Option<String>,
    /// Times that render and reconstruction together may take, as in 2s,5s,20s
    #[arg(long, value_delimiter = ',', value_parser = super::parse_time, value_name = "TIME,...", required_unless_present = "spp")]
    times: Vec<Duration>,
    /// Samples per pixel instead
    #[arg(long, value_delimiter = ',', conflicts_with = "times", value_name = "SPP,...", value_parser = clap::value_parser!(u32).range(1..))]
    spp: Vec<u32>,
    /// Runs of everything with different random numbers
    #[arg(long, default_value_t = 3, value_parser = clap::value_parser!(u64).range(1..1000))]
    seeds: u64,
    /// References: a file, a folder with files named after scenes, or `auto`: reference.exr beside the scene,
    /// or a file named after it in a folder `references` beside the scene's or in scenes/
    #[arg(long, default_value = "auto", value_name = "FILE|DIR")]
    reference: PathBuf,
    /// Film size, which the references must have [default: theirs]
    #[arg(long, value_parser = super::parse_size, value_name = "WxH")]
    size: Option<(usize, usize)>,
    /// Folder for results.json, results.csv and images, complete after every run, and at the end index.html
    #[arg(short, long, value_name = "DIR")]
    output: PathBuf,
    /// Go on with the results that are in the folder
    #[arg(long)]
    resume: bool,
    /// Earlier results.json, to mark improvements and regressions beyond the noise of the seeds
    #[arg(long, value_name = "FILE")]
    baseline: Option<PathBuf>,
}

/// Runs everything, and writes the page.
pub fn run(args: &Args) -> Result<ExitCode> {
    let methods = methods(args.methods.as_deref())?;
    let scenes = scenes(&args.scenes)?;
    let budgets: Vec<Budget> = match args.times.is_empty() {
        true => args.spp.iter().map(|&spp| Budget::Spp(spp)).collect(),
        false => args.times.iter().map(|time| Budget::Seconds(time.as_secs_f64())).collect(),
    };
    let baseline = args.baseline.as_deref().map(Results::load).transpose()?;
    let mut store = Store::open(&args.output, args.resume)?;
    // Whatever is wrong with a scene or a reference is said before the first run.
    let mut names = Vec::new();
    for scene in &scenes {
        let case = load(args, scene)?;
        // Fails on results that cannot be continued.
        let _ = store.of(&case)?;
        check(&case, &budgets)?;
        if names.contains(&case.name) {
            bail!(Error::Usage(format!("two scenes are called {}: give their folders different names", case.name)));
        }
        names.push(case.name);
    }
    let stop = super::interrupt::stop_on_signal()?;
    let bar = progress::bar();
    let total = scenes.len() * methods.len() * budgets.len() * args.seeds as usize;
    let mut done = 0;
    for scene in &scenes {
        let case = load(args, scene)?;
        let mut report = |what: &str| {
            bar.set_message(&format!("{}, {what}", case.name));
            bar.set(done as f32 / total as f32);
            done += 1;
        };
        let runs = Runs { methods: &methods, budgets: &budgets, seeds: args.seeds };
        runs.on(&case, &mut store, stop, &mut report)?;
        if stop.load(Ordering::Relaxed) {
            break;
        }
    }
    bar.finish();
    store.save()?;
    write_page(args, &store, &scenes, &budgets, baseline.as_ref())?;
    let summaries = summaries(&store.results);
    out!("{}\nWithin the largest budget; relMSE without the references' own noise:\n", ratios(&summaries))?;
    if let Some(largest) = budgets.iter().max_by(|a, b| a.amount().total_cmp(&b.amount())) {
        let scenes = scene_errors(&store.results, &summaries, &largest.to_string());
        out!("{}", errors(&scenes).trim_end())?;
    }
    warn_of_floors(&store.results);
    if stop.load(Ordering::Relaxed) {
        note!("warning: stopped early; --resume goes on with what is missing");
    }
    let failed: Vec<_> = store.results.left_out.iter().filter(|left| left.reason.starts_with("failed")).collect();
    for left in &failed {
        note!("error: {} on {}, {}: {}", left.method, left.scene, left.budget, left.reason);
    }
    Ok(if failed.is_empty() { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

/// Methods of a list. Text after a method's colon belongs to it as long as it looks like parameters.
fn methods(list: Option<&str>) -> Result<Vec<String>> {
    let mut methods: Vec<String> = Vec::new();
    match list {
        None => methods
            .extend(METHODS.iter().map(|method| method.id.to_owned()).filter(|id| reconstruct::parse(id).is_ok())),
        Some(list) => {
            for part in list.split(',').map(str::trim) {
                match methods.last_mut() {
                    Some(last) if is_parameter(part) => *last += &format!(",{part}"),
                    _ => methods.push(part.to_owned()),
                }
            }
        }
    }
    for (k, method) in methods.iter().enumerate() {
        let (id, allocator) = adaptive::parse(method)?;
        let made = reconstruct::parse(id)?;
        if allocator.is_some_and(|allocator| allocator.needs_error()) && !made.estimates_error() {
            bail!(Error::Usage(format!("{id} does not estimate its error: write {id}+adaptive=variance")));
        }
        if methods[..k].contains(method) {
            bail!(Error::Usage(format!("method {method} is there twice")));
        }
    }
    Ok(methods)
}

/// Whether a part of a list is `name=value` and not a method such as `l1+adaptive=variance`.
fn is_parameter(part: &str) -> bool {
    part.split_once('=').is_some_and(|(name, _)| !name.contains([':', '+']))
}

/// Scene files, those in folders sorted by name.
fn scenes(paths: &[PathBuf]) -> Result<Vec<PathBuf>> {
    let mut scenes = Vec::new();
    for path in paths {
        if !path.is_dir() || path.join("scene.xml").is_file() {
            scenes.push(if path.is_dir() { path.join("scene.xml") } else { path.clone() });
            continue;
        }
        let entries = std::fs::read_dir(path).map_err(|error| Error::io(path, error))?;
        let mut inside: Vec<_> = entries.filter_map(|entry| Some(entry.ok()?.path().join("scene.xml"))).collect();
        inside.retain(|scene| scene.is_file());
        inside.sort();
        if inside.is_empty() {
            bail!(Error::io(path, "holds neither a scene.xml nor folders with one"));
        }
        scenes.append(&mut inside);
    }
    Ok(scenes)
}

fn load(args: &Args, scene: &Path) -> Result<Case> {
    Ok(Case::load(scene, reference(args), args.size)?)
}

fn reference(args: &Args) -> Option<&Path> {
    (args.reference.as_os_str() != "auto").then_some(args.reference.as_path())
}

/// Fails if a budget is not enough for a single sample of path tracing.
fn check(case: &Case, budgets: &[Budget]) -> Result<()> {
    if case.truth.floor.is_none() {
        note!(
            "warning: the reference of {0} has no noise estimate, and there is no file {0}_var.exr next to it",
            case.name
        );
    }
    let least = budgets.iter().filter_map(|budget| match budget {
        Budget::Seconds(seconds) => Some(*seconds),
        Budget::Spp(_) => None,
    });
    let Some(least) = least.min_by(f64::total_cmp) else { return Ok(()) };
    let needed = Runner::new(case, "primal")?.pilot()?.sample;
    if least < needed {
        bail!(Error::Usage(format!(
            "{least} s are below one sample per pixel of {}, which takes {needed:.2} s: give it more, or less pixels",
            case.name
        )));
    }
    Ok(())
}

/// The page: plots of everything, and the images of the middle budget.
fn write_page(
    args: &Args,
    store: &Store,
    scenes: &[PathBuf],
    budgets: &[Budget],
    baseline: Option<&Results>,
) -> Result<()> {
    let mut methods: Vec<&str> = Vec::new();
    for record in &store.results.records {
        if !methods.contains(&record.method.as_str()) {
            methods.push(&record.method);
        }
    }
    let budget = budgets[budgets.len() / 2].to_string();
    let mut views = Vec::new();
    for scene in scenes {
        let (name, truth) = Truth::of(scene, reference(args))?;
        let shown = methods.iter().filter_map(|&method| {
            Some(Shown { label: method.to_owned(), picture: store.image(&name, method, &budget)?.into() })
        });
        let images: Vec<_> = shown.collect();
        if !images.is_empty() {
            views.push(View { name: format!("{name}, {budget}"), reference: truth.image.into(), images });
        }
    }
    let changes = baseline.map_or_else(Vec::new, |then| changes(&store.results, then, "relmse"));
    let certain = changes.iter().filter(|change| change.verdict != 0);
    for change in certain {
        let word = if change.verdict < 0 { "better" } else { "worse" };
        out!("{word}: {} on {}, {}: {:.3} of the error", change.method, change.scene, change.budget, change.ratio)?;
    }
    let page = Page { title: "Error against run time".into(), results: Some(&store.results), changes, views };
    Ok(store.write("index.html", &page.html()?)?)
}

/// Says which references have more noise than the errors that were measured by them.
fn warn_of_floors(results: &Results) {
    let mut scenes: Vec<&str> = results.records.iter().map(|record| record.scene.as_str()).collect();
    scenes.sort_unstable();
    scenes.dedup();
    for scene in scenes {
        let own = results.records.iter().filter(|record| record.scene == scene);
        let least = own.clone().filter_map(|record| record.error("relmse")).fold(f64::INFINITY, f64::min);
        let floor = own.filter_map(|record| record.floor).next().unwrap_or(0.0);
        if floor > least {
            note!(
                "warning: the reference of {scene} has a relMSE of {floor:.1e} itself, which was taken off: {:.0} times the \
                 smallest error, {least:.1e}; `fluxion reference` can continue it",
                floor / least
            );
        }
    }
}
