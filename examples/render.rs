//! Renders a scene: `cargo run --release --example render -- scenes/cornell-box/scene.xml image.exr 64`.

use std::path::Path;

use fluxion::{Budget, Context, Control, Extras, RenderSettings, load, parse_method, render, solve, write_color};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [scene, image, spp] = arguments.as_slice() else {
        return Err("give a scene file, an image to write, and samples per pixel".into());
    };
    let scene = load(Path::new(scene), &Default::default())?;
    let method = parse_method("frgr")?;
    let settings = RenderSettings::new(Budget::Spp(spp.parse()?), method.needs());
    let outcome = render(&scene, settings, &Control::QUIET);
    let frame = outcome.film.develop();
    let solution = solve(method.as_ref(), &frame, &Context::QUIET)?;
    write_color(Path::new(image), &solution.image, &Extras::default())?;
    println!("{} samples in {:.2} s", outcome.film.samples(), outcome.elapsed.as_secs_f64());
    Ok(())
}
