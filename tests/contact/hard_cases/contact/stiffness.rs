//! Every combination of contact stiffness, node radius and body, on random configurations: bodies of springs, of all
//! grounds, kinds and resolutions, and with a skin: what share converges, with how many iterations, in what time; that
//! E never rises and no number breaks. Beside it the same on the GPU, of the fine surface a tenth, and a tenth of all
//! by the paper's iteration.

use super::processor::Processor;
use crate::hard_cases::{Bound, CaseResult, Effort, Failure, Setting};
use haptize::fixtures::bodies::{BALL, Ball, RADIUS, contact, contact_of, floating_bar, pressed, skinned, sphere};
use haptize::{
    JointVector,
    contact::{Model, Solver, Status},
    gpu::{Context, GpuError},
    object::Object,
    paper::PaperSolver,
    scene::SpringKind,
};
use rayon::prelude::*;
use std::{
    ops::AddAssign,
    sync::Arc,
    time::{Duration, Instant},
};

/// Depth classes, in radii of the sphere: the paper's "relatively rigid", and down to half a radius; with the share
/// that must converge in each, of bodies of springs alone and of those with a skin. Springs alone hold no surface
/// smooth that is pressed by balls finer than its facets; what does not converge is flagged.
const DEPTHS: [(f64, f64, [f64; 2]); 2] = [(0.0, 0.2, [0.95, 0.999]), (0.2, 0.5, [0.85, 0.999])];

/// Materials of the bodies, in the order of their bounds.
const BODIES: [&str; 2] = ["springs", "skin"];

/// How many of how many converge, and what time they take together.
#[derive(Clone, Copy, Default)]
struct Share {
    converged: usize,
    solved: usize,
    time: Duration,
}

impl Share {
    /// One configuration.
    fn of(converged: bool, time: Duration) -> Self {
        Self { converged: usize::from(converged), solved: 1, time }
    }

    /// The part that converges; without any body it is no number, which keeps no bound.
    fn part(self) -> f64 {
        self.converged as f64 / self.solved as f64
    }
}

impl AddAssign for Share {
    fn add_assign(&mut self, other: Self) {
        self.converged += other.converged;
        self.solved += other.solved;
        self.time += other.time;
    }
}

/// The sums in the cells of the table.
#[derive(Default)]
struct Cell {
    all: Share,
    /// Least share of any combination, and which one.
    least: Option<(f64, String)>,
    iterations: Vec<u32>,
    paper: Share,
    gpu: Share,
    gpu_on_cpu: usize,
    /// Combinations whose compliance the adapter does not bind.
    gpu_too_large: usize,
}

/// Worst of all cells.
#[derive(Default)]
struct Worst {
    residual: f64,
    gpu_residual: f64,
    rise: f64,
    broken: usize,
    checked: usize,
}

/// The sweep.
pub fn run(setting: &Setting) -> Result<Vec<CaseResult>, Failure> {
    let full = setting.effort == Effort::Full;
    let stiffnesses: &[f64] =
        if full { &[1.0, 10.0, 1e2, 1e3, 1e4, 1e5, 1e6, f64::INFINITY] } else { &[1.0, 1e3, 1e6, f64::INFINITY] };
    let grounds: &[f64] = if full { &[0.1, 1.0, 10.0, 1e2, 1e3, 1e4] } else { &[0.1, 1e2] };
    let resolutions: &[usize] = if full { &[10, 45] } else { &[10] };
    let count = if full { 200 } else { 20 };
    let divisions: &[usize] = if full { &[4, 16] } else { &[4] };
    let mut cells: Vec<Cell> = (0..stiffnesses.len() * 8).map(|_| Cell::default()).collect();
    let mut worst = Worst::default();
    for &rings in resolutions {
        for &ground in grounds {
            for patch in [false, true] {
                for springs in [SpringKind::Isotropic, SpringKind::Axial] {
                    let object = sphere(Ball { rings, springs, ground, patch })?;
                    let held = if patch { "a patch" } else { "all nodes" };
                    let name = format!("{} nodes, {springs:?}, Kg {ground} on {held}", object.surface_nodes);
                    combination(setting, (&object, name, 0), stiffnesses, count, &mut cells, &mut worst)?;
                }
            }
        }
    }
    for &divisions in divisions {
        let object = skinned(divisions)?;
        let name = format!("{} nodes", object.surface_nodes);
        combination(setting, (&object, name, 1), stiffnesses, count, &mut cells, &mut worst)?;
    }
    let mut outcomes = Vec::new();
    for (cell, place) in cells.iter().zip(0..) {
        let (stiffness, radius, depth, body) = (stiffnesses[place / 8], place / 4 % 2, place / 2 % 2, place % 2);
        let (from, to, shares) = DEPTHS[depth];
        let nodes = if radius == 1 { "balls" } else { "points" };
        let varied = format!("{}, {nodes}, depth {from} to {to} R", BODIES[body]);
        outcomes.push(cell.outcome(stiffness, &varied, shares[body]));
    }
    for (depth, (from, to, [least, _])) in DEPTHS.into_iter().enumerate() {
        let (mut gpu, mut too_large) = (Share::default(), 0);
        for (cell, _) in cells.iter().zip(0..).filter(|(_, place)| place / 2 % 2 == depth) {
            gpu += cell.gpu;
            too_large += cell.gpu_too_large;
        }
        outcomes.push(CaseResult {
            case: "stiffness".into(),
            varied: format!("all of these, on the GPU, depth {from} to {to} R"),
            measure: "share converged [1]".into(),
            worst: gpu.part(),
            bound: Bound::AtLeast(least),
            note: format!("{} solved, {too_large} combinations too large for the adapter", gpu.solved),
        });
    }
    let figure = |varied: &str, measure: &str, worst: f64, bound: f64| CaseResult {
        case: "stiffness".into(),
        varied: varied.into(),
        measure: measure.into(),
        worst,
        bound: Bound::AtMost(bound),
        note: String::new(),
    };
    let note = format!("{} configurations", worst.checked);
    outcomes.push(CaseResult {
        note,
        ..figure(
            "all of these",
            "residual of what is called converged [1]",
            worst.residual,
            Processor::cpu().residual(),
        )
    });
    let (measure, bound) = ("residual of what is called converged [1]", Processor::gpu(&setting.gpu).residual());
    outcomes.push(figure("all, on the GPU", measure, worst.gpu_residual, bound));
    outcomes.push(figure("all of these", "rise of E in a step, relative [1]", worst.rise, 1e-12));
    outcomes.push(figure("all of these", "results with numbers that are not finite", worst.broken as f64, 0.0));
    Ok(outcomes)
}

impl Cell {
    /// The cell as a line of the table.
    fn outcome(&self, stiffness: f64, varied: &str, share: f64) -> CaseResult {
        let mut iterations = self.iterations.clone();
        iterations.sort_unstable();
        let median = iterations.get(iterations.len() / 2).copied().unwrap_or(0);
        let most = iterations.last().copied().unwrap_or(0);
        let (least, which) = self.least.clone().unwrap_or((1.0, String::new()));
        let percent = |share: Share| 100.0 * share.part();
        let each = |share: Share| 1e6 * share.time.as_secs_f64() / share.solved.max(1) as f64;
        let mut note = format!(
            "worst with {which}; {:.1} % of all {}, {median}/{most} iterations (median/max), {:.0} us; paper {:.0} %, \
             {:.0} us",
            percent(self.all),
            self.all.solved,
            each(self.all),
            percent(self.paper),
            each(self.paper),
        );
        if self.gpu.solved > 0 {
            let on_cpu = 100.0 * self.gpu_on_cpu as f64 / self.gpu.solved as f64;
            note += &format!("; GPU {:.1} %, {on_cpu:.0} % of them by the CPU", percent(self.gpu));
        }
        let stiffness = if stiffness.is_finite() { format!("{stiffness:.0e} N/m") } else { "rigid".into() };
        CaseResult {
            case: "stiffness".into(),
            varied: format!("Kc {stiffness}, {varied}"),
            measure: "share converged, worst combination [1]".into(),
            worst: least,
            bound: Bound::AtLeast(share),
            note,
        }
    }
}

/// One object, with its name and the place of its kind in [`BODIES`], with all stiffnesses, radii and depths.
fn combination(
    setting: &Setting,
    (object, name, body): (&Object, String, usize),
    stiffnesses: &[f64],
    count: usize,
    cells: &mut [Cell],
    worst: &mut Worst,
) -> Result<(), Failure> {
    let chains = [floating_bar(0.0), floating_bar(BALL)];
    for (radius, chain) in chains.iter().enumerate() {
        let mut model = Model::new(object, chain, contact_of(chain, 1.0));
        let mut paper = Model::new(object, chain, contact(1.0));
        for (depth, (from, to, _)) in DEPTHS.into_iter().enumerate() {
            let configurations = pressed(&model, 1, count, from * RADIUS, to * RADIUS);
            for (k, &stiffness) in stiffnesses.iter().enumerate() {
                model.set_stiffness(stiffness);
                paper.set_stiffness(stiffness);
                let cell = &mut cells[8 * k + 4 * radius + 2 * depth + body];
                let results: Vec<_> = configurations
                    .par_iter()
                    .map_init(
                        || Solver::new(&model),
                        |solver, q| {
                            let since = Instant::now();
                            let result = solver.solve(q);
                            let time = since.elapsed();
                            let history = solver.energy_history();
                            let steps =
                                history.windows(2).map(|pair| (pair[1] - pair[0]) / history[0].max(f64::MIN_POSITIVE));
                            (time, steps.fold(0.0, f64::max), result)
                        },
                    )
                    .collect();
                let mut share = Share::default();
                for (time, rise, result) in results {
                    let converged = result.status == Status::Contact;
                    share += Share::of(converged, time);
                    cell.iterations.push(result.iterations);
                    worst.checked += 1;
                    worst.rise = worst.rise.max(rise);
                    if !(result.energy.is_finite() && result.torque.is_finite() && result.residual.is_finite()) {
                        worst.broken += 1;
                    }
                    if converged {
                        worst.residual = worst.residual.max(result.residual);
                    }
                }
                cell.all += share;
                let share = share.part();
                if cell.least.as_ref().is_none_or(|(least, _)| share < *least) {
                    cell.least = Some((share, name.clone()));
                }
                cell.paper += tenth(&paper, &configurations);
                // A software rasteriser takes a hundred times the CPU's time.
                let every = match setting.effort {
                    Effort::Sample => 4,
                    Effort::Full if object.surface_nodes > 1000 => 10,
                    Effort::Full => 1,
                };
                let some: Vec<JointVector> = configurations.iter().step_by(every).copied().collect();
                on_gpu(&setting.gpu, &model, &some, cell, worst)?;
            }
        }
    }
    Ok(())
}

/// The paper's iteration on a tenth of the configurations.
fn tenth(model: &Model<'_>, configurations: &[JointVector]) -> Share {
    let solve = |solver: &mut PaperSolver<'_>, q: &JointVector| {
        let since = Instant::now();
        let converged = solver.solve(q).status == Status::Contact;
        Share::of(converged, since.elapsed())
    };
    let shares: Vec<_> = configurations.par_iter().step_by(10).map_init(|| PaperSolver::new(model), solve).collect();
    let mut sum = Share::default();
    shares.into_iter().for_each(|share| sum += share);
    sum
}

/// The same by the kernels.
fn on_gpu(
    context: &Arc<Context>,
    model: &Model<'_>,
    configurations: &[JointVector],
    cell: &mut Cell,
    worst: &mut Worst,
) -> Result<(), Failure> {
    let mut processor = Processor::gpu(context);
    let results = match processor.solve(model, configurations) {
        Err(GpuError::TooLarge { .. }) => {
            cell.gpu_too_large += 1;
            return Ok(());
        }
        results => results?,
    };
    for result in results {
        let converged = result.status == Status::Contact;
        cell.gpu += Share::of(converged, Duration::ZERO);
        if converged {
            worst.gpu_residual = worst.gpu_residual.max(result.residual);
        }
    }
    cell.gpu_on_cpu += processor.left_to_cpu();
    Ok(())
}
