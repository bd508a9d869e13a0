//! All runs on a scene, in an order that treats methods alike.

use std::sync::atomic::{AtomicBool, Ordering};

use super::case::Case;
use super::cell::{Budget, Pilot, RunResult, Runner};
use super::record::LeftOut;
use super::store::Store;
use crate::error::Result;

/// A set of runs: methods, budgets and seeds.
pub struct Runs<'a> {
    /// Methods with their parameters.
    pub methods: &'a [String],
    /// Budgets of the runs.
    pub budgets: &'a [Budget],
    /// How often everything is run.
    pub seeds: u64,
}

impl Runs<'_> {
    /// Runs what the store does not have yet, until `stop` is set. `report` is called with the next run. A run that fails is
    /// noted among those left out, and the others go on.
    pub fn on(&self, case: &Case, store: &mut Store, stop: &AtomicBool, report: &mut dyn FnMut(&str)) -> Result<()> {
        let candidate = |method| Ok(Candidate { runner: Runner::new(case, method)?, times: None });
        let mut candidates = self.methods.iter().map(|method| candidate(method)).collect::<Result<Vec<_>>>()?;
        for seed in 1..=self.seeds {
            for (k, &budget) in self.budgets.iter().enumerate() {
                // Methods take turns, and begin with another one every time: if the machine slows down, it does for all.
                for turn in 0..self.methods.len() {
                    let which = (turn + k + seed as usize) % self.methods.len();
                    let method = &self.methods[which];
                    report(&format!("{method}, {budget}, seed {seed}"));
                    if store.has(case, method, budget, seed)? {
                        continue;
                    }
                    match candidates[which].run(budget, seed, stop) {
                        Ok(Outcome::Finished(ran)) => store.add(*ran)?,
                        Ok(Outcome::TooLong(reason)) => store.leave_out(left_out(case, method, budget, reason)),
                        Ok(Outcome::Stopped) => return Ok(()),
                        Err(error) => store.leave_out(left_out(case, method, budget, format!("failed: {error}"))),
                    }
                    if stop.load(Ordering::Relaxed) {
                        return Ok(());
                    }
                }
            }
        }
        Ok(())
    }
}

fn left_out(case: &Case, method: &str, budget: Budget, reason: String) -> LeftOut {
    LeftOut { scene: case.name.clone(), method: method.to_owned(), budget: budget.to_string(), reason }
}

/// A method with its times so far.
struct Candidate<'a> {
    runner: Runner<'a>,
    /// From trying, which decides what is worth starting; and from the last run, which says how long to render.
    times: Option<(Pilot, Pilot)>,
}

enum Outcome {
    Finished(Box<RunResult>),
    TooLong(String),
    Stopped,
}

impl Candidate<'_> {
    fn run(&mut self, budget: Budget, seed: u64, stop: &AtomicBool) -> Result<Outcome> {
        let (tried, last) = match self.times {
            Some(times) => times,
            None => {
                let tried = self.runner.pilot()?;
                *self.times.insert((tried, tried))
            }
        };
        if let Budget::Seconds(seconds) = budget
            && seconds < tried.finish + tried.sample
        {
            let Pilot { sample, finish } = tried;
            return Ok(Outcome::TooLong(format!("one sample takes {sample:.2} s, the reconstruction {finish:.1} s")));
        }
        let Some(ran) = self.runner.run(budget, seed, last, stop)? else { return Ok(Outcome::Stopped) };
        let seconds = ran.record.seconds;
        // Adaptive runs reconstruct several times, and look at the clock themselves.
        if !self.runner.is_adaptive() {
            self.times = Some((tried, Pilot { finish: seconds.develop + seconds.reconstruct, ..last }));
        }
        Ok(Outcome::Finished(Box::new(ran)))
    }
}
