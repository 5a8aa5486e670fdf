//! The hard cases of the tick, in their short form.

use haptize::studies::stability::{Effort, Setting, coupling::CASES, table};

#[test]
fn hard_cases_are_finite_bounded_and_passive_or_let_go() {
    let setting = Setting { effort: Effort::Sample, gpu: None };
    let mut outcomes = Vec::new();
    for case in CASES {
        outcomes.extend((case.run)(&setting).unwrap());
    }
    let table = table(&outcomes);
    println!("{table}");
    assert!(outcomes.iter().all(|outcome| outcome.passed()), "{table}");
}
