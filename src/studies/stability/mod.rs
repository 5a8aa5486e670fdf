//! Hard cases: that they stay numerically stable is run and printed, not claimed.
//!
//! A [`Case`] varies one thing that is known to break solvers, loops or grids, and returns an [`CaseResult`] for each
//! figure that it measured: the worst one found, the bound that it must keep, and so whether it passed. One file a room
//! holds its cases; tests run them at [`Effort::Sample`], the whole table takes [`Effort::Full`].

pub mod contact;
pub mod coupling;
mod figure;
mod graphics;
mod gridization;

pub use figure::{FILES, write_all};

use crate::gpu::Context;
use serde::Serialize;
use std::{error::Error, fmt, fmt::Write, sync::Arc};

/// How much of a case is run. The bounds are the same.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Effort {
    /// Seconds for all cases together, for tests.
    Sample,
    /// Everything that the case names.
    Full,
}

/// With what a case is run.
#[derive(Clone)]
pub struct Setting {
    /// How much of it.
    pub effort: Effort,
    /// The adapter for the half of a case that concerns the GPU, which is left out without one.
    pub gpu: Option<Arc<Context>>,
}

/// Why a case could not be run at all.
pub type Failure = Box<dyn Error + Send + Sync>;

/// One hard case.
#[derive(Clone, Copy)]
pub struct Case {
    /// Where it belongs: `contact`, `gridization`, `loop`, `graphics`.
    pub room: &'static str,
    /// The difficulty, in a few words.
    pub name: &'static str,
    /// Runs it. An error means that it could not be run, not that it failed its bound.
    pub run: fn(&Setting) -> Result<Vec<CaseResult>, Failure>,
}

/// The limit of a figure.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Bound {
    /// The figure may not be greater.
    AtMost(f64),
    /// The figure may not be less.
    AtLeast(f64),
}

impl fmt::Display for Bound {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::AtMost(bound) => write!(formatter, "<= {}", figure(*bound)),
            Self::AtLeast(bound) => write!(formatter, ">= {}", figure(*bound)),
        }
    }
}

/// One figure of a case.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct CaseResult {
    /// Name of the case.
    pub case: String,
    /// The quantity that was varied, and its range.
    pub varied: String,
    /// The measure, with its unit in brackets.
    pub measure: String,
    /// The worst figure found, in that unit.
    pub worst: f64,
    /// Its limit.
    pub bound: Bound,
    /// Counts, iterations, times: what stands beside the figure without being judged; may be empty.
    pub note: String,
}

impl CaseResult {
    /// Whether the worst figure keeps its bound; what is not a number does not.
    #[must_use]
    pub fn passed(&self) -> bool {
        match self.bound {
            Bound::AtMost(bound) => self.worst <= bound,
            Bound::AtLeast(bound) => self.worst >= bound,
        }
    }
}

/// All cases, room by room.
#[must_use]
pub fn cases() -> Vec<Case> {
    [contact::cases(), coupling::CASES.to_vec(), gridization::cases(), graphics::CASES.to_vec()].concat()
}

/// The outcomes as one table of aligned columns, a line each.
#[must_use]
pub fn table(outcomes: &[CaseResult]) -> String {
    let heads = ["case", "varied", "measure", "worst", "bound", "", "beside"].map(str::to_owned);
    let rows: Vec<[String; 7]> = std::iter::once(heads)
        .chain(outcomes.iter().map(|outcome| {
            let verdict = if outcome.passed() { "pass" } else { "FAIL" };
            [
                outcome.case.clone(),
                outcome.varied.clone(),
                outcome.measure.clone(),
                figure(outcome.worst),
                outcome.bound.to_string(),
                verdict.to_owned(),
                outcome.note.clone(),
            ]
        }))
        .collect();
    let width = |column: usize| rows.iter().map(|row| row[column].chars().count()).max().unwrap_or(0);
    let widths: Vec<usize> = (0..7).map(width).collect();
    let mut text = String::new();
    for row in &rows {
        let mut line = String::new();
        for (cell, width) in row.iter().zip(&widths) {
            // Writing to a string cannot fail.
            let _ = write!(line, "{cell:<width$}  ");
        }
        text.push_str(line.trim_end());
        text.push('\n');
    }
    text
}

/// Three significant digits, without an exponent where that is short.
fn figure(value: f64) -> String {
    // Neither zero has a sign.
    let value = value + 0.0;
    if value == 0.0 || (1e-3..1e5).contains(&value.abs()) {
        let decimals = if value == 0.0 { 0 } else { (2 - value.abs().log10().floor() as i32).clamp(0, 5) as usize };
        let text = format!("{value:.decimals$}");
        match text.contains('.') {
            true => text.trim_end_matches('0').trim_end_matches('.').to_owned(),
            false => text,
        }
    } else {
        format!("{value:.2e}")
    }
}

/// Runs a sample of each of `cases` on the CPU.
#[cfg(test)]
fn assert_samples_keep_their_bounds(cases: impl IntoIterator<Item = Case>) {
    let setting = Setting { effort: Effort::Sample, gpu: None };
    for case in cases {
        let outcomes = (case.run)(&setting).unwrap();
        assert!(!outcomes.is_empty(), "{}", case.name);
        let failed: Vec<CaseResult> = outcomes.into_iter().filter(|outcome| !outcome.passed()).collect();
        assert!(failed.is_empty(), "{}", table(&failed));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn outcome(worst: f64, bound: Bound) -> CaseResult {
        let text = |text: &str| text.to_owned();
        CaseResult { case: text("case"), varied: text("it"), measure: text("size [m]"), worst, bound, note: text("") }
    }

    #[test]
    fn a_figure_passes_on_its_side_of_the_bound_only_and_what_is_no_number_never() {
        assert!(outcome(1.0, Bound::AtMost(1.0)).passed() && !outcome(1.1, Bound::AtMost(1.0)).passed());
        assert!(outcome(1.0, Bound::AtLeast(1.0)).passed() && !outcome(0.9, Bound::AtLeast(1.0)).passed());
        for bound in [Bound::AtMost(1.0), Bound::AtLeast(1.0)] {
            assert!(!outcome(f64::NAN, bound).passed());
        }
    }

    #[test]
    fn the_table_has_a_line_each_in_aligned_columns() {
        let table = table(&[outcome(0.9991, Bound::AtLeast(0.999)), outcome(3e-7, Bound::AtMost(1e-8))]);
        let lines: Vec<&str> = table.lines().collect();
        assert_eq!(lines.len(), 3);
        assert!(lines[1].contains("0.999") && lines[1].contains("pass") && lines[2].contains("FAIL"), "{table}");
        assert!(lines[2].contains("3.00e-7") && lines[2].contains("<= 1.00e-8"));
        let column = lines[0].find("bound").unwrap();
        assert!(lines[1][column..].starts_with(">=") && lines[2][column..].starts_with("<="), "{table}");
        assert_eq!([0.0, -0.0, 1.0, 12.345, 99_999.0, 0.5].map(figure), ["0", "0", "1", "12.3", "99999", "0.5"]);
    }
}
