//! The paper's numbers beside ours: a table for people (Markdown) and for programs (JSON).

use super::{Scanned, Scans, Sphere};
use crate::{
    draw::ticks::thousands,
    report::force::{EndForce, SteadyForce},
    scene::{HapticsSpec, PlanSpec, ScanSpec},
};
use serde::Serialize;
use std::fmt::{self, Display, Write};

/// First line of the page.
pub const HEADING: &str = "# The paper's figures and numbers, remade by haptize\n";

/// Significant digits of a number in the table.
const DIGITS: i32 = 3;

/// A number or a statement.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(untagged)]
pub enum Value {
    /// Something counted.
    Count(usize),
    /// Something measured or set.
    Number(f64),
    /// A statement of the paper without a number.
    Words(String),
}

impl Display for Value {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Count(count) => f.write_str(&thousands(*count)),
            Self::Number(number) if *number == 0.0 || !number.is_finite() => write!(f, "{number}"),
            Self::Number(number) => {
                let decimals = (DIGITS - 1 - number.abs().log10().floor() as i32).max(0) as usize;
                let text = format!("{number:.decimals$}");
                f.write_str(if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.') } else { &text })
            }
            Self::Words(words) => f.write_str(words),
        }
    }
}

impl From<&str> for Value {
    fn from(words: &str) -> Self {
        Self::Words(words.to_owned())
    }
}

/// One quantity in the paper and here.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Row {
    /// Section of the paper.
    pub section: &'static str,
    /// The quantity, with its unit.
    pub quantity: &'static str,
    /// The paper's value.
    pub paper: Value,
    /// The value found here.
    pub ours: Value,
    /// Whether both are the same in the digits shown.
    pub same: bool,
    /// Why they differ, or what the number depends on; may be empty where they are the same.
    pub why: String,
}

impl Row {
    fn new(section: &'static str, quantity: &'static str, paper: Value, ours: Value, why: impl Into<String>) -> Self {
        let same = paper.to_string() == ours.to_string();
        Self { section, quantity, paper, ours, same, why: why.into() }
    }

    /// Whether the paper gives a number and ours is another.
    #[must_use]
    pub fn differs(&self) -> bool {
        !self.same && !matches!(self.paper, Value::Words(_))
    }
}

/// How a figure of the paper was remade.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct FigureNote {
    /// Number in the paper.
    pub number: u32,
    /// Name of its files, without extension; empty where there is none.
    pub file: &'static str,
    /// Content of the paper's figure.
    pub paper: &'static str,
    /// Content of this figure, and why it differs.
    pub ours: &'static str,
}

/// All figures of the paper.
pub const FIGURES: [FigureNote; 9] = [
    FigureNote {
        number: 1,
        file: "",
        paper: "A sketch of an arm that touches an object at several points",
        ours: "Not remade: an illustration. Fig. 6 shows such a contact",
    },
    FigureNote {
        number: 2,
        file: "fig2-procedure",
        paper: "The procedure from object to haptic and graphics rendering",
        ours: "The same procedure, drawn with the numbers of this run",
    },
    FigureNote {
        number: 3,
        file: "fig3-cspace",
        paper: "The sphere's dataset in the C-space of the proxy",
        ours: "Every configuration in contact, colour and size by torque; what did not converge is marked",
    },
    FigureNote {
        number: 4,
        file: "fig4-gridization",
        paper: "Torque in C-space before and after uniform gridization",
        ours: "One slab of C-space of the scan from above, so that points do not hide each other. Simulated",
    },
    FigureNote {
        number: 5,
        file: "fig5-press",
        paper: "Torque, configuration and contacting nodes during a press",
        ours: "The same curves; a simulated hand presses, since no device is attached",
    },
    FigureNote {
        number: 6,
        file: "fig6-deformation",
        paper: "The deformed sphere under the interpolated contact forces",
        ours: "Six instants of the press of Fig. 5; contact springs soft enough for the iteration let the arm sink in",
    },
    FigureNote {
        number: 7,
        file: "fig7-sponge",
        paper: "Photographs of the spongy plane, from above and from the side",
        ours: "A drawing: the block is simulated, no sponge was touched. Beside it its twin, pressed: shape and stiffness from the torques",
    },
    FigureNote {
        number: 8,
        file: "fig8-scrape",
        paper: "Force and configuration while scraping both covers at constant depth",
        ours: "The same curves. Simulated",
    },
    FigureNote {
        number: 9,
        file: "fig9-side-press",
        paper: "Torque and configuration during a press on the side",
        ours: "The same curves. Simulated",
    },
];

/// The whole comparison.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Comparison {
    /// Figure by figure.
    pub figures: Vec<FigureNote>,
    /// Number by number, in the paper's order.
    pub rows: Vec<Row>,
}

impl Comparison {
    /// Compares what was remade with the paper's text.
    #[must_use]
    pub fn new(sphere: Sphere<'_>, scans: Scans<'_>) -> Self {
        let mut rows = virtual_object(sphere);
        rows.extend(real_objects(scans));
        Self { figures: FIGURES.to_vec(), rows }
    }

    /// The comparison as a page of Markdown.
    #[must_use]
    pub fn markdown(&self) -> String {
        let mut text = format!("{HEADING}\n| Fig. | the paper | ours | file |\n|---|---|---|---|\n");
        // Writing to a string cannot fail.
        for FigureNote { number, file, paper, ours } in &self.figures {
            let file = if file.is_empty() { String::new() } else { format!("`{file}.png`") };
            let _ = writeln!(text, "| {number} | {paper} | {ours} | {file} |");
        }
        text += "\n| section | quantity | paper | ours | why they differ |\n|---|---|---|---|---|\n";
        for Row { section, quantity, paper, ours, same, why } in &self.rows {
            let same = match (same, why.is_empty()) {
                (true, true) => "the same",
                (true, false) => "the same; ",
                (false, _) => "",
            };
            let _ = writeln!(text, "| {section} | {quantity} | {paper} | {ours} | {same}{why} |");
        }
        text
    }
}

/// Section 4.1.
fn virtual_object(Sphere { scene, dataset, press }: Sphere<'_>) -> Vec<Row> {
    let row = |quantity, paper, ours, why: &str| Row::new("4.1", quantity, paper, ours, why);
    let counts = dataset.status_counts();
    let converged = 100.0 * counts.contact as f64 / counts.in_contact().max(1) as f64;
    let felt = press.summary();
    let graphics = scene.graphics.map_or(0.0, |graphics| graphics.rate);
    let nodes = dataset.surface.as_ref().map_or(0, |surface| surface.nodes.len() / 3);
    let step = dataset.grid.axes.first().map_or(0.0, |axis| axis.step);
    let counts_along: Vec<usize> = dataset.grid.axes.iter().map(|axis| axis.count).collect();
    vec![
        row("nodes of the sphere", Value::Count(102), Value::Count(nodes), ""),
        row(
            "configurations of the dataset",
            Value::Count(8064),
            Value::Count(dataset.grid.points()),
            &format!("{}; the paper does not say how many along each joint", extent(&counts_along)),
        ),
        row("interval of the grid [rad]", Value::Number(std::f64::consts::PI / 60.0), Value::Number(step), "pi/60"),
        row(
            "joints of the virtual proxy",
            Value::Count(3),
            Value::Count(dataset.grid.joints()),
            "the paper gives no link lengths",
        ),
        row(
            "contacts for which the iteration converges [%]",
            "most cases, if Kc and Kg are not so large".into(),
            Value::Number(converged),
            "the paper gives neither stiffness nor share; `datasets/paper.toml` lists the share against Kc",
        ),
        row("contact index threshold Ith", Value::Number(0.5), Value::Number(scene.haptics.threshold), ""),
        row(
            "slope Ks over its bound mu bv / Tk",
            "at most 1".into(),
            Value::Number(slope_over_bound(&scene.haptics)),
            "the paper gives no gains",
        ),
        row("haptic rate [Hz]", Value::Number(1000.0), Value::Number(scene.haptics.rate), ""),
        row("graphics rate [Hz]", Value::Number(60.0), Value::Number(graphics), ""),
        row(
            "most contacting nodes during the press (Fig. 5)",
            "multi-point contact".into(),
            Value::Count(felt.max_contact_nodes as usize),
            "another press on another arm; ours counts the nodes of the nearest grid point in contact",
        ),
        row(
            "greatest contact torque during the press [N m]",
            "only drawn (Fig. 5)".into(),
            Value::Number(felt.max_contact_torque),
            "scales with the stiffnesses, which the paper does not give",
        ),
        row(
            "greatest change of that torque in 1 ms, over its greatest value [%]",
            "smooth".into(),
            Value::Number(100.0 * felt.max_contact_torque_step / felt.max_contact_torque),
            "a number for what the paper shows",
        ),
        row(
            "energy that proxy and coupling gave beyond what they took [J]",
            "passive (NPMI)".into(),
            // What rounding leaves is no energy.
            Value::Number((-felt.min_absorbed - felt.max_account_residual).max(0.0)),
            "measured by the energy accounts of the loop, which the paper does not have",
        ),
    ]
}

/// Greatest Ks Tk / (mu bv) of the joints: at most one where the boundary layer is passive.
fn slope_over_bound(haptics: &HapticsSpec) -> f64 {
    let bound = |damping: f64| haptics.passivity_factor * damping * haptics.rate;
    let ratios = haptics.boundary_slope.iter().zip(haptics.proxy_damping.iter());
    ratios.map(|(slope, damping)| slope / bound(*damping)).fold(0.0, f64::max)
}

/// Section 4.2.
fn real_objects(Scans { bare, fabric, side }: Scans<'_>) -> Vec<Row> {
    const HULL: &str = "the count is the volume of the samples' hull in C-space over 0.03^3 rad^3; it depends on link \
                        lengths and on where the block stands, which the paper does not give";
    let row = |quantity, paper, ours, why: &str| Row::new("4.2", quantity, paper, ours, why);
    let held = |of: Scanned<'_>| EndForce::new("", of.chain, of.trace).and_then(|force| force.held());
    let steady = |held: Option<SteadyForce>| held.map_or(f64::NAN, |held| 100.0 * held.variation);
    let [on_bare, on_fabric] = [held(bare), held(fabric)];
    let ratio = on_bare.zip(on_fabric).map_or(f64::NAN, |(bare, fabric)| fabric.mean / bare.mean);
    let pressed = side.trace.summary();
    let step = bare.dataset.grid.axes.first().map_or(0.0, |axis| axis.step);
    vec![
        row("size of the object", "18 cm x 8 cm x 5 cm".into(), size(&bare.scene.scan), "simulated"),
        row("resolution of the scan [mm]", Value::Number(6.0), resolution(&bare.scene.scan), ""),
        row("interval of the grid [rad]", Value::Number(0.03), Value::Number(step), ""),
        row(
            "scanned points, from above",
            Value::Count(3472),
            Value::Count(bare.samples.len()),
            &lines(&bare.scene.scan),
        ),
        row("gridized points, from above", Value::Count(7486), Value::Count(inside(bare)), HULL),
        row(
            "gridized points, under a fabric",
            "not given".into(),
            Value::Count(inside(fabric)),
            "the fabric holds the tip back, which makes the hull smaller",
        ),
        row(
            "scanned points, from the side",
            Value::Count(1488),
            Value::Count(side.samples.len()),
            &lines(&side.scene.scan),
        ),
        row("gridized points, from the side", Value::Count(3614), Value::Count(inside(side)), HULL),
        row(
            "variation of the normal force while scraping, bare [%]",
            "almost constant".into(),
            Value::Number(steady(on_bare)),
            "greatest departure from the mean over the middle half of the contact",
        ),
        row(
            "variation of the normal force while scraping, under a fabric [%]",
            "almost constant".into(),
            Value::Number(steady(on_fabric)),
            "greatest departure from the mean over the middle half of the contact",
        ),
        row(
            "normal force under a fabric over bare, at the same depth",
            "stiffer".into(),
            Value::Number(ratio),
            "depends on the fabric; ours is simulated",
        ),
        row(
            "greatest change of the torque in 1 ms during the side press, over its greatest value [%]",
            "smooth".into(),
            Value::Number(100.0 * pressed.max_contact_torque_step / pressed.max_contact_torque),
            "a number for what the paper shows",
        ),
    ]
}

/// Grid points inside the measured region.
pub(super) fn inside(scanned: Scanned<'_>) -> usize {
    let dataset = scanned.dataset;
    dataset.grid.points() - dataset.status_counts().outside
}

/// Sides of the block, longest first.
fn size(scan: &ScanSpec) -> Value {
    let mut sides = scan.simulated.size.to_array().map(|side| 100.0 * side);
    sides.sort_by(|a, b| b.total_cmp(a));
    Value::Words(sides.map(|side| format!("{} cm", Value::Number(side))).join(" x "))
}

/// `31 x 14 x 8`.
fn extent(counts: &[usize]) -> String {
    counts.iter().map(ToString::to_string).collect::<Vec<_>>().join(" x ")
}

/// Returns how the plan's points lie.
fn lines(scan: &ScanSpec) -> String {
    match &scan.plan {
        PlanSpec::Workspace(plan) => {
            format!("{} lines of {} levels", extent(&plan.across.map(|axis| axis.count)), plan.depth.count)
        }
        PlanSpec::Joints(_) => String::new(),
    }
}

/// Distance of neighbouring positions (mm).
fn resolution(scan: &ScanSpec) -> Value {
    match &scan.plan {
        PlanSpec::Workspace(plan) => Value::Number(1e3 * plan.depth.spacing),
        PlanSpec::Joints(_) => "a grid over the joints".into(),
    }
}
