//! Differences where they pay: in how many of every three samples a tile takes them, by what they cost there.

use super::per_tile::PerTile;

/// Samples of a pixel that come with differences whatever they cost: with fewer nothing is known of their variances.
const FIRST: u32 = 8;

/// Samples of which some come with differences. Every third of a sequence is as well distributed as all of it; every second or
/// fourth of a base-two sequence would keep to one side of its strata.
const OF: u32 = 3;

/// Cost of a sample's differences besides the rays of offsets, in path samples (fitted to fourteen scenes).
const REST: f32 = 0.1;

/// Cost of a sample besides rays, in rays of paths.
const SAMPLE: f32 = 2.0;

/// Exponents of the number of samples, and of the share of them that comes with differences, that errors of `frgr` fall with
/// (docs/design/performance.md, "Differences where they pay").
const BY_SAMPLES: f32 = 0.8;
const BY_SHARE: f32 = 0.4;

/// Costs of a wave, in rays of paths.
#[derive(Clone, Copy, Debug, Default)]
pub struct Work {
    /// Cost of the paths.
    pub paths: f32,
    /// Cost of the offsets beside them.
    pub offsets: f32,
}

impl Work {
    /// Cost of a sample, by that of `pixels` of them with differences, in rays of paths.
    pub fn per_sample(self, pixels: usize) -> f32 {
        SAMPLE + (self.paths + share(self) as f32 / OF as f32 * self.offsets) / pixels as f32
    }
}

/// Samples of every [`OF`] that come with differences: as many as make the error at equal time, samples^-a share^-b, least.
fn share(work: Work) -> u32 {
    let cost = REST + work.offsets / work.paths.max(1.0);
    let error = |thirds: u32| {
        let share = thirds as f32 / OF as f32;
        libm::powf(1.0 + share * cost, BY_SAMPLES) * libm::powf(share, -BY_SHARE)
    };
    (1..OF).rev().fold(OF, |best, thirds| if error(thirds) < error(best) { thirds } else { best })
}

/// The work of the tiles of a film, found when it is first needed, and the shares that follow from it. They depend on scene and seed alone, so
/// that samples stay the same in whatever order and on whatever machine they are taken.
pub struct Shares(PerTile<(Work, u32)>);

impl Shares {
    /// Shares of a number of tiles, none of them known.
    pub fn new(tiles: usize) -> Self {
        Self(PerTile::new(tiles))
    }

    /// Tells the work of a tile's samples of number zero.
    pub fn learn(&self, tile: usize, work: Work) {
        self.0.get(tile, || (work, share(work)));
    }

    /// Whether sample `number` of a tile comes with differences; `find` finds the work of samples number zero if it is not known.
    pub fn has_differences(&self, tile: usize, number: u32, find: impl FnOnce() -> Work) -> bool {
        number < FIRST || number % OF < self.get(tile, find).1
    }

    /// Work of a tile's samples of number zero; `find` finds it if it is not known.
    pub fn work(&self, tile: usize, find: impl FnOnce() -> Work) -> Work {
        self.get(tile, find).0
    }

    fn get(&self, tile: usize, find: impl FnOnce() -> Work) -> &(Work, u32) {
        self.0.get(tile, || {
            let work = find();
            (work, share(work))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn costly_differences_are_taken_less_often() {
        let of = |offsets| share(Work { paths: 100.0, offsets });
        let shares = [0.0, 40.0, 80.0, 120.0, 200.0, 1000.0].map(of);
        assert!(shares.is_sorted_by(|a, b| a >= b), "{shares:?}");
        assert_eq!((shares[0], shares[5], share(Work::default())), (OF, 1, OF));
    }

    #[test]
    fn work_is_looked_at_once_and_only_when_it_matters() {
        let (shares, costly) = (Shares::new(2), Work { paths: 1.0, offsets: 100.0 });
        assert!((0..FIRST).all(|number| shares.has_differences(0, number, || unreachable!("not needed yet"))));
        assert!(!shares.has_differences(0, FIRST, || costly));
        assert!(shares.has_differences(0, FIRST + 1, || unreachable!("known by now")));
        shares.learn(1, Work { paths: 1.0, offsets: 0.0 });
        assert!((0..99).all(|number| shares.has_differences(1, number, || unreachable!("decided before"))));
    }
}
