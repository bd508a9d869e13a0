//! Keyword arguments as a recipe: the options of `fluxion render` by their names.

use std::path::PathBuf;
use std::time::Duration;

use fluxion::adaptive::Limits;
use fluxion::film::{Asker, RECORDED, Recorded};
use fluxion::pipeline::{Checkpoints, Differences, Recipe};
use fluxion::render::Shift;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;

/// The recipe of some keywords, with how it is carried out.
pub struct Keywords {
    pub recipe: Recipe,
    /// The film's size, if another one is wanted.
    pub size: Option<(usize, usize)>,
    pub threads: usize,
    /// Checkpoints, if they are asked for.
    pub checkpoints: Option<Checkpoints>,
    /// Time between checkpoints.
    pub checkpoint_every: Duration,
}

fn wrong<T>(what: &str) -> PyResult<T> {
    Err(PyValueError::new_err(what.to_owned()))
}

/// A positive number of seconds.
fn duration(value: &Bound<'_, PyAny>, name: &str) -> PyResult<Duration> {
    match Duration::try_from_secs_f64(value.extract()?) {
        Ok(time) if !time.is_zero() => Ok(time),
        _ => wrong(&format!("{name} is a positive number of seconds")),
    }
}

/// Keywords that are none of a recipe's.
pub type Others<'py> = Vec<(String, Bound<'py, PyAny>)>;

impl Keywords {
    /// Reads the keywords that belong to a recipe; the others are left, by their names, in the order that they were given.
    pub fn read<'py>(keywords: Option<&Bound<'py, PyDict>>) -> PyResult<(Self, Others<'py>)> {
        let mut read = Self {
            recipe: Recipe::default(),
            size: None,
            threads: 0,
            checkpoints: None,
            checkpoint_every: Checkpoints::EVERY,
        };
        let (mut checkpoint, mut resume) = (None::<PathBuf>, false);
        let mut left = Vec::new();
        for (name, value) in keywords.into_iter().flatten() {
            let name: String = name.extract()?;
            match name.as_str() {
                "checkpoint" => checkpoint = value.extract()?,
                "checkpoint_every" => read.checkpoint_every = duration(&value, &name)?,
                "resume" => resume = value.extract()?,
                "size" => read.size = value.extract()?,
                "threads" => read.threads = value.extract()?,
                _ if read.set(&name, &value)? => {}
                _ => left.push((name, value)),
            }
        }
        if let (None, true) = (&checkpoint, resume) {
            return wrong("resume takes a checkpoint");
        }
        let every = read.checkpoint_every;
        read.checkpoints = checkpoint.map(|file| Checkpoints { file, every, resume });
        let Limits { spp, time, .. } = read.recipe.limits;
        if spp.is_some() && time.is_some() {
            return wrong("give either spp or time");
        }
        Ok((read, left))
    }

    /// Sets what a keyword says, if it is one of a recipe.
    fn set(&mut self, name: &str, value: &Bound<'_, PyAny>) -> PyResult<bool> {
        let recipe = &mut self.recipe;
        match name {
            // Options that are not given.
            "spp" | "time" | "target_error" if value.is_none() => {}
            "spp" => recipe.limits.spp = Some(value.extract()?),
            "time" => recipe.limits.time = Some(duration(value, name)?),
            "target_error" => recipe.limits.error = Some(value.extract()?),
            "seed" => recipe.seed = value.extract()?,
            "first" => recipe.first = value.extract()?,
            "goals" => recipe.goals = value.extract()?,
            "method" => recipe.method.name = value.extract()?,
            "memory" => {
                let megabytes: Option<u64> = value.extract()?;
                recipe.method.memory = megabytes.map(|megabytes| megabytes.saturating_mul(1 << 20));
            }
            "notes" => recipe.method.notes = value.extract()?,
            "adaptive" => recipe.allocator = value.extract()?,
            "kernel" => recipe.kernel = value.extract()?,
            "pilot" => recipe.pilot = value.extract()?,
            "shift" => {
                let id: String = value.extract()?;
                let Some(shift) = Shift::named(&id) else { return wrong(&format!("{id} is no shift mapping")) };
                recipe.shift = shift;
            }
            "every_difference" => {
                recipe.differences = if value.extract()? { Differences::Always } else { Differences::Auto };
            }
            "cryptomatte" => recipe.outputs.cryptomatte = value.extract()?,
            "samples" => recipe.outputs.samples = value.extract()?,
            "layers" => recipe.statistics = recipe.statistics.with_if(Recorded::Features, value.extract()?),
            _ => {
                let Some(row) = RECORDED.iter().find(|row| row.name == name && row.asker == Asker::Option) else {
                    return Ok(false);
                };
                recipe.statistics = recipe.statistics.with_if(row.id, value.extract()?);
            }
        }
        let Limits { spp, error, .. } = recipe.limits;
        if spp == Some(0) {
            return wrong("spp is a number of samples from 1 on");
        }
        if error.is_some_and(|error| !(error > 0.0 && error.is_finite())) {
            return wrong("target_error is a positive relMSE");
        }
        Ok(true)
    }
}

/// Names and descriptions of the statistics that keywords of `render` ask for.
#[pyfunction]
pub fn statistics() -> Vec<(&'static str, &'static str)> {
    RECORDED.iter().filter(|row| row.asker == Asker::Option).map(|row| (row.name, row.help)).collect()
}
