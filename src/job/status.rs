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
    /// Number of those with all samples.
    pub complete: usize,
    /// Those with some samples.
    pub started: Vec<usize>,
    /// Those without any.
    pub missing: Vec<usize>,
    /// Those whose samples are not allocated yet.
    pub waiting: Vec<usize>,
    /// Those whose files are damaged, or of something else.
    pub wrong: Vec<usize>,
}

impl Status {
    /// Those that are not complete and can be run.
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

/// Ascending numbers as schedulers take them: 3,17,200-203.
pub fn ranges(numbers: &[usize]) -> String {
    let runs = numbers.chunk_by(|a, b| a + 1 == *b);
    let text = runs.map(|run| match run {
        [one] => one.to_string(),
        [first, .., last] => format!("{first}-{last}"),
        [] => String::new(),
    });
    text.collect::<Vec<_>>().join(",")
}

#[cfg(test)]
mod tests {
    use super::ranges;

    #[test]
    fn numbers_that_follow_each_other_are_ranges() {
        assert_eq!(ranges(&[3, 17, 200, 201, 202, 203]), "3,17,200-203");
        assert_eq!((ranges(&[]), ranges(&[0, 1])), (String::new(), "0-1".to_owned()));
    }
}
