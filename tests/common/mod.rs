//! Small scenes for tests, from XML text.
#![allow(dead_code, reason = "every test file uses its own part")]

use std::path::PathBuf;
use std::sync::atomic::AtomicBool;

use fluxion::film::{Film, Needs};
use fluxion::render::gradient::shift::Shift;
use fluxion::render::{Budget, Control, Settings, render};
use fluxion::scene::{Scene, load};

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
    load::load(&path, &load::Options::default())
}

/// A bundled scene at a size of our choice.
pub fn bundled(name: &str, size: (usize, usize)) -> Scene {
    let options = load::Options { size: Some(size), ..load::Options::default() };
    load::load(&root().join("scenes").join(name).join("scene.xml"), &options).unwrap()
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

/// Everything a film can record.
pub const ALL: Needs =
    Needs { features: true, edges: true, bins: true, occlusion: true, position: true, ambient: true };

/// Renders some samples of every pixel.
pub fn film(scene: &Scene, spp: u32, seed: u64, needs: Needs) -> Film {
    shifted_film(scene, spp, seed, needs, Shift::default())
}

/// The same with a shift of our choice.
pub fn shifted_film(scene: &Scene, spp: u32, seed: u64, needs: Needs, shift: Shift) -> Film {
    let settings = Settings { budget: Budget::Spp(spp), seed, first: 0, needs, shift };
    render(scene, settings, &Control { stop: &AtomicBool::new(false), progress: &|_| {} }).film
}
