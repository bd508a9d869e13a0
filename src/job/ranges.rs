//! Numbers of chunks as text.

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
