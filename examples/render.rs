//! Renders a scene as the program does: `cargo run --release --example render -- scenes/cornell-box/scene.xml image.exr 64`.

use std::path::{Path, PathBuf};

use fluxion::{Host, Recipe};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [file, image, spp] = arguments.as_slice() else {
        return Err("give a scene file, an image to write, and samples per pixel".into());
    };
    let mut recipe = Recipe::of_method("frgr");
    recipe.limits.spp = Some(spp.parse()?);
    recipe.outputs.images = vec![PathBuf::from(image)];
    let scene = recipe.load(Path::new(file))?;
    let prepared = recipe.prepare(&scene, Path::new(file))?;
    let mut rendered = prepared.run_anew(&Host { warn: &|text| eprintln!("warning: {text}"), ..Host::QUIET })?;
    prepared.write(&mut rendered)?;
    println!(
        "{} samples in {:.2} s; {}",
        rendered.stats.samples,
        rendered.stats.seconds.render,
        prepared.plan.summary()
    );
    Ok(())
}
