//! The table of stress cases; the cases themselves are run by `fluxion stress`.

use std::collections::HashSet;

use fluxion::internals::stress::{Check, cases};

#[test]
fn cases_have_names_of_their_own_that_tell_their_kind() {
    let mut names = HashSet::new();
    for case in cases() {
        let kind = case.name.split('/').next().unwrap();
        assert!(["frames", "film", "solvers", "furnace", "scenes"].contains(&kind), "{}", case.name);
        assert!(names.insert(case.name) && !case.summary.is_empty(), "{}", case.name);
    }
}

#[test]
fn what_is_no_number_or_beyond_its_bound_fails() {
    let passed = |value| Check { subject: String::new(), measure: "", value, bound: 1.0 }.passed();
    assert!(passed(1.0) && passed(-1.0) && !passed(1.1) && !passed(f64::NAN) && !passed(f64::INFINITY));
}

#[test]
fn quick_cases_pass() {
    for name in ["frames/black", "frames/missing", "film/samples", "film/merge", "solvers/combination"] {
        let checks = cases().find(|case| case.name == name).unwrap().check();
        assert!(checks.passed() && checks.list.len() > 5, "{name}: {checks:?}");
    }
}
