//! State of a whole job.

use schemars::JsonSchema;
use serde::Serialize;

use super::chunk::State;
use super::description::Job;
use crate::error::Result;

/// Numbers of chunks by their states.
#[derive(Clone, Debug, Default, Serialize, JsonSchema)]
pub struct Status {
    /// Number of all chunks.
    pub chunks: usize,
    /// Number of chunks with all samples.
    pub complete: usize,
    /// Chunks with some samples.
    pub started: Vec<usize>,
    /// Chunks without any.
    pub missing: Vec<usize>,
    /// Chunks whose samples are not allocated yet.
    pub waiting: Vec<usize>,
    /// Chunks whose files are damaged, or of something else.
    pub wrong: Vec<usize>,
}

impl Status {
    /// Chunks that are not complete and can be run.
    pub fn due(&self) -> Vec<usize> {
        let mut due = [&self.started[..], &self.missing, &self.wrong].concat();
        due.sort_unstable();
        due
    }
}

impl Job {
    /// The state of all chunks, by the headers of their files, or by all of their bytes.
    pub fn status(&self, verify: bool) -> Result<Status> {
        let mut status = Status { chunks: self.chunks(), ..Status::default() };
        for number in 0..self.chunks() {
            match self.state(number, verify)? {
                State::Complete => status.complete += 1,
                State::Started => status.started.push(number),
                State::Missing => status.missing.push(number),
                State::Waiting => status.waiting.push(number),
                State::Wrong => status.wrong.push(number),
            }
        }
        Ok(status)
    }
}
