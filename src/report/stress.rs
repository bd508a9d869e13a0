//! The table of a stress run as a page that needs nothing else.

use std::fmt::Write;

use schemars::JsonSchema;
use serde::Serialize;

use crate::stress::{Check, Checks};

/// A case that was tried.
#[derive(Serialize, JsonSchema)]
pub struct Row {
    /// Kind and name.
    pub name: &'static str,
    /// Description of the case.
    pub summary: &'static str,
    /// Wall-clock time.
    pub seconds: f64,
    /// Figures of the case.
    #[serde(flatten)]
    pub checks: Checks,
}

impl Row {
    /// For every kind of figure the one that is nearest to its bound, or farthest beyond.
    pub fn worst(&self) -> Vec<&Check> {
        let mut worst: Vec<&Check> = Vec::new();
        // NaN is the worst of all.
        let used = |check: &Check| if check.value.is_nan() { f64::INFINITY } else { check.value - check.bound };
        for check in &self.checks.list {
            match worst.iter_mut().find(|other| other.measure == check.measure) {
                Some(other) if used(check) / check.bound.max(1e-300) > used(other) / other.bound.max(1e-300) => {
                    *other = check;
                }
                Some(_) => {}
                None => worst.push(check),
            }
        }
        worst
    }
}

const STYLE: &str = "body{font:15px/1.4 system-ui,sans-serif;margin:2rem auto;max-width:60rem;padding:0 1rem;\
    color:#222;background:#fff}table{border-collapse:collapse;width:100%}td,th{text-align:left;padding:.15rem .6rem;\
    border-top:1px solid #ddd}td:nth-child(n+3){text-align:right;font-variant-numeric:tabular-nums}\
    .failed{color:#b00;font-weight:600}summary{cursor:pointer;padding:.3rem 0}\
    @media(prefers-color-scheme:dark){body{color:#ddd;background:#181818}td,th{border-color:#444}.failed{color:#f77}}";

/// The page: cases that failed are open, the others unfold.
pub fn page(rows: &[Row]) -> String {
    let passed = rows.iter().filter(|row| row.checks.passed()).count();
    let mut html = format!(
        "<!doctype html><html lang=\"en\"><meta charset=\"utf-8\"><title>Fluxion: stress</title><style>{STYLE}</style>\
         <h1>{passed} of {} cases passed</h1>",
        rows.len()
    );
    for row in rows {
        let (open, mark) =
            if row.checks.passed() { ("", "passed") } else { (" open", "<b class=\"failed\">failed</b>") };
        // Writing to a string does not fail.
        let _ = write!(
            html,
            "<details{open}><summary><code>{}</code> {mark}, {:.1} s: {}</summary><table><tr><th>who<th>what<th>figure\
             <th>bound",
            row.name,
            row.seconds,
            escape(row.summary)
        );
        for Check { subject, measure, value, bound } in &row.checks.list {
            let class = if value <= bound { "" } else { " class=\"failed\"" };
            let _ =
                write!(html, "<tr{class}><td>{}<td>{}<td>{value:.2e}<td>{bound:.0e}", escape(subject), escape(measure));
        }
        let failed = row.checks.failed.as_deref().map(escape).unwrap_or_default();
        let _ = write!(html, "</table><p class=\"failed\">{failed}</p></details>");
    }
    html + "</html>\n"
}

fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check(value: f64, measure: &'static str) -> Check {
        Check { subject: "l2 <1>".into(), measure, value, bound: 1.0 }
    }

    #[test]
    fn failures_are_open_and_the_worst_figure_of_a_kind_is_shown() {
        let list = vec![check(0.1, "a"), check(0.9, "a"), check(f64::NAN, "b"), check(0.0, "b")];
        let rows = [Row { name: "x/y", summary: "s", seconds: 0.0, checks: Checks { list, failed: None } }];
        let worst: Vec<_> = rows[0].worst().iter().map(|check| check.value).collect();
        assert!(worst[0] == 0.9 && worst[1].is_nan() && worst.len() == 2);
        let html = page(&rows);
        assert!(html.contains("<details open>") && html.contains("l2 &lt;1&gt;") && html.contains("0 of 1"), "{html}");
    }
}
