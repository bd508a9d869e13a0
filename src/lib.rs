//! Fluxion: gradient-domain path tracing and image reconstruction.
//!
//! ```text
//! scene -> render (waves of tiles) -> Film --develop--> Frame -> reconstruct -> Solution -> metrics
//!              ^                                          |            |
//!              +----------------- adaptive: allocate <----+------------+
//! ```
//!
//! A **sample** is what one camera path leaves behind; samples are dealt to **bins**. An **edge** is the difference to
//! a neighbouring pixel, estimated from both of its ends by **shifting** paths. The **film** keeps running moments of
//! all of it; developed, it is a **frame** of **layers**: images with names and variances. A **method** reconstructs
//! an image from a frame, and the **plan** says what need not be computed for it.

pub mod error;
pub mod files;
pub mod math;

pub mod ffi;
pub mod image;
pub mod solve;

pub mod scene;

pub mod film;
pub mod plan;
pub mod render;

pub mod reconstruct;

pub mod adaptive;
pub mod checkpoint;

pub mod metrics;
pub mod reference;
pub mod validate;

pub mod stress;

pub mod bench;
pub mod report;
