//! Small scenes for tests, from XML text.

pub mod frames;

use std::path::PathBuf;
use std::process::{Child, Command};
use std::time::Duration;

use fluxion::film::{Film, Needs};
use fluxion::mitsuba;
use fluxion::render::{Budget, Control, RenderSettings, Shift, render};
use fluxion::scene::Scene;

/// The repository's top folder.
pub fn root() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
}

/// A scene from the inside of its `<scene>` element.
pub fn scene(body: &str) -> Scene {
    try_scene(body).unwrap_or_else(|error| panic!("{error}\n{body}"))
}

/// The same for scenes that may be wrong.
pub fn try_scene(body: &str) -> fluxion::error::Result<Scene> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scene.xml");
    std::fs::write(&path, format!("<scene version=\"3.0.0\">\n{body}\n</scene>")).unwrap();
    mitsuba::load(&path, &mitsuba::Options::default())
}

/// A bundled scene at a size of our choice.
pub fn bundled(name: &str, size: (usize, usize)) -> Scene {
    let options = mitsuba::Options { size: Some(size), ..mitsuba::Options::default() };
    mitsuba::load(&root().join("scenes").join(name).join("scene.xml"), &options).unwrap()
}

/// A camera at `origin` that looks at the coordinate origin.
pub fn sensor(origin: &str, width: usize, height: usize) -> String {
    format!(
        r#"<sensor type="perspective"><float name="fov" value="40"/>
        <transform name="to_world"><lookat origin="{origin}" target="0,0,0" up="0,1,0"/></transform>
        <film type="hdrfilm"><integer name="width" value="{width}"/><integer name="height" value="{height}"/></film>
        </sensor>"#
    )
}

/// Waits until a program listens to signals, however slow the machine, or has ended.
pub fn wait_until_it_listens(child: &Child) {
    let listens = || {
        let status = std::fs::read_to_string(format!("/proc/{}/status", child.id())).unwrap();
        let caught = status.lines().find_map(|line| line.strip_prefix("SigCgt:")).map(str::trim).unwrap_or_default();
        // The bit of a request to terminate, which is signal 15.
        status.contains("zombie") || u64::from_str_radix(caught, 16).unwrap() >> 14 & 1 == 1
    };
    while !listens() {
        std::thread::sleep(Duration::from_millis(5));
    }
}

/// Sends a running program a signal, some time after it has begun to listen to them.
pub fn signal(child: &Child, signal: &str, after: Duration) {
    wait_until_it_listens(child);
    std::thread::sleep(after);
    Command::new("kill").args([signal, &child.id().to_string()]).status().unwrap();
}

/// Renders some samples of every pixel.
pub fn film(scene: &Scene, spp: u32, seed: u64, needs: Needs) -> Film {
    shifted_film(scene, spp, seed, needs, Shift::default())
}

/// The same with a shift of our choice.
pub fn shifted_film(scene: &Scene, spp: u32, seed: u64, needs: Needs, shift: Shift) -> Film {
    let settings = RenderSettings { seed, shift, ..RenderSettings::new(Budget::Spp(spp), needs) };
    render(scene, settings, &Control::QUIET).film
}

/// Over all values, means over sixteen runs of what must be zero in the mean look like it: centred, spread as Student's t
/// with 15 degrees of freedom, without a tail.
pub fn check_zero(name: &str, runs: &[Vec<f64>]) {
    let n = runs.len() as f64;
    let (mut sum, mut squares, mut beyond, mut count) = (0.0, 0.0, 0, 0.0);
    for at in 0..runs[0].len() {
        let mean = runs.iter().map(|run| run[at]).sum::<f64>() / n;
        let variance = runs.iter().map(|run| (run[at] - mean).powi(2)).sum::<f64>() / (n - 1.0) / n;
        if variance == 0.0 {
            assert_eq!(mean, 0.0, "{name}: a value without variance");
            continue;
        }
        let t = mean / variance.sqrt();
        (sum, squares, count) = (sum + t, squares + t * t, count + 1.0);
        beyond += usize::from(t.abs() > 4.0);
    }
    assert!(count > 500.0 && (sum / count).abs() < 5.0 / f64::sqrt(count), "{name}: mean t {}", sum / count);
    let spread = (squares / count).sqrt();
    // Pixels are not independent: all have the same position on the film in a sample.
    assert!(spread > 0.75 && spread < 1.35, "{name}: spread {spread} instead of 1.07");
    assert!(beyond as f64 <= 0.01 * count, "{name}: {beyond} of {count} beyond four");
}
