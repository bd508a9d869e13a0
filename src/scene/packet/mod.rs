//! Sixteen rays at a time: the surfaces that they hit, the light that these receive and how they scatter it.
//!
//! Triangle meshes, materials with closures and meshes of uniform radiance, which make up most of nearly every scene, are
//! evaluated in lanes; everything else goes through the scalar traits, lane by lane. Both give the same bits.

mod info;
mod lights;
mod materials;
mod rays;
mod shadows;
mod surfaces;

pub(super) use self::info::{EmitterInfo, ShapeInfo};
pub use self::lights::Lights;
pub use self::materials::Materials;
pub use self::rays::Rays;
pub use self::shadows::{ShadowRays, ShadowRequest};
pub use self::surfaces::{Frames, Hits, Surfaces};
