//! A render so far: its film, and what was found out about its tiles on the way.

use std::time::Duration;

use super::SampleId;
use super::per_tile::PerTile;
use super::thinning::Shares;
use crate::film::{Film, Needs, Rejected};
use crate::neighbours::Encoder;
use crate::scene::Scene;

/// A rendered film with its statistics.
pub struct RenderOutcome {
    /// The film.
    pub film: Film,
    /// Samples of the pixel that has the fewest.
    pub spp: u32,
    /// Wall-clock time, including that before a resumption.
    pub elapsed: Duration,
    /// Whether the caller stopped it early.
    pub stopped: bool,
    /// The first sample that was not finite, for `--replay`.
    pub first_rejected: Option<(SampleId, Rejected)>,
    /// Findings about the tiles; made again when a film is read from a file.
    pub(crate) choices: Choices,
}

/// Findings about every tile, made when they are first needed and kept for the whole render.
pub(crate) struct Choices {
    /// Result of [`grids`](super::seen::grids).
    pub(super) grids: PerTile<Vec<u32>>,
    /// Samples with differences.
    pub(super) shares: Shares,
    /// Encoder of the pilot's samples while neighbours are pending, for kernels that ask for one.
    pub(super) encoder: Option<Encoder>,
}

impl RenderOutcome {
    /// An empty film.
    pub fn new(scene: &Scene, needs: Needs) -> Self {
        let film = Film::new(scene.sensor().width, scene.sensor().height, needs);
        Self::of(if needs.lights > 0 { film.with_lights(scene.light_groups().names()) } else { film })
    }

    /// A film with its samples, as if no time had been spent on it.
    pub(crate) fn of(film: Film) -> Self {
        let tiles = film.tiles().len();
        let choices = Choices { grids: PerTile::new(tiles), shares: Shares::new(tiles), encoder: None };
        let spp = film.fewest_samples();
        Self { film, spp, elapsed: Duration::ZERO, stopped: false, first_rejected: None, choices }
    }
}
