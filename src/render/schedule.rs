//! Rounds of tiles on all threads, until the samples or the time are used up or the caller asks to stop.

use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use rayon::prelude::*;

use super::control::{Control, SampleSink, WaveSamples};
use super::gradient::Shift;
use super::outcome::{Choices, RenderOutcome};
use super::seen;
use super::wave::Wave;
use super::{SampleId, Sampler};
use crate::film::{EdgeNeed, Film, Kernel, Needs, Rejected, Sample, TILE, Tile};
use crate::math::Rgb;
use crate::neighbours::{Encoder, Pilot, Selector};
use crate::scene::Scene;
use crate::sync::{into_inner, lock};

/// Limit of a render.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Budget {
    /// Samples of every pixel.
    Spp(u32),
    /// Wall-clock time; at least one sample is taken of every pixel.
    Time(Duration),
}

/// Everything that decides the samples of a render.
#[derive(Clone, Copy, Debug)]
pub struct RenderSettings {
    /// When to stop.
    pub budget: Budget,
    /// Different seeds give independent images.
    pub seed: u64,
    /// Number of the first sample of every pixel. Films of one seed with consecutive numbers are better stratified together
    /// than films of different seeds.
    pub first: u32,
    /// Statistics to record; sampled edges make it gradient-domain path tracing.
    pub needs: Needs,
    /// Shift mapping that samples the differences.
    pub shift: Shift,
    /// Neighbours that paths are shifted to.
    pub kernel: Selector,
}

impl RenderSettings {
    /// Seed 0, the default shift and the cross.
    pub fn new(budget: Budget, needs: Needs) -> Self {
        Self { budget, seed: 0, first: 0, needs, shift: Shift::default(), kernel: Selector::default() }
    }
}

/// Samples that a round adds to every pixel: few enough for smooth progress and for meeting time limits.
const ROUND: u32 = 8;

/// Renders until the budget is used up.
pub fn render(scene: &Scene, settings: RenderSettings, control: &Control) -> RenderOutcome {
    resume(scene, settings, control, RenderOutcome::new(scene, settings.needs))
}

/// Continues a render of the same settings, wherever it was interrupted, until the budget of both is used up. The samples
/// have the same bits as without the interruption.
pub fn resume(scene: &Scene, settings: RenderSettings, control: &Control, mut outcome: RenderOutcome) -> RenderOutcome {
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
    control.conclude(&outcome);
    outcome
}

/// Continues a render until each pixel has as many samples as `goals` says, row by row. The budget is ignored.
pub fn resume_to_counts(
    scene: &Scene,
    settings: RenderSettings,
    control: &Control,
    mut outcome: RenderOutcome,
    goals: &[u32],
) -> RenderOutcome {
    render_to_counts(scene, settings, control, &mut outcome, goals);
    control.conclude(&outcome);
    outcome
}

/// Continues until each pixel has as many samples as `goals` says, row by row. The budget is ignored.
pub fn render_to_counts(
    scene: &Scene,
    settings: RenderSettings,
    control: &Control,
    outcome: &mut RenderOutcome,
    goals: &[u32],
) {
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

/// Goal of a round: the number of samples of the pixel in a column and row.
type Goals<'a> = &'a (dyn Fn(usize, usize) -> u32 + Sync);

/// Renders a round. Neighbours are chosen as soon as all pixels have the samples of the pilot, from which on there are differences.
fn run_round(scene: &Scene, settings: RenderSettings, control: &Control, outcome: &mut RenderOutcome, goals: Goals) {
    let kernel = settings.kernel;
    let fresh = *outcome.film.kernel() == Kernel::Cross && outcome.film.samples() == 0;
    if fresh && settings.needs.edges.is_sampled() && !kernel.is_cross() {
        outcome.film = empty(&outcome.film, settings);
    }
    if kernel.is_pending(outcome.film.kernel()) && !run_pilot(scene, settings, control, outcome, goals) {
        return;
    }
    run_to(scene, settings, control, outcome, goals);
}

/// A film like another one without samples, at the beginning of its pilot.
fn empty(film: &Film, settings: RenderSettings) -> Film {
    let mut made = Film::new(film.width, film.height, film.needs).with_lights(&film.lights);
    match settings.kernel.known((film.width, film.height), settings.shift.is_one_sided()) {
        Some(neighbours) => {
            made.choose(neighbours);
            made
        }
        None => made.pending(),
    }
}

/// Renders the pilot as far as the goals go. Returns true when it is complete, and the neighbours are chosen.
fn run_pilot(
    scene: &Scene,
    settings: RenderSettings,
    control: &Control,
    outcome: &mut RenderOutcome,
    goals: Goals,
) -> bool {
    let (kernel, film) = (settings.kernel, &outcome.film);
    if kernel.encodes() && outcome.choices.encoder.is_none() {
        if film.samples() > 0 {
            // Films from files come without what their samples were encoded to: the few there can be are taken again.
            outcome.film = empty(film, settings);
        }
        run_to(scene, settings, control, outcome, &|x, y| goals(x, y).min(1));
        if outcome.stopped || outcome.spp < 1 {
            return false;
        }
        outcome.choices.encoder = kernel.encoder(&outcome.film.develop(), scene.sensor());
    }
    let encoder = outcome.choices.encoder.take();
    let both = Both { encoder: encoder.as_ref(), samples: control.samples };
    let control = Control { samples: Some(&both), ..*control };
    run_to(scene, settings, &control, outcome, &|x, y| goals(x, y).min(kernel.pilot()));
    let complete = !outcome.stopped && outcome.spp >= kernel.pilot();
    if complete {
        let pilot = Pilot { frame: &outcome.film.develop(), encoder: encoder.as_ref() };
        outcome.film.choose(kernel.select(&pilot, settings.shift.is_one_sided()));
    } else {
        outcome.choices.encoder = encoder;
    }
    complete
}

/// Samples of a pilot go to the encoder, and to whoever else wants them.
struct Both<'a> {
    encoder: Option<&'a Encoder>,
    samples: Option<&'a dyn SampleSink>,
}

impl SampleSink for Both<'_> {
    fn put(&self, wave: &WaveSamples) {
        if let Some(encoder) = self.encoder {
            encoder.put(wave.pixels, wave.samples.all);
        }
        if let Some(samples) = self.samples {
            samples.put(wave);
        }
    }
}

/// Renders up to some goals, with pauses for those who want the film.
fn run_to(scene: &Scene, settings: RenderSettings, control: &Control, outcome: &mut RenderOutcome, goals: Goals) {
    let (before, start) = (outcome.elapsed, Instant::now());
    let mut paused = true;
    while paused {
        paused = run_tiles(scene, settings, control, outcome, goals);
        outcome.elapsed = before + start.elapsed();
        outcome.spp = outcome.film.fewest_samples();
        outcome.stopped = control.stop.load(Ordering::Relaxed);
        if paused {
            control.sinks.iter().filter(|sink| sink.due()).for_each(|sink| sink.put(outcome));
        }
    }
}

/// Renders tiles up to their goals, until somebody wants the film, which returns true. `control.progress` is called with the
/// share of finished tiles.
fn run_tiles(
    scene: &Scene,
    settings: RenderSettings,
    control: &Control,
    outcome: &mut RenderOutcome,
    goals: Goals,
) -> bool {
    let first_rejected = Mutex::new(outcome.first_rejected);
    let due = AtomicBool::new(false);
    let kernel = outcome.film.kernel().clone();
    let neighbours = kernel.neighbours();
    let tiles = outcome.film.tiles_mut();
    let (total, done) = (tiles.len(), Mutex::new(0));
    let wave_of = || Wave::new(scene, settings.needs, settings.shift, neighbours);
    let pending = kernel == Kernel::Pending;
    tiles.par_iter_mut().enumerate().for_each_init(wave_of, |wave, (number, tile)| {
        if control.stop.load(Ordering::Relaxed) || due.load(Ordering::Relaxed) {
            return;
        }
        let before = tile.samples();
        if let Some(rejected) = run_tile(settings, wave, (tile, number), (&outcome.choices, pending), (goals, control))
        {
            let mut first = lock(&first_rejected);
            first.get_or_insert(rejected);
        }
        let worked = tile.samples() > before;
        let mut done = lock(&done);
        *done += 1;
        (control.progress)(*done as f32 / total as f32);
        // A tile that was at its goal already is no reason for another pause.
        if worked && control.sinks.iter().any(|sink| sink.due()) {
            due.store(true, Ordering::Relaxed);
        }
    });
    outcome.first_rejected = into_inner(first_rejected);
    due.into_inner()
}

/// Samples of a tile's pixels after which it ends early where that is asked for: as many as are soon done.
const SOON: u32 = 256;

/// Takes the samples that the pixels of a tile lack, without differences while neighbours are `pending`. Returns the first that was
/// rejected.
fn run_tile(
    settings: RenderSettings,
    wave: &mut Wave,
    (tile, number): (&mut Tile, usize),
    (choices, pending): (&Choices, bool),
    (goals, control): (Goals, &Control),
) -> Option<(SampleId, Rejected)> {
    let mut first_rejected = None;
    // Samples of one number are traced together, whatever number a pixel starts with.
    let spans: Vec<_> = (0..tile.width * tile.height)
        .map(|pixel| {
            let (x, y) = tile.pixel(pixel);
            tile.count(pixel)..goals(x, y)
        })
        .collect();
    let due = || spans.iter().filter(|span| !span.is_empty());
    let (start, end) = (due().map(|span| span.start).min()?, due().map(|span| span.end).max()?);
    let all = tile.pixels();
    let all_cells = choices.grids.get(number, || seen::grids(wave.scene(), &all));
    let (mut numbers, mut pixels, mut cells) = (Vec::new(), Vec::new(), Vec::new());
    for index in start..end {
        if index - start >= SOON && control.stop.load(Ordering::Relaxed) {
            break;
        }
        numbers.clear();
        numbers.extend((0..spans.len()).filter(|&pixel| spans[pixel].contains(&index)));
        if numbers.is_empty() {
            continue;
        }
        pixels.clear();
        pixels.extend(numbers.iter().map(|&pixel| all[pixel]));
        cells.clear();
        cells.extend(numbers.iter().filter_map(|&pixel| all_cells.get(pixel).copied()));
        let id = (settings.seed, settings.first + index);
        let mut pays = || choices.shares.has_differences(number, id.1, || wave.first_work(settings.seed, &all));
        let differences = !pending && (settings.needs.edges != EdgeNeed::Thinned || pays());
        let samples = wave.trace(id, &pixels, &cells, differences);
        if let Some(sink) = control.samples {
            let film = Sampler::new(id.0, id.1).film();
            sink.put(&WaveSamples { number: index, film, pixels: &pixels, samples: &samples });
        }
        for (k, (&pixel, &(x, y))) in numbers.iter().zip(&pixels).enumerate() {
            if let Err(reason) = tile.add(pixel, samples.taken(k)) {
                first_rejected
                    .get_or_insert((SampleId { seed: settings.seed, x, y, index: settings.first + index }, reason));
            }
        }
        if id.1 == 0 && pixels.len() == all.len() && !pending {
            choices.shares.learn(number, wave.work());
        }
    }
    first_rejected
}

/// A single sample with its differences to the cross.
#[derive(Clone, Debug)]
pub struct Replayed {
    /// The sample.
    pub sample: Sample,
    /// Differences of the scattered radiance to the right, left, down and up.
    pub color_differences: Vec<Rgb>,
    /// Differences of the ambient light, likewise.
    pub ambient_differences: Vec<Rgb>,
}

/// A single sample with everything that can be recorded of it, the same as in a render of the whole film.
pub fn sample(scene: &Scene, id: SampleId, shift: Shift) -> Replayed {
    let (x, y) = (id.x / TILE * TILE, id.y / TILE * TILE);
    let (width, height) = (TILE.min(scene.sensor().width - x), TILE.min(scene.sensor().height - y));
    let pixels: Vec<_> = (0..width * height).map(|pixel| (x + pixel % width, y + pixel / width)).collect();
    let grids = seen::grids(scene, &pixels);
    let mut wave = Wave::new(scene, Needs::ALL, shift, None);
    let (samples, at) = (wave.trace((id.seed, id.index), &pixels, &grids, true), (id.y - y) * width + id.x - x);
    let [color, ambient] = samples.differences(at).map_or([&[][..]; 2], |found| [found.color, found.ambient]);
    Replayed { sample: samples.all[at], color_differences: color.to_vec(), ambient_differences: ambient.to_vec() }
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
