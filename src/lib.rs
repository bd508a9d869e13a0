//! Fluxion: gradient-domain path tracing and image reconstruction.
//!
//! ```text
//! scene -> render (waves of tiles) -> Film --develop--> Frame -> reconstruct -> Solution -> metrics
//!              ^                                          |            |
//!              +----------------- adaptive: allocate <----+------------+
//! ```
//!
//! A **sample** is the result of one camera path; sample i of a pixel belongs to **bin** i mod 8. An **edge** is the
//! difference between two pixels, estimated from both of its ends by **shifting** paths. The **film** accumulates
//! statistics of all samples; developed, it is a **frame** of **layers**: images with names and variances. A **method**
//! reconstructs an image from a frame, and the **plan** says what need not be computed for it. A **recipe** is everything that
//! decides a render; [`pipeline`] carries it out. docs/design/glossary.md has all terms.
//!
//! ```
//! use fluxion::{Host, Recipe};
//!
//! # fn main() -> fluxion::Result<()> {
//! let file = "scenes/unit/diffuse/scene.xml".as_ref();
//! let mut recipe = Recipe::of_method("frgr");
//! recipe.limits.spp = Some(4);
//! recipe.outputs.image = true;
//! let scene = recipe.load(file)?;
//! let rendered = recipe.prepare(&scene, file)?.run_anew(&Host::QUIET)?;
//! let image = rendered.solution.expect("it was asked for").image;
//! assert_eq!((image.width, image.height), (scene.sensor().width, scene.sensor().height));
//! # Ok(())
//! # }
//! ```

#![warn(missing_docs)]

// First, for its macro `vectorized` is used by the others.
#[macro_use]
mod ffi;

mod files;
mod math;
mod pixels;
mod sync;

pub mod error;
pub mod image;

pub mod scene;

pub mod mitsuba;

pub mod film;
pub mod neighbours;
mod plan;
pub mod render;

mod nn;
pub mod reconstruct;
mod solve;

#[cfg(not(any(feature = "openimageio", feature = "pure-images")))]
compile_error!("image files need one of the features `openimageio` and `pure-images`");

pub mod adaptive;
pub mod checkpoint;
pub mod output;
pub mod pipeline;

pub mod job;

pub mod dataset;
pub mod metrics;
pub mod reference;

mod stress;
mod synthetic;

pub mod bench;
pub mod report;

/// Shows modules of the crate under the same names.
macro_rules! show {
    ($($name:ident)*) => { $(pub mod $name { pub use crate::$name::*; })* };
}

/// Modules that are no part of the library's interface, for the program, the tests, the benches and the fuzz targets.
#[doc(hidden)]
pub mod internals {
    show! { ffi files math nn pixels plan solve stress sync synthetic }
}

pub use self::error::{Error, Result};
pub use self::film::{Frame, Layer, exr};
pub use self::image::Image;
pub use self::image::io::{Extras, write_color};
pub use self::mitsuba::load;
pub use self::pipeline::{Host, Recipe};
pub use self::reconstruct::{Context, Solution, parse as parse_method, solve};
pub use self::render::{Budget, Control, RenderSettings, render};
pub use self::scene::Scene;
