//! The stored energy of the sphere scene that ships: it does not jump along lines through C-space, and no other start
//! finds less of it.
//!
//! Where an equilibrium found from rest is the lowest one, U is continuous and its gradient field passive. Along a
//! line, U changes between neighbouring configurations by the work of the torque; what is left is a jump. An
//! independent search starts from forces that have nothing to do with the rest state: those that hold neighbours on the
//! grid, weaker and stronger ones, and those of configurations elsewhere.

use crate::hard_cases::{Bound, CaseResult, Effort, Failure, Setting};
use haptize::{
    JointVector,
    contact::{Equilibrium, Model, Solver, Status},
    fixtures::Random,
    object::Object,
    proxy::Chain,
    scene::Scene,
    sweep::Sweep,
};
use rayon::prelude::*;

const SPHERE: &str = include_str!("../../../../datasets/sphere.toml");

/// Configurations between two points of the grid.
const FINE: usize = 256;

/// Starts of the independent search, beside those from neighbours.
const ELSEWHERE: usize = 5;

/// Energy, relative, by which another equilibrium counts as lower (1): the searches end at a residual of 1e-8, whose
/// square it errs by.
const LOWER: f64 = 1e-6;

/// Greatest jump of U over the work of one grid step (1).
const JUMP: f64 = 0.01;

/// Least share of configurations whose equilibrium from rest is the lowest found (1).
const LOWEST: f64 = 0.995;

/// Both measures.
pub fn run(setting: &Setting) -> Result<Vec<CaseResult>, Failure> {
    let (steps, searched) = match setting.effort {
        Effort::Full => (1000, 500),
        Effort::Sample => (8, 40),
    };
    let scene = Scene::parse(SPHERE, "sphere.toml")?;
    let object = Object::build(&scene.object)?;
    let chain = Chain::new(&scene.proxy);
    let sweep = Sweep::new(&scene, &object, "cpu", "", "")?;
    let grid = sweep.grid();
    let all: Vec<JointVector> = (0..grid.points()).map(|point| grid.configuration(point)).collect();
    let model = Model::reaching(&object, &chain, scene.contact, &all)?;
    let space = Space { model: &model, all: &all, steps: grid.axes.iter().map(|axis| axis.step).collect() };
    Ok(vec![space.along_lines(steps), space.searched_anew(searched)])
}

/// The scene's C-space.
struct Space<'a> {
    model: &'a Model<'a>,
    all: &'a [JointVector],
    /// Step of each axis (rad).
    steps: Vec<f64>,
}

impl Space<'_> {
    /// A random configuration within a grid step of a point of the grid.
    fn anywhere(&self, random: &mut Random) -> JointVector {
        let mut q = self.all[random.between(0.0, self.all.len() as f64) as usize];
        q.iter_mut().zip(&self.steps).for_each(|(x, step)| *x += step * random.between(-0.5, 0.5));
        q
    }

    /// U along random lines one grid step long.
    fn along_lines(&self, count: usize) -> CaseResult {
        let mut random = Random::new(21);
        let lines: Vec<(JointVector, JointVector)> = (0..count)
            .map(|_| {
                let (from, mut to) = (self.anywhere(&mut random), JointVector::zeros(self.steps.len()));
                to.iter_mut().for_each(|x| *x = random.between(-1.0, 1.0));
                let length = to.norm();
                let ends = from.iter().zip(&self.steps);
                to.iter_mut().zip(ends).for_each(|(x, (from, step))| *x = from + *x / length * step);
                (from, to)
            })
            .collect();
        let line = |solver: &mut Solver<'_>, (from, to): &(JointVector, JointVector)| {
            let at = |k: usize| -> Vec<f64> {
                let share = k as f64 / FINE as f64;
                from.iter().zip(to.iter()).map(|(a, b)| a + share * (b - a)).collect()
            };
            (0..=FINE).map(|k| (at(k), solver.solve(&at(k)))).collect::<Vec<_>>()
        };
        let solved: Vec<_> = lines.par_iter().map_init(|| Solver::new(self.model), line).collect();
        let torques = || solved.iter().flatten().map(|(_, found)| found.torque.norm()).filter(|size| *size > 0.0);
        let size = (torques().map(|size| size * size).sum::<f64>() / torques().count() as f64).sqrt();
        let step = (self.steps.iter().map(|step| step * step).sum::<f64>() / self.steps.len() as f64).sqrt();
        let (mut worst, mut flagged) = (0.0_f64, 0);
        for line in &solved {
            flagged += line.iter().filter(|(_, found)| found.status.is_failed()).count();
            for pair in line.windows(2) {
                worst = worst.max(unexplained(&pair[0], &pair[1]) / (size * step));
            }
        }
        CaseResult {
            case: "lowest equilibrium".into(),
            varied: format!("{count} lines of one grid step in {FINE} parts, sphere with a skin"),
            measure: "greatest jump of U over rms torque times step [1]".into(),
            worst,
            bound: Bound::AtMost(JUMP),
            note: format!("{flagged} configurations flagged"),
        }
    }

    /// Independent searches for a lower equilibrium.
    fn searched_anew(&self, count: usize) -> CaseResult {
        let mut random = Random::new(22);
        let mut solver = Solver::new(self.model);
        let mut touching = Vec::new();
        while touching.len() < count {
            let q = self.anywhere(&mut random);
            let found = solver.solve(&q);
            if found.status == Status::Contact {
                touching.push((q, found));
            }
        }
        let lower = |solver: &mut Solver<'_>, k: usize| {
            let (q, found) = &touching[k];
            let elsewhere = (1..=ELSEWHERE).map(|other| &touching[(k + other * 7) % count].1);
            let mut starts: Vec<Equilibrium> = elsewhere.cloned().collect();
            for axis in 0..q.len() {
                for side in [-1.0, 1.0] {
                    let mut neighbour = *q;
                    neighbour[axis] += side * self.steps[axis];
                    starts.push(solver.solve(&neighbour));
                }
            }
            for scale in [0.3, 0.7, 1.5, 3.0] {
                let mut start = found.clone();
                start.forces.iter_mut().for_each(|force| force.force *= scale);
                starts.push(start);
            }
            let energies = starts.iter().map(|start| solver.solve_from(q, &start.forces));
            let least = energies
                .filter(|other| other.status == Status::Contact)
                .map(|other| other.energy)
                .fold(found.energy, f64::min);
            found.energy > least * (1.0 + LOWER)
        };
        let beaten = (0..count).into_par_iter().map_init(|| Solver::new(self.model), lower).filter(|beaten| *beaten);
        let beaten = beaten.count();
        CaseResult {
            case: "lowest equilibrium".into(),
            varied: format!("{count} configurations from {} starts each", 2 * self.steps.len() + ELSEWHERE + 4),
            measure: "share whose equilibrium from rest is the lowest found [1]".into(),
            worst: 1.0 - beaten as f64 / count as f64,
            bound: Bound::AtLeast(LOWEST),
            note: format!("{beaten} have a lower one"),
        }
    }
}

/// Returns by how much U changes between two configurations beside the work of the torque, by the trapezoidal rule;
/// where one is flagged there is no telling (J).
fn unexplained((from, before): &(Vec<f64>, Equilibrium), (to, after): &(Vec<f64>, Equilibrium)) -> f64 {
    if before.status.is_failed() || after.status.is_failed() {
        return 0.0;
    }
    let torques = before.torque.iter().zip(after.torque.iter());
    let work: f64 = torques.zip(from.iter().zip(to)).map(|((a, b), (from, to))| 0.5 * (a + b) * (to - from)).sum();
    (after.energy - before.energy + work).abs()
}
