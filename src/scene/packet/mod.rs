//! Sixteen rays at a time: what they meet, what lights it and how it scatters.
//!
//! What nearly every scene is made of, meshes of diffuse materials under evenly glowing meshes, is worked out for all rays
//! together; everything else is asked of its own trait, ray by ray. Both have the same bits.

mod finish;
mod lights;
mod materials;
mod rays;
mod surfaces;

pub(super) use self::finish::{Finish, Lamp};
pub use self::lights::Lights;
pub use self::materials::{Evals, Materials, Scatters, disk};
pub use self::rays::Rays;
pub use self::surfaces::{Frames, Surfaces};
