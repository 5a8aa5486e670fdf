//! Hard cases: that they stay numerically stable is run and printed, not claimed.
//!
//! A [`Case`] varies one thing that is known to break solvers, loops or grids, and returns a [`CaseResult`] for each
//! figure that it measured: the worst one found, the bound that it must keep, and so whether it passed. One file or
//! folder a room holds its cases. The tests run a sample of each and print what docs/stability.md condenses:
//! `cargo test --release --test contact hard_cases -- --nocapture`; with `--ignored` they run all that the cases name.

mod contact;
mod coupling;
mod graphics;
mod gridization;

use haptize::gpu::{AdapterChoice, Context};
use std::{
    error::Error,
    fmt,
    sync::{Arc, OnceLock},
};

/// How much of a case is run. The bounds are the same.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Effort {
    /// Seconds for all cases together, for tests.
    Sample,
    /// Everything that the case names.
    Full,
}

/// With what a case is run.
pub struct Setting {
    /// How much of it.
    pub effort: Effort,
    /// The adapter for the half of a case that concerns the GPU.
    pub gpu: Arc<Context>,
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
#[derive(Clone, Copy)]
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
#[derive(Clone)]
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
    pub fn passed(&self) -> bool {
        match self.bound {
            Bound::AtMost(bound) => self.worst <= bound,
            Bound::AtLeast(bound) => self.worst >= bound,
        }
    }
}

/// The outcomes of a room as a table in Markdown, a line each.
fn table(room: &str, outcomes: &[CaseResult]) -> String {
    let heads = "| case | varied | measure | worst | bound | | beside |\n|---|---|---|---:|---:|---|---|\n";
    let row = |outcome: &CaseResult| {
        let CaseResult { case, varied, measure, worst, bound, note } = outcome;
        let verdict = if outcome.passed() { "pass" } else { "FAIL" };
        format!("| {case} | {varied} | {measure} | {} | {bound} | {verdict} | {note} |\n", figure(*worst))
    };
    let rows: String = outcomes.iter().map(row).collect();
    format!("### {room}\n\n{heads}{rows}")
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

/// Runs `cases`, prints what came out, and fails where a figure breaks its bound.
fn keep_their_bounds(cases: &[Case], effort: Effort) {
    // One device for all tests of this process: opening one costs a second, and drivers dislike many.
    static CONTEXT: OnceLock<Arc<Context>> = OnceLock::new();
    let open = || Context::open(AdapterChoice::Any).unwrap_or_else(|error| panic!("the GPU's half needs one: {error}"));
    let setting = Setting { effort, gpu: Arc::clone(CONTEXT.get_or_init(|| Arc::new(open()))) };
    let run = |case: &Case| {
        let outcomes = (case.run)(&setting).unwrap_or_else(|error| panic!("{} cannot be run: {error}", case.name));
        assert!(!outcomes.is_empty(), "{}", case.name);
        outcomes
    };
    let outcomes: Vec<CaseResult> = cases.iter().flat_map(run).collect();
    let table = table(cases[0].room, &outcomes);
    println!("{table}");
    assert!(outcomes.iter().all(CaseResult::passed), "{table}");
}

#[test]
fn contact_keeps_its_bounds() {
    keep_their_bounds(&contact::cases(), Effort::Sample);
}

#[test]
fn gridization_keeps_its_bounds() {
    keep_their_bounds(&gridization::cases(), Effort::Sample);
}

#[test]
fn the_loop_is_finite_bounded_and_passive_or_lets_go() {
    keep_their_bounds(&coupling::CASES, Effort::Sample);
}

#[test]
fn the_object_in_motion_gains_no_energy_from_nowhere() {
    keep_their_bounds(&graphics::CASES, Effort::Sample);
}

#[test]
#[ignore = "hours"]
fn all_that_the_cases_name_keeps_its_bounds() {
    for cases in [contact::cases(), gridization::cases(), coupling::CASES.to_vec(), graphics::CASES.to_vec()] {
        keep_their_bounds(&cases, Effort::Full);
    }
}

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
fn the_table_has_a_line_each() {
    let table = table("room", &[outcome(0.9991, Bound::AtLeast(0.999)), outcome(3e-7, Bound::AtMost(1e-8))]);
    let lines: Vec<&str> = table.lines().skip(4).collect();
    assert_eq!(lines[0], "| case | it | size [m] | 0.999 | >= 0.999 | pass |  |");
    assert_eq!(lines[1], "| case | it | size [m] | 3.00e-7 | <= 1.00e-8 | FAIL |  |");
    assert_eq!([0.0, -0.0, 1.0, 12.345, 99_999.0, 0.5].map(figure), ["0", "0", "1", "12.3", "99999", "0.5"]);
}
