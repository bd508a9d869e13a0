//! Rounds of tiles on all threads, until the samples or the time are used up or someone says stop.

use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use rayon::prelude::*;

use super::SampleId;
use super::gradient::shift::Shift;
use super::wave::Wave;
use crate::film::{Film, Needs, Rejected, Sample, TILE, Tile};
use crate::scene::Scene;

/// How much to render.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Budget {
    /// Samples of every pixel.
    Spp(u32),
    /// Wall-clock time; at least one sample is taken of every pixel.
    Time(Duration),
}

/// What to render.
#[derive(Clone, Copy, Debug)]
pub struct Settings {
    /// How much.
    pub budget: Budget,
    /// Different seeds give independent images.
    pub seed: u64,
    /// Number of the first sample of every pixel: renders that go on where others end take samples together that are
    /// spread better than independent ones.
    pub first: u32,
    /// What to record; edges make it gradient-domain path tracing.
    pub needs: Needs,
    /// How differences to neighbours are sampled.
    pub shift: Shift,
}

/// Keeps what has been rendered while there is more to come.
pub trait Keeper: Sync {
    /// Whether it is time again; asked between tiles.
    fn due(&self) -> bool;

    /// Called while nothing is being traced, and when the render has ended.
    fn keep(&self, outcome: &Outcome);
}

/// Threads between the caller and a render that is under way.
#[derive(Clone, Copy)]
pub struct Control<'a> {
    /// Set to end the render after the tiles that are being worked on.
    pub stop: &'a AtomicBool,
    /// Told the finished share, in [0, 1].
    pub progress: &'a (dyn Fn(f32) + Sync),
    /// Who keeps the film from time to time.
    pub keeper: Option<&'a dyn Keeper>,
}

/// A rendered film and how it went.
pub struct Outcome {
    /// The film.
    pub film: Film,
    /// Samples of the pixel that has the fewest.
    pub spp: u32,
    /// Wall-clock time, that of earlier sessions included.
    pub elapsed: Duration,
    /// Whether `stop` ended it early.
    pub stopped: bool,
    /// The first sample that was not finite, for `--replay`.
    pub first_rejected: Option<(SampleId, Rejected)>,
}

impl Outcome {
    /// Nothing rendered yet.
    pub fn new(scene: &Scene, needs: Needs) -> Self {
        let film = Film::new(scene.sensor().width, scene.sensor().height, needs);
        Self { film, spp: 0, elapsed: Duration::ZERO, stopped: false, first_rejected: None }
    }
}

/// Samples that a round adds to every pixel: few enough for progress and for stopping in time.
const ROUND: u32 = 8;

/// Renders until the budget is used up.
pub fn render(scene: &Scene, settings: Settings, control: &Control) -> Outcome {
    resume(scene, settings, control, Outcome::new(scene, settings.needs))
}

/// Goes on with a render of the same settings, wherever it ended, until the budget of both is used up. Samples are the
/// same bits as in a render without interruption.
pub fn resume(scene: &Scene, settings: Settings, control: &Control, mut outcome: Outcome) -> Outcome {
    outcome.stopped = false;
    while let (false, Some(round)) = (outcome.stopped, next_round(settings.budget, outcome.spp, outcome.elapsed)) {
        let (done, elapsed, start) = (outcome.spp, outcome.elapsed, Instant::now());
        let progress = |share: f32| match settings.budget {
            Budget::Spp(spp) => (control.progress)((done as f32 + round as f32 * share) / spp as f32),
            Budget::Time(limit) => {
                (control.progress)((elapsed + start.elapsed()).as_secs_f32() / limit.as_secs_f32());
            }
        };
        let control = Control { progress: &progress, ..*control };
        run_round(scene, settings, &control, &mut outcome, &|_, _| done + round);
    }
    if let Some(keeper) = control.keeper {
        keeper.keep(&outcome);
    }
    outcome
}

/// Goes on until each pixel has as many samples as `goals` says, row by row. The budget is not looked at.
pub fn raise(scene: &Scene, settings: Settings, control: &Control, outcome: &mut Outcome, goals: &[u32]) {
    let width = outcome.film.width;
    run_round(scene, settings, control, outcome, &|x, y| goals[y * width + x]);
}

/// Samples per pixel of the next round, none when the budget is used up. A time budget is met by the rounds' own
/// mean speed: the last ones shrink so as not to overshoot.
fn next_round(budget: Budget, done: u32, elapsed: Duration) -> Option<u32> {
    match budget {
        Budget::Spp(spp) => Some(ROUND.min(spp.saturating_sub(done))).filter(|&round| round > 0),
        Budget::Time(_) if done == 0 => Some(1),
        Budget::Time(limit) => {
            let per_sample = elapsed.as_secs_f64() / f64::from(done);
            let left = limit.as_secs_f64() - elapsed.as_secs_f64();
            let affordable = (left / per_sample + 0.5) as u32;
            Some(affordable.min(ROUND).min(done)).filter(|&round| round > 0)
        }
    }
}

/// Number of samples that the pixel in a column and row is to have after a round.
type Goals<'a> = &'a (dyn Fn(usize, usize) -> u32 + Sync);

/// Renders a round, with pauses whenever the film is to be kept.
fn run_round(scene: &Scene, settings: Settings, control: &Control, outcome: &mut Outcome, goals: Goals) {
    let (before, start) = (outcome.elapsed, Instant::now());
    let mut paused = true;
    while paused {
        paused = run_tiles(scene, settings, control, outcome, goals);
        outcome.elapsed = before + start.elapsed();
        outcome.spp = outcome.film.fewest_samples();
        outcome.stopped = control.stop.load(Ordering::Relaxed);
        if let (true, Some(keeper)) = (paused, control.keeper) {
            keeper.keep(outcome);
        }
    }
}

/// Brings tiles to their goals until the film is to be kept, which returns true. `control.progress` is told the share
/// of them.
fn run_tiles(scene: &Scene, settings: Settings, control: &Control, outcome: &mut Outcome, goals: Goals) -> bool {
    let first_rejected = Mutex::new(outcome.first_rejected);
    let due = AtomicBool::new(false);
    let tiles = outcome.film.tiles_mut();
    let (total, done) = (tiles.len(), Mutex::new(0));
    let wave_of = || Wave::new(scene, settings.needs, settings.shift);
    tiles.par_iter_mut().for_each_init(wave_of, |wave, tile| {
        if control.stop.load(Ordering::Relaxed) || due.load(Ordering::Relaxed) {
            return;
        }
        let before = tile.samples();
        if let Some(rejected) = run_tile(settings, wave, tile, goals) {
            let mut first = first_rejected.lock().unwrap_or_else(|poisoned| poisoned.into_inner());
            first.get_or_insert(rejected);
        }
        let worked = tile.samples() > before;
        let mut done = done.lock().unwrap_or_else(|poisoned| poisoned.into_inner());
        *done += 1;
        (control.progress)(*done as f32 / total as f32);
        // A tile that was at its goal already is no reason for another pause.
        if worked && control.keeper.is_some_and(|keeper| keeper.due()) {
            due.store(true, Ordering::Relaxed);
        }
    });
    outcome.first_rejected = first_rejected.into_inner().unwrap_or_else(|poisoned| poisoned.into_inner());
    due.into_inner()
}

fn run_tile(settings: Settings, wave: &mut Wave, tile: &mut Tile, goals: Goals) -> Option<(SampleId, Rejected)> {
    let mut first_rejected = None;
    let at = |pixel: usize, tile: &Tile| (tile.x + pixel % tile.width, tile.y + pixel / tile.width);
    // Samples of one number are traced together, whatever number a pixel begins with.
    let spans: Vec<_> = (0..tile.width * tile.height)
        .map(|pixel| {
            let (x, y) = at(pixel, tile);
            tile.count(pixel)..goals(x, y)
        })
        .collect();
    let due = || spans.iter().filter(|span| !span.is_empty());
    let (start, end) = (due().map(|span| span.start).min(), due().map(|span| span.end).max());
    let (mut numbers, mut pixels) = (Vec::new(), Vec::new());
    for index in start.unwrap_or(0)..end.unwrap_or(0) {
        numbers.clear();
        numbers.extend((0..spans.len()).filter(|&pixel| spans[pixel].contains(&index)));
        pixels.clear();
        pixels.extend(numbers.iter().map(|&pixel| at(pixel, tile)));
        let samples = wave.trace(settings.seed, settings.first + index, &pixels);
        for ((&pixel, &(x, y)), sample) in numbers.iter().zip(&pixels).zip(samples) {
            if let Err(reason) = tile.add(pixel, sample) {
                first_rejected
                    .get_or_insert((SampleId { seed: settings.seed, x, y, index: settings.first + index }, reason));
            }
        }
    }
    first_rejected
}

/// A single sample as it is taken in a render of the whole film, with all that can be recorded of it.
pub fn sample(scene: &Scene, id: SampleId, shift: Shift) -> Sample {
    let (x, y) = (id.x / TILE * TILE, id.y / TILE * TILE);
    let (width, height) = (TILE.min(scene.sensor().width - x), TILE.min(scene.sensor().height - y));
    let pixels: Vec<_> = (0..width * height).map(|pixel| (x + pixel % width, y + pixel / width)).collect();
    Wave::new(scene, Needs::ALL, shift).trace(id.seed, id.index, &pixels)[(id.y - y) * width + id.x - x]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rounds_add_up_to_the_samples_and_stay_within_the_time() {
        let mut done = 0;
        while let Some(round) = next_round(Budget::Spp(21), done, Duration::ZERO) {
            done += round;
        }
        assert_eq!(done, 21);
        let limit = Budget::Time(Duration::from_secs(10));
        assert_eq!(next_round(limit, 0, Duration::from_secs(60)), Some(1));
        assert_eq!(next_round(limit, 4, Duration::from_secs(4)), Some(4));
        assert_eq!(next_round(limit, 9, Duration::from_secs(9)), Some(1));
        assert_eq!(next_round(limit, 10, Duration::from_secs(10)), None);
    }
}
