//! The result of one camera path and of its shifted copies.

use std::fmt;

use super::neighbours::STEPS;
use super::statistics::{RECORDED, Recorded, VALUES};
use crate::math::{Rgb, Vec3};

/// Auxiliary values at the first surface on the camera path that has a non-delta lobe.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Features {
    /// Albedo of the material, in [0, 1].
    pub albedo: Rgb,
    /// Shading normal in world space, on the viewer's side.
    pub normal: Vec3,
    /// Length of the path from the camera, in scene units.
    pub depth: f32,
    /// Least roughness of the material's smooth lobes: 0 without such, 1 for diffuse ones.
    pub roughness: f32,
    /// Kinds of scattering there and before.
    pub scattering: Scattering,
}

/// A set of kinds of scattering.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Scattering(u8);

impl Scattering {
    /// Diffuse lobes.
    pub const DIFFUSE: Self = Self(1);
    /// Lobes about a direction.
    pub const GLOSSY: Self = Self(2);
    /// Mirrors and clear glass.
    pub const SPECULAR: Self = Self(4);
    /// The camera's path leaves its first surface on the side that it came from.
    pub const REFLECTION: Self = Self(8);
    /// The camera's path leaves it on the other side.
    pub const TRANSMISSION: Self = Self(16);
    /// The surface emits light.
    pub const EMISSION: Self = Self(32);

    /// Every kind, in the order of arrays of them.
    pub const KINDS: [Self; 6] =
        [Self::DIFFUSE, Self::GLOSSY, Self::SPECULAR, Self::REFLECTION, Self::TRANSMISSION, Self::EMISSION];

    /// One for each of the kinds that belongs to the set, and zero for the others.
    pub fn indicators(self) -> [f32; Self::KINDS.len()] {
        Self::KINDS.map(|kind| f32::from(u8::from(self.has(kind))))
    }

    /// Whether these kinds belong to the set.
    pub fn has(self, kinds: Self) -> bool {
        self.0 & kinds.0 == kinds.0
    }

    /// Adds kinds if a condition holds.
    #[must_use]
    pub fn with(self, kinds: Self, condition: bool) -> Self {
        if condition { Self(self.0 | kinds.0) } else { self }
    }
}

impl Features {
    /// Albedo, normal and depth as one vector.
    pub(super) fn surface(self) -> [f32; 7] {
        let (a, n) = (self.albedo, self.normal);
        [a.x, a.y, a.z, n.x, n.y, n.z, self.depth]
    }
}

/// One end's share of the differences "neighbour minus pixel", in the order of the pixel's half-edges; zero across the film's
/// border.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Differences<'a> {
    /// Differences of the scattered radiance.
    pub color: &'a [Rgb],
    /// Differences of the radiance that an ambient light would add; as many.
    pub ambient: &'a [Rgb],
}

/// The result of one camera path.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Sample {
    /// Scattered radiance: an unbiased estimate of the pixel without `direct`.
    pub color: Rgb,
    /// Radiance of emitters that the camera sees directly.
    pub direct: Rgb,
    /// Auxiliary values.
    pub features: Features,
    /// Radiance that an unoccluded ambient light of radiance one would add to the colour.
    pub ambient: Rgb,
    /// Further values.
    pub values: Values,
}

/// Values of a sample that are there for a statistic alone: of [`Recorded::Alpha`] whether the path has met something that does not just
/// let it through, of [`Recorded::Occlusion`] whether a direction is unoccluded, of [`Recorded::Position`] the surface point.
#[derive(Clone, Copy, Default, PartialEq)]
pub struct Values([f32; VALUES]);

impl Values {
    /// Values of a statistic.
    #[inline(always)]
    pub fn get<const N: usize>(&self, statistic: Recorded) -> [f32; N] {
        std::array::from_fn(|k| self.0[statistic.offset() + k])
    }

    /// Sets those of a statistic.
    #[inline(always)]
    pub fn set<const N: usize>(&mut self, statistic: Recorded, values: [f32; N]) {
        self.0[statistic.offset()..][..N].copy_from_slice(&values);
    }
}

impl fmt::Debug for Values {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let ends = RECORDED.iter().skip(1).map(|row| row.id.offset()).chain([VALUES]);
        let spans = RECORDED.iter().zip(ends).map(|(row, end)| (row.name, &self.0[row.id.offset()..end]));
        f.debug_map().entries(spans.filter(|(_, values)| !values.is_empty())).finish()
    }
}

/// The light of one group of emitters in a sample.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct GroupLight {
    /// Its share of the scattered radiance.
    pub color: Rgb,
    /// Its share of the directly seen one.
    pub direct: Rgb,
}

impl GroupLight {
    /// Both as one vector.
    pub(super) fn values(self) -> [f32; 6] {
        let (color, direct) = (self.color, self.direct);
        [color.x, color.y, color.z, direct.x, direct.y, direct.z]
    }
}

/// A sample with everything that came along.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Taken<'a> {
    /// The sample.
    pub sample: &'a Sample,
    /// Its differences, if the path was shifted.
    pub differences: Option<Differences<'a>>,
    /// Light of every group of emitters; none where it is not recorded.
    pub lights: &'a [GroupLight],
}

impl<'a> Taken<'a> {
    /// A sample by itself.
    pub fn alone(sample: &'a Sample) -> Self {
        Self { sample, differences: None, lights: &[] }
    }

    /// Differences of the scattered radiance.
    pub(super) fn colors(&self) -> &'a [Rgb] {
        self.differences.map_or(&[], |differences| differences.color)
    }

    /// Differences of the ambient light.
    pub(super) fn ambients(&self) -> &'a [Rgb] {
        self.differences.map_or(&[], |differences| differences.ambient)
    }

    /// Fails on NaN, on infinities and on values whose variance would overflow.
    pub(super) fn check(&self) -> Result<(), Rejected> {
        self.sample.check(self.differences.unwrap_or(Differences::NONE))
    }
}

/// The reason for counting a sample as zero: the part of it that is not finite, or too large to be squared.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Rejected(
    /// Name of that part.
    pub &'static str,
);

impl Rejected {
    const PARTS: [&'static str; 5] = ["color", "direct", "features", "ambient light", "edges"];

    /// The reason with a given name, as read from a file.
    pub fn named(name: &str) -> Self {
        Self(Self::PARTS.into_iter().find(|part| *part == name).unwrap_or("unknown part"))
    }
}

/// Largest magnitude that is accepted: the sum of a million squares of it still fits into a float.
const LARGEST: f32 = 1e16;

impl Sample {
    /// Fails on NaN, on infinities and on values whose variance would overflow.
    pub(super) fn check(&self, differences: Differences) -> Result<(), Rejected> {
        let finite = |ok: bool, part| if ok { Ok(()) } else { Err(Rejected(part)) };
        let value = |value: f32| value.abs() <= LARGEST;
        let color = |color: &Rgb| color.abs().max_element() <= LARGEST && !color.is_nan();
        finite(color(&self.color), "color")?;
        finite(color(&self.direct), "direct")?;
        let mut features = self.features.surface().into_iter().chain(self.values.0);
        finite(features.all(value), "features")?;
        finite(color(&self.ambient) && differences.ambient.iter().all(color), "ambient light")?;
        finite(differences.color.iter().all(color), "edges")
    }
}

/// As many zeros as a pixel can have differences.
const ZEROS: [Rgb; STEPS.len()] = [Rgb::ZERO; STEPS.len()];

impl Differences<'_> {
    /// Differences of a path that was not shifted.
    pub const NONE: Self = Self { color: &[], ambient: &[] };

    /// As many differences, all of them zero.
    pub(super) fn zeroed(self) -> Self {
        Self { color: &ZEROS[..self.color.len()], ambient: &ZEROS[..self.ambient.len()] }
    }
}
