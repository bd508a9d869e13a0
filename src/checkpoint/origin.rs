//! Where a film comes from: what its samples were taken of, and which of all samples they are.

use std::fs::File;
use std::io::Read;
use std::ops::Range;

use serde::{Deserialize, Serialize};

use crate::error::{Error, Result};
use crate::film::Needs;
use crate::math::rng;
use crate::render::Outcome;
use crate::render::gradient::shift::Shift;
use crate::scene::Scene;

/// What must agree for samples to belong together.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Origin {
    /// Version of the program: samples of the same number are the same in one version only.
    pub version: String,
    /// Name of the scene file.
    pub scene: String,
    /// [`content`] of the scene, in hexadecimal.
    pub content: String,
    /// Columns and rows.
    pub size: (usize, usize),
    /// What is recorded.
    pub needs: Needs,
    /// Whether there is no scattered light, so that all differences are known to be zero.
    pub dark: bool,
    /// How differences are sampled.
    pub shift: Shift,
    /// Which samples: those of a film that was merged come from several runs.
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

    /// Whether some samples are in both.
    fn shares(&self, other: &Self) -> bool {
        let (a, b) = (self.numbers(), other.numbers());
        self.seed == other.seed && a.start < b.end && b.start < a.end
    }
}

/// Samples of a pixel that are more than anyone counts.
const MOST: u64 = 1 << 31;

impl Origin {
    /// Whether films of both can be added: the same scene seen in the same way, by other samples. Why not, else.
    pub fn adds_to(&self, other: &Self) -> Result<(), String> {
        self.same_view(other)?;
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

    /// Whether a film of this origin can be gone on with as `wanted`. Why not, else.
    pub fn resumes(&self, wanted: &Self) -> Result<(), String> {
        self.same_view(wanted)?;
        if !self.needs.cover(wanted.needs) {
            return Err("records less than this method and these layers need: begin anew, or choose others".into());
        }
        let ([mine], [theirs]) = (self.runs.as_slice(), wanted.runs.as_slice()) else {
            return Err("is merged of several renders: go on with one of them, and merge again".into());
        };
        if (mine.seed, mine.first) != (theirs.seed, theirs.first) {
            let first = if mine.first == 0 { String::new() } else { format!(" --first {}", mine.first) };
            return Err(format!("was begun with --seed {}{first}: give it the same", mine.seed));
        }
        Ok(())
    }

    fn same_view(&self, other: &Self) -> Result<(), String> {
        let differs = |what: &str, mine: &dyn std::fmt::Display, theirs: &dyn std::fmt::Display| {
            Err(format!("is of another {what}: {mine}, not {theirs}"))
        };
        if self.version != other.version {
            return differs("version of fluxion", &self.version, &other.version);
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
        if self.needs.edges && other.needs.edges && self.shift != other.shift {
            return Err("samples differences by another --shift".into());
        }
        Ok(())
    }

    /// The header attributes of images made of such a film.
    pub fn attributes(&self, outcome: &Outcome) -> Vec<(String, String)> {
        let spp = outcome.film.samples() as f64 / (self.size.0 * self.size.1) as f64;
        let seeds: Vec<_> = self.runs.iter().map(|run| run.seed.to_string()).collect();
        let pairs = [
            ("version", self.version.clone()),
            ("scene", self.scene.clone()),
            ("seed", seeds.join(" ")),
            ("spp", format!("{}", spp.round())),
            ("seconds", format!("{:.3}", outcome.elapsed.as_secs_f64())),
        ];
        pairs.map(|(name, value)| (format!("fluxion:{name}"), value)).to_vec()
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
