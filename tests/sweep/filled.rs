//! Grids of which only what coarser ones do not foretell is solved.

use crate::fixture::{Folder, bake, peak};
use haptize::{
    JointVector,
    contact::{Equilibrium, Model, Status},
    dataset::Dataset,
    field::TorqueField,
    haptize::{Backend, CpuBackend, Progress, Run, Sweep, SweepError, SweepReport},
    object::Object,
    proxy::Chain,
    scene::{AxisSpec, Scene},
};
use std::sync::atomic::{AtomicBool, Ordering};

/// The paper's sphere with its arm raised, so that it is pressed by some millimetres, over a small part of its grid.
fn scene(steps: [usize; 3]) -> Scene {
    let text = include_str!("../../datasets/sphere.toml").replace("0.176]", "0.182]");
    let mut scene = Scene::parse(&text, "raised.toml").unwrap();
    let ranges = [(0.0, 0.1), (1.5, 1.6), (-1.9, -1.8)];
    let axes = ranges.iter().zip(steps).map(|((start, stop), steps)| AxisSpec {
        start: *start,
        step: (stop - start) / steps as f64,
        count: steps + 1,
    });
    scene.grid.axes = axes.collect();
    scene
}

/// The CPU, counting what it solves; one in so many of what it is asked for does not converge.
struct Counting<'a> {
    cpu: CpuBackend<'a>,
    solved: usize,
    lost_one_in: usize,
}

impl Backend for Counting<'_> {
    type Error = std::convert::Infallible;
    fn solve(&mut self, configurations: &[JointVector]) -> Result<Vec<Equilibrium>, Self::Error> {
        self.solved += configurations.len();
        let mut equilibria = self.cpu.solve(configurations)?;
        for (equilibrium, q) in equilibria.iter_mut().zip(configurations) {
            let number = q.iter().map(|x| (x * 1e6).round() as i64).sum::<i64>().unsigned_abs() as usize;
            if number.is_multiple_of(self.lost_one_in) && equilibrium.status == Status::Contact {
                equilibrium.status = Status::Unconverged;
            }
        }
        Ok(equilibria)
    }
}

/// What `work` makes of a sweep of `scene`, filled to `tolerance` or solved everywhere, and a backend for it.
fn with<T>(
    scene: &Scene,
    tolerance: Option<f64>,
    lost_one_in: usize,
    work: impl FnOnce(&Sweep<'_>, &mut Counting<'_>) -> T,
) -> T {
    let (object, chain) = (Object::build(&scene.object).unwrap(), Chain::new(&scene.proxy));
    let model = Model::new(&object, &chain, scene.contact);
    let mut backend = Counting { cpu: CpuBackend::new(&model, 0).unwrap(), solved: 0, lost_one_in };
    let mut sweep = Sweep::new(scene, &object, "cpu", "none", "").unwrap();
    match tolerance {
        Some(tolerance) => sweep.fill(&model, tolerance).unwrap(),
        None => sweep.skip_free_space(&model).unwrap(),
    }
    work(&sweep, &mut backend)
}

fn in_memory(scene: &Scene, tolerance: Option<f64>, lost_one_in: usize) -> (Dataset, SweepReport, usize) {
    with(scene, tolerance, lost_one_in, |sweep, backend| {
        let run = Run { chunk: 100, stop: &AtomicBool::new(false), progress: &mut |_| () };
        let (dataset, report) = sweep.run(backend, run).unwrap();
        (dataset, report, backend.solved)
    })
}

const NEVER: usize = usize::MAX;

/// Worst distance of the rendered torque from `solved` at its points [N m].
fn worst(dataset: &Dataset, scene: &Scene, solved: &Dataset) -> f64 {
    let slope = &scene.haptics.boundary_slope;
    let field = TorqueField::interpolated(dataset, haptize::scene::Interpolation::Potential, 0.5, slope).unwrap();
    let error = |point: usize| {
        let found = field.sample(&solved.grid.configuration(point)).torque;
        found.iter().zip(solved.torque(point)).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt()
    };
    (0..solved.grid.points()).map(error).fold(0.0, f64::max)
}

/// A grid that no other shares a point with, for holding against.
fn held_out() -> Scene {
    let mut scene = scene([11, 11, 11]);
    for axis in &mut scene.grid.axes {
        axis.start += 0.37 * axis.step;
        axis.count -= 1;
    }
    scene
}

#[test]
fn a_filled_grid_solves_a_fraction_and_errs_hardly_more() {
    let held_out = in_memory(&held_out(), None, NEVER).0;
    let scene = scene([24, 24, 24]);
    let (uniform, ..) = in_memory(&scene, None, NEVER);
    let (coarse, ..) = in_memory(&self::scene([12, 12, 12]), None, NEVER);
    let (filled, report, solved) = in_memory(&scene, Some(0.0023), NEVER);
    let [all, some] = [&uniform, &filled].map(|dataset| dataset.status_counts());
    assert_eq!((all.in_contact(), all.free), (some.in_contact(), some.free), "contact is known everywhere");
    assert_eq!(report.filled_points, some.filled);
    assert!(solved + some.filled == some.in_contact(), "nothing free is solved: {solved} of {some:?}");
    let [fine, rough, found] = [&uniform, &coarse, &filled].map(|dataset| worst(dataset, &scene, &held_out));
    assert!(3 * solved < all.in_contact(), "{solved} of {}", all.in_contact());
    assert!(found < 1.7 * fine && found < 0.6 * rough, "{fine}, filled {found}, every second line {rough} N m");
    for point in 0..filled.grid.points() {
        if filled.status(point) != Status::Filled {
            assert_eq!(filled.torque(point), uniform.torque(point), "point {point}");
            assert_eq!(filled.forces(point).collect::<Vec<_>>(), uniform.forces(point).collect::<Vec<_>>());
        }
        assert_eq!(filled.gap.as_ref().unwrap()[point] < 0.0, uniform.gap.as_ref().unwrap()[point] < 0.0);
    }
    // Forces belong to the torque: where it is filled they push about as hard as they would have.
    let push = |dataset: &Dataset, point: usize| dataset.forces(point).map(|c| c.force).sum::<glam::DVec3>().length();
    let points = (0..filled.grid.points()).filter(|&point| filled.status(point) == Status::Filled);
    let (off, size) = points.fold((0.0, 0.0), |(off, size), point| {
        let exact = push(&uniform, point);
        (off + (push(&filled, point) - exact).powi(2), size + exact * exact)
    });
    assert!(off < 0.05_f64.powi(2) * size, "{}", (off / size).sqrt());
    // With nothing to spare hardly anything is filled.
    let (exact, report, _) = in_memory(&self::scene([12, 12, 12]), Some(1e-12), NEVER);
    assert!(report.filled_points * 50 < exact.status_counts().in_contact(), "{}", report.filled_points);
}

#[test]
fn what_does_not_converge_is_kept_and_everything_around_it_solved() {
    let scene = scene([16, 16, 16]);
    let (filled, ..) = in_memory(&scene, Some(0.1), 7);
    let counts = filled.status_counts();
    assert!(counts.unconverged > 20 && counts.filled > 20, "{counts:?}");
    // No cell of every second line with a flagged corner has a point in it that was filled.
    let pitch = [17 * 17, 17, 1];
    let mut flagged = 0;
    for number in 0..8 * 8 * 8 {
        let low: usize = [number / 64, number / 8 % 8, number % 8].iter().zip(pitch).map(|(k, p)| 2 * k * p).sum();
        let at = |step: usize, n: usize| low + step * (n / 9 * pitch[0] + n / 3 % 3 * pitch[1] + n % 3);
        let corners = (0..27).filter(|n| [n / 9, n / 3 % 3, n % 3].iter().all(|k| k % 2 == 0));
        if corners.into_iter().any(|n| filled.status(at(1, n)) == Status::Unconverged) {
            flagged += 1;
            let inside = (0..27).filter(|n| [n / 9, n / 3 % 3, n % 3].contains(&1));
            assert!(inside.into_iter().all(|n| filled.status(at(1, n)) != Status::Filled), "cell at {low}");
        }
    }
    assert!(flagged > 10, "{flagged}");
}

#[test]
fn a_filled_bake_is_the_same_whatever_the_chunks_and_however_often_it_is_stopped() {
    let scene = scene([12, 12, 12]);
    let bytes = |chunk: usize, stops: &[usize]| {
        with(&scene, Some(0.002), 11, |sweep, backend| {
            let folder = Folder::new();
            for &stop_at in stops {
                let error = bake(sweep, backend, &folder.output(), true, chunk, stop_at).unwrap_err();
                assert!(matches!(error, SweepError::Stopped { .. }), "{error}");
                assert_eq!(folder.names(), ["a.haptize.part"]);
            }
            let before = backend.solved;
            let report = bake(sweep, backend, &folder.output(), true, chunk, usize::MAX).unwrap();
            assert_eq!(report.resumed_points + backend.solved - before, report.contact_points - report.filled_points);
            assert!(stops.is_empty() || report.resumed_points > 0);
            assert_eq!(folder.names(), ["a.haptize"]);
            let columns = Dataset::open(&folder.output()).unwrap();
            assert_eq!(columns.status_counts().filled, report.filled_points);
            let mut bytes = bytemuck::cast_slice(&columns.torque).to_vec();
            bytes.extend_from_slice(&columns.status);
            bytes.extend_from_slice(bytemuck::cast_slice(&columns.contacts.as_ref().unwrap().forces));
            // The notices of resuming are the one difference.
            (if stops.is_empty() { std::fs::read(folder.output()).unwrap() } else { Vec::new() }, bytes)
        })
    };
    let (file, columns) = bytes(100, &[]);
    assert!(bytes(7, &[]).0 == file, "chunks");
    let free = in_memory(&scene, Some(0.002), 11).1.skipped_points;
    assert!(bytes(20, &[free + 1]).1 == columns, "stopped on the coarsest level");
    assert!(bytes(5, &[free + 60, free + 200]).1 == columns, "stopped twice");
}

#[test]
fn filling_takes_the_memory_stated_and_tells_how_far_it_is() {
    let scene = scene([16, 12, 12]);
    with(&scene, Some(0.002), NEVER, |sweep, backend| {
        let stated = sweep.footprint(50, true);
        let (mut before, ends) = (0, AtomicBool::new(false));
        let mut progress = |progress: Progress| {
            assert!(progress.done >= before && progress.done <= progress.points && progress.footprint == stated);
            before = progress.done;
            ends.store(progress.rate > 0.0, Ordering::Relaxed);
        };
        let run = Run { chunk: 50, stop: &AtomicBool::new(false), progress: &mut progress };
        let ((dataset, report), peak) = peak(|| sweep.run(backend, run).unwrap());
        assert!(ends.into_inner() && report.footprint == stated);
        assert!(peak <= stated.memory.most, "{peak} bytes, {stated:?}");
        assert!(peak * 30 > stated.memory.least && dataset.grid.points() == report.points);
    });
}

#[test]
fn a_grid_whose_lines_cannot_be_halved_twice_is_refused_with_the_remedy() {
    let text = include_str!("../../datasets/sphere.toml").replace("[grid]", "[grid]\nfill = 0.01");
    let error = Scene::parse(&text, "sphere.toml").unwrap_err().to_string();
    assert!(error.contains("axis 1 has 35") && error.contains("33 or 37"), "{error}");
    let text = text
        .replace("count = 36", "count = 37")
        .replace("count = 16", "count = 17")
        .replace("count = 14", "count = 13");
    let text = text.replace("limits = [-1.0, 1.0]", "limits = [-1.0, 1.1]");
    assert_eq!(Scene::parse(&text, "sphere.toml").unwrap().grid.fill, Some(0.01));
    let error = Scene::parse(&text.replace("fill = 0.01", "fill = 0.0"), "sphere.toml").unwrap_err().to_string();
    assert!(error.contains("fill is 0: it must be positive"), "{error}");
}
