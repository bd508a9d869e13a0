//! Reconstructs the layers that `fluxion render --layers` has saved, by several methods:
//! `cargo run --release --example reconstruct -- layers.exr l1 frgr:levels=3` writes l1.exr and frgr.exr.

use std::path::Path;

use fluxion::{Context, Extras, exr, parse_method, solve, write_color};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let layers = arguments.next().ok_or("give a file of layers, and methods")?;
    let frame = exr::load(Path::new(&layers))?;
    for method in arguments {
        let solution = solve(parse_method(&method)?.as_ref(), &frame, &Context::QUIET)?;
        let name = method.split(':').next().unwrap_or(&method);
        let layers = solution.error.as_ref().map(|error| ("error", error)).into_iter().collect();
        let extras = Extras { layers, ..Extras::default() };
        write_color(Path::new(&format!("{name}.exr")), &solution.image, &extras)?;
    }
    Ok(())
}
