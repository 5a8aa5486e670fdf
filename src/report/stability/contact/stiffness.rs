//! Every combination of contact stiffness, ground, springs, resolution and node radius, on random configurations: what share
//! converges, with how many iterations, in what time; that E never rises and no number breaks; and beside it, on a tenth of them,
//! the same with blended facets, and the paper's iteration.

use super::super::{Bound, Effort, Failure, Outcome, Setting};
use super::world::{BALL, Ball, RADIUS, contact, floating_bar, pressed, sphere};
use crate::{
    JointVector,
    contact::{Model, Solver, Status},
    gpu::{Context, GpuSolver},
    haptize::Backend,
    scene::{Algorithm, Blending, SpringKind},
};
use rayon::prelude::*;
use std::{
    sync::Arc,
    time::{Duration, Instant},
};

/// Depth classes, in radii of the sphere: the paper's "relatively rigid", and down to half a radius; with the share that must
/// converge in each.
const DEPTHS: [(f64, f64, f64); 2] = [(0.0, 0.2, 0.999), (0.2, 0.5, 0.95)];

/// Largest relative residual of what is called converged, on the CPU and on the GPU.
const RESIDUALS: [f64; 2] = [1e-6, 1e-4];

/// What the cells of the table add up.
#[derive(Default)]
struct Cell {
    solved: usize,
    converged: usize,
    /// Least share of any combination, and which one.
    least: Option<(f64, String)>,
    iterations: Vec<u32>,
    time: Duration,
    paper: (usize, usize),
    paper_time: Duration,
    blended: (usize, usize),
    blended_time: Duration,
    gpu: (usize, usize),
    gpu_on_cpu: usize,
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
pub fn run(setting: &Setting) -> Result<Vec<Outcome>, Failure> {
    let full = setting.effort == Effort::Full;
    let stiffnesses: &[f64] =
        if full { &[1.0, 10.0, 1e2, 1e3, 1e4, 1e5, 1e6, f64::INFINITY] } else { &[1.0, 1e3, 1e6, f64::INFINITY] };
    let grounds: &[f64] = if full { &[0.1, 1.0, 10.0, 1e2, 1e3, 1e4] } else { &[0.1, 1e2] };
    let resolutions: &[usize] = if full { &[10, 45] } else { &[10] };
    let count = if full { 200 } else { 20 };
    let mut cells: Vec<Cell> = (0..stiffnesses.len() * 4).map(|_| Cell::default()).collect();
    let mut worst = Worst::default();
    for &rings in resolutions {
        for &ground in grounds {
            for patch in [false, true] {
                for springs in [SpringKind::Isotropic, SpringKind::Axial] {
                    let ball = Ball { rings, springs, ground, patch };
                    combination(setting, ball, stiffnesses, count, &mut cells, &mut worst)?;
                }
            }
        }
    }
    let mut outcomes = Vec::new();
    for (cell, place) in cells.iter().zip(0..) {
        let (stiffness, radius, depth) = (stiffnesses[place / 4], place / 2 % 2, place % 2);
        let (from, to, share) = DEPTHS[depth];
        outcomes.push(cell.outcome(stiffness, radius == 1, from, to, share));
    }
    for (depth, (from, to, share)) in DEPTHS.into_iter().enumerate() {
        let of = |place: &(usize, &Cell)| place.0 % 2 == depth;
        let blended = cells.iter().enumerate().filter(of).map(|(_, cell)| cell.blended);
        let (converged, solved) = blended.fold((0, 0), |sum, cell| (sum.0 + cell.0, sum.1 + cell.1));
        outcomes.push(Outcome {
            case: "stiffness".into(),
            varied: format!("all of these, blended, depth {from} to {to} R"),
            measure: "share converged [1]".into(),
            worst: converged as f64 / solved.max(1) as f64,
            bound: Bound::AtLeast(share),
            note: format!("{solved} solved"),
        });
    }
    let figure = |varied: &str, measure: &str, worst: f64, bound: f64| Outcome {
        case: "stiffness".into(),
        varied: varied.into(),
        measure: measure.into(),
        worst,
        bound: Bound::AtMost(bound),
        note: String::new(),
    };
    let note = format!("{} configurations", worst.checked);
    outcomes.push(Outcome {
        note,
        ..figure("all of these", "residual of what is called converged [1]", worst.residual, RESIDUALS[0])
    });
    if setting.gpu.is_some() {
        outcomes.push(figure(
            "all, on the GPU",
            "residual of what is called converged [1]",
            worst.gpu_residual,
            RESIDUALS[1],
        ));
    }
    outcomes.push(figure("all of these", "rise of E in a step, relative [1]", worst.rise, 1e-12));
    outcomes.push(figure("all of these", "results with numbers that are not finite", worst.broken as f64, 0.0));
    Ok(outcomes)
}

impl Cell {
    /// The cell as a line of the table.
    fn outcome(&self, stiffness: f64, ball: bool, from: f64, to: f64, share: f64) -> Outcome {
        let mut iterations = self.iterations.clone();
        iterations.sort_unstable();
        let median = iterations.get(iterations.len() / 2).copied().unwrap_or(0);
        let most = iterations.last().copied().unwrap_or(0);
        let (least, which) = self.least.clone().unwrap_or((1.0, String::new()));
        let each = |time: Duration, count: usize| 1e6 * time.as_secs_f64() / count.max(1) as f64;
        let percent = |part: usize, whole: usize| 100.0 * part as f64 / whole.max(1) as f64;
        let mut note = format!(
            "worst with {which}; {:.1} % of all {}, {median}/{most} iterations (median/max), {:.0} us; blended {:.0} %, {:.0} us; \
             paper {:.0} %, {:.0} us",
            percent(self.converged, self.solved),
            self.solved,
            each(self.time, self.solved),
            percent(self.blended.0, self.blended.1),
            each(self.blended_time, self.blended.1),
            percent(self.paper.0, self.paper.1),
            each(self.paper_time, self.paper.1),
        );
        if self.gpu.1 > 0 {
            let (on_gpu, of) = (percent(self.gpu.0, self.gpu.1), percent(self.gpu_on_cpu, self.gpu.1));
            note += &format!("; GPU {on_gpu:.1} %, {of:.0} % of them by the CPU");
        }
        let stiffness = if stiffness.is_finite() { format!("{stiffness:.0e} N/m") } else { "rigid".into() };
        let nodes = if ball { "balls" } else { "points" };
        Outcome {
            case: "stiffness".into(),
            varied: format!("Kc {stiffness}, {nodes}, depth {from} to {to} R"),
            measure: "share converged, worst combination [1]".into(),
            worst: least,
            bound: Bound::AtLeast(share),
            note,
        }
    }
}

/// One object with all stiffnesses, radii and depths.
fn combination(
    setting: &Setting,
    ball: Ball,
    stiffnesses: &[f64],
    count: usize,
    cells: &mut [Cell],
    worst: &mut Worst,
) -> Result<(), Failure> {
    let object = sphere(ball)?;
    let chains = [floating_bar(0.0), floating_bar(BALL)];
    for (radius, chain) in chains.iter().enumerate() {
        let mut model = Model::new(&object, chain, contact(1.0));
        for (depth, (from, to, _)) in DEPTHS.into_iter().enumerate() {
            let configurations = pressed(&model, 1, count, from * RADIUS, to * RADIUS);
            for (k, &stiffness) in stiffnesses.iter().enumerate() {
                model.set_stiffness(stiffness);
                let cell = &mut cells[4 * k + 2 * radius + depth];
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
                let before = cell.converged;
                for (time, rise, result) in results {
                    cell.time += time;
                    cell.solved += 1;
                    cell.iterations.push(result.iterations);
                    worst.checked += 1;
                    worst.rise = worst.rise.max(rise);
                    if !(result.energy.is_finite() && result.torque.is_finite() && result.residual.is_finite()) {
                        worst.broken += 1;
                    }
                    if result.status == Status::Contact {
                        cell.converged += 1;
                        worst.residual = worst.residual.max(result.residual);
                    }
                }
                let share = (cell.converged - before) as f64 / count as f64;
                if cell.least.as_ref().is_none_or(|(least, _)| share < *least) {
                    let held = if ball.patch { "a patch" } else { "all nodes" };
                    let Ball { rings, springs, ground, .. } = ball;
                    let nodes = rings * rings + 2;
                    cell.least = Some((share, format!("{nodes} nodes, {springs:?}, Kg {ground} on {held}")));
                }
                model.set_blending(Blending::Mesh);
                tenth(&model, &configurations, &mut cell.blended, &mut cell.blended_time);
                model.set_blending(Blending::Width(0.0));
                model.contact.algorithm = Algorithm::Paper;
                tenth(&model, &configurations, &mut cell.paper, &mut cell.paper_time);
                model.contact.algorithm = Algorithm::Energy;
                if let (Some(context), true) = (&setting.gpu, ball.rings <= 10) {
                    on_gpu(context, &model, &configurations, cell, worst)?;
                }
            }
        }
    }
    Ok(())
}

/// The model on a tenth of the configurations: how many of how many converge, and in what time.
fn tenth(model: &Model<'_>, configurations: &[Vec<f64>], share: &mut (usize, usize), time: &mut Duration) {
    let solve = |solver: &mut Solver<'_>, q: &Vec<f64>| {
        let since = Instant::now();
        (usize::from(solver.solve(q).status == Status::Contact), since.elapsed())
    };
    let results: Vec<_> = configurations.par_iter().step_by(10).map_init(|| Solver::new(model), solve).collect();
    for (converged, took) in results {
        share.0 += converged;
        share.1 += 1;
        *time += took;
    }
}

/// The same by the kernels.
fn on_gpu(
    context: &Arc<Context>,
    model: &Model<'_>,
    configurations: &[Vec<f64>],
    cell: &mut Cell,
    worst: &mut Worst,
) -> Result<(), Failure> {
    let mut solver = GpuSolver::new(Arc::clone(context), model)?;
    let configurations: Vec<JointVector> = configurations.iter().map(|q| JointVector::from_slice(q)).collect();
    for result in solver.solve(&configurations)? {
        cell.gpu.1 += 1;
        if result.status == Status::Contact {
            cell.gpu.0 += 1;
            worst.gpu_residual = worst.gpu_residual.max(result.residual);
        }
    }
    cell.gpu_on_cpu += solver.left_to_cpu();
    Ok(())
}
