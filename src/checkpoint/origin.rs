//! Origin of a film: the scene and settings that its samples belong to, and their numbers.

use std::fs::File;
use std::io::Read;
use std::ops::Range;

use serde::{Deserialize, Serialize};

use crate::error::{Error, Result};
use crate::film::{Needs, Provenance};
use crate::math::rng;
use crate::neighbours::Selector;
use crate::render::RenderOutcome;
use crate::render::Shift;
use crate::scene::Scene;

/// Everything that must agree for samples to belong together.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Origin {
    /// Version of the program.
    pub version: String,
    /// Number of the samples, [`EPOCH`](crate::render::EPOCH); 0 of films that were written before there were any.
    #[serde(default)]
    pub epoch: u32,
    /// Name of the scene file.
    pub scene: String,
    /// [`content`] of the scene, in hexadecimal: its text, meshes and images.
    pub content: String,
    /// Fingerprint of the scene's text, in hexadecimal.
    pub fingerprint: String,
    /// Reconstruction that the render was made for.
    pub method: String,
    /// Summary of the plan.
    pub plan: String,
    /// Columns and rows.
    pub size: (usize, usize),
    /// Statistics that are recorded.
    pub needs: Needs,
    /// How differences are sampled.
    pub shift: Shift,
    /// Neighbours that paths are shifted to.
    #[serde(default)]
    pub kernel: Selector,
    /// Groups of emitters whose light is recorded by itself.
    #[serde(default)]
    pub lights: Vec<String>,
    /// Numbers of the samples; a merged film has those of several runs.
    pub runs: Vec<Run>,
}

/// Samples with consecutive numbers.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct Run {
    /// Their seed.
    pub seed: u64,
    /// Number of the first.
    pub first: u32,
    /// Most samples of a pixel.
    pub samples: u32,
}

impl Run {
    fn numbers(&self) -> Range<u64> {
        u64::from(self.first)..u64::from(self.first) + u64::from(self.samples)
    }

    /// Whether some samples belong to both.
    fn shares(&self, other: &Self) -> bool {
        let (a, b) = (self.numbers(), other.numbers());
        self.seed == other.seed && a.start < b.end && b.start < a.end
    }
}

/// Limit of a pixel's number of samples.
const MOST: u64 = 1 << 31;

impl Origin {
    /// Checks that films of both can be added: of the same scene, size and settings, with other samples. The error is the
    /// reason why not.
    pub fn adds_to(&self, other: &Self) -> Result<(), String> {
        self.same_view(other)?;
        if self.lights != other.lights {
            return Err(format!("has other light groups: {}", self.lights_text()));
        }
        if self.needs != other.needs {
            return Err("records other statistics: both must be rendered for methods with the same needs".into());
        }
        for (mine, theirs) in self.runs.iter().flat_map(|mine| other.runs.iter().map(move |theirs| (mine, theirs))) {
            if mine.shares(theirs) {
                return Err(format!(
                    "has the same samples of seed {}: render with another --seed, or further ones with --first {}",
                    theirs.seed,
                    mine.numbers().end.max(theirs.numbers().end)
                ));
            }
        }
        let all = self.runs.iter().chain(&other.runs);
        if all.map(|run| u64::from(run.samples)).sum::<u64>() >= MOST {
            return Err("would make more samples of a pixel than can be counted".into());
        }
        Ok(())
    }

    /// Checks that a film of this origin can be continued as `wanted`. The error is the reason why not.
    pub fn resumes(&self, wanted: &Self) -> Result<(), String> {
        self.same_view(wanted)?;
        if self.lights != wanted.lights {
            return Err(format!("was started with other light groups: {}", self.lights_text()));
        }
        if !self.needs.cover(wanted.needs) {
            return Err("records less than this method and these layers need: start anew, or choose others".into());
        }
        let ([mine], [theirs]) = (self.runs.as_slice(), wanted.runs.as_slice()) else {
            return Err("is merged of several renders: resume one of them, and merge again".into());
        };
        if (mine.seed, mine.first) != (theirs.seed, theirs.first) {
            let first = if mine.first == 0 { String::new() } else { format!(" --first {}", mine.first) };
            return Err(format!("was started with --seed {}{first}: give it the same", mine.seed));
        }
        Ok(())
    }

    fn lights_text(&self) -> String {
        if self.lights.is_empty() { "none".into() } else { self.lights.join(", ") }
    }

    fn same_view(&self, other: &Self) -> Result<(), String> {
        let differs = |what: &str, mine: &dyn std::fmt::Display, theirs: &dyn std::fmt::Display| {
            Err(format!("is of another {what}: {mine}, not {theirs}"))
        };
        if self.epoch != other.epoch {
            let (mine, theirs) = (
                format!("{} of fluxion {}", self.epoch, self.version),
                format!("{} of {}", other.epoch, other.version),
            );
            return differs("epoch of samples", &mine, &theirs);
        }
        if self.content != other.content {
            let (mine, theirs) = (&self.content, &other.content);
            return Err(format!(
                "is of another scene, or the scene or one of its files has changed since: `{}` with content {mine}, not \
                 `{}` with {theirs}",
                self.scene, other.scene
            ));
        }
        if self.size != other.size {
            let size = |(width, height): (usize, usize)| format!("{width}x{height}");
            return differs("size", &size(self.size), &size(other.size));
        }
        if self.needs.edges.is_sampled() && other.needs.edges.is_sampled() && self.shift != other.shift {
            return Err("samples differences by another --shift".into());
        }
        if self.needs.edges.is_sampled() && other.needs.edges.is_sampled() && self.kernel != other.kernel {
            return Err(format!("samples differences to other neighbours: --kernel {}", self.kernel));
        }
        Ok(())
    }

    /// Provenance of images made from such a film.
    pub fn provenance(&self, outcome: &RenderOutcome) -> Provenance {
        let seeds: Vec<_> = self.runs.iter().map(|run| run.seed.to_string()).collect();
        Provenance {
            version: self.version.clone(),
            epoch: self.epoch.to_string(),
            scene: self.scene.clone(),
            fingerprint: self.fingerprint.clone(),
            seed: seeds.join(" "),
            spp: format!("{}", outcome.film.mean_spp().round()),
            seconds: format!("{:.3}", outcome.elapsed.as_secs_f64()),
            method: self.method.clone(),
            plan: self.plan.clone(),
            kernel: self.kernel.name(),
        }
    }
}

/// Hash of everything a scene was read from: its text, meshes and images.
pub fn content(scene: &Scene) -> Result<String> {
    let mut hash = scene.fingerprint();
    let mut buffer = vec![0; 1 << 16];
    for path in scene.files() {
        let mut file = File::open(path).map_err(|error| Error::io(path, error))?;
        let mut sum = crc32fast::Hasher::new();
        loop {
            match file.read(&mut buffer).map_err(|error| Error::io(path, error))? {
                0 => break,
                count => sum.update(&buffer[..count]),
            }
        }
        hash = rng::combine(hash, u64::from(sum.finalize()));
    }
    Ok(format!("{hash:016x}"))
}
