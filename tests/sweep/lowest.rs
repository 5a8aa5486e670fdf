//! The lowest equilibrium: a ball pressed so deep into a soft sphere that it has several, on a grid over which they
//! change.

use crate::fixture::Folder;
use haptize::{
    Error,
    contact::{Model, Status},
    dataset::Dataset,
    object::Object,
    proxy::Chain,
    scene::Scene,
    sweep::{CpuBackend, Lowered, Run, Sweep, SweepReport},
};
use std::{
    path::Path,
    sync::atomic::{AtomicBool, Ordering},
};

/// Contact with several equilibria.
pub const SCENE: &str = include_str!("../scenes/deep_points.toml");

/// Object and proxy of a scene, and sweeps over it.
struct World {
    scene: Scene,
    object: Object,
    chain: Chain,
}

impl World {
    fn new() -> Self {
        let scene = Scene::parse(SCENE, "deep.toml").unwrap();
        Self { object: Object::build(&scene.object).unwrap(), chain: Chain::new(&scene.proxy), scene }
    }

    fn with<T>(&self, lowest: bool, work: impl FnOnce(&Sweep<'_>, &Model<'_>) -> T) -> T {
        let model = Model::new(&self.object, &self.chain, self.scene.contact);
        let mut sweep = Sweep::new(&self.scene, &self.object, "cpu", "none", "2012-03-04T00:00:00Z").unwrap();
        if lowest {
            sweep.find_lowest(&model).unwrap();
        }
        sweep.measure_error(&model, &self.scene.haptics, Some(40)).unwrap();
        work(&sweep, &model)
    }

    fn run(&self, lowest: bool, threads: usize, chunk: usize) -> (Dataset, SweepReport) {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        self.with(lowest, |sweep, model| {
            let run = || {
                let run = Run { chunk, stop: &AtomicBool::new(false), progress: &mut |_| () };
                sweep.run(&mut CpuBackend::new(model, threads).unwrap(), run).unwrap()
            };
            pool.install(run)
        })
    }

    /// Bakes into a file, stopping after the last point where `stops`.
    fn bake(&self, output: &Path, chunk: usize, resume: bool, stops: bool) -> Result<SweepReport, Error> {
        self.with(true, |sweep, model| {
            let stop = AtomicBool::new(false);
            let mut progress = |progress: haptize::sweep::Progress| {
                stop.store(stops && progress.done == progress.points, Ordering::Relaxed);
            };
            let run = Run { chunk, stop: &stop, progress: &mut progress };
            sweep.bake(&mut CpuBackend::new(model, 2).unwrap(), output, resume, run)
        })
    }
}

/// Excess of the energy over what the trapezoidal rule predicts between neighbours, along all edges in contact (J).
fn mismatches(dataset: &Dataset) -> Vec<f64> {
    let (grid, energy) = (&dataset.grid, dataset.energy.as_ref().unwrap());
    let mut found = Vec::new();
    let mut pitch = 1;
    for (a, axis) in grid.axes.iter().enumerate().rev() {
        for point in 0..grid.points() {
            let next = point + pitch;
            let is_last = point / pitch % axis.count + 1 == axis.count;
            if is_last || [point, next].iter().any(|&p| dataset.status(p) != Status::Contact) {
                continue;
            }
            let mean = 0.5 * (dataset.torque(point)[a] + dataset.torque(next)[a]);
            found.push((energy[next] - energy[point] + mean * axis.step).abs());
        }
        pitch *= axis.count;
    }
    found
}

#[test]
fn energies_fall_and_fit_together_better() {
    let world = World::new();
    let ((rest, from_rest), (lowest, report)) = (world.run(false, 2, 100), world.run(true, 2, 100));
    assert_eq!(from_rest.lowered, None);
    let Lowered { points, converged, greatest, rounds, searches, .. } = report.lowered.unwrap();
    let energies = |dataset: &Dataset| dataset.energy.as_ref().unwrap().to_vec();
    let (before, after) = (energies(&rest), energies(&lowest));
    let mut changed = 0;
    for point in 0..before.len() {
        let same = before[point] == after[point] && rest.torque(point) == lowest.torque(point);
        changed += usize::from(!same);
        if rest.status(point) == Status::Contact {
            assert!(same || after[point] < before[point] * (1.0 - 1e-10), "point {point}");
            assert_eq!(lowest.status(point), Status::Contact);
        }
    }
    assert!(changed == points && points > 10 && converged <= points, "{report:?}");
    assert!(greatest > 1e-3 && rounds > 1 && searches >= points, "{report:?}");
    let sum = |dataset: &Dataset| mismatches(dataset).iter().sum::<f64>();
    let worst = |dataset: &Dataset| mismatches(dataset).into_iter().fold(0.0, f64::max);
    println!("{report:?}; sums {} {}, worst {} {}", sum(&rest), sum(&lowest), worst(&rest), worst(&lowest));
    assert!(sum(&lowest) < sum(&rest) && worst(&lowest) < worst(&rest));
}

#[test]
fn the_lowest_equilibrium_depends_on_the_grid_alone() {
    let world = World::new();
    let folder = Folder::new();
    let saved = |dataset: &Dataset| {
        dataset.save(&folder.output()).unwrap();
        std::fs::read(folder.output()).unwrap()
    };
    let (dataset, report) = world.run(true, 1, 7);
    let whole = saved(&dataset);
    assert!(whole != saved(&world.run(false, 1, 7).0), "the comparison sees the correction");
    let error = dataset.provenance.error.as_ref().unwrap();
    assert_eq!((error.configurations + error.left_out, report.error.as_ref()), (40, Some(error)));
    assert!(
        error.errors.iter().all(|error| error.median <= error.rms && error.rms <= error.worst && error.worst > 0.0)
    );
    assert!(saved(&world.run(true, 2, 1000).0) == whole);
    for chunk in [1, 1000] {
        std::fs::remove_file(folder.output()).unwrap();
        let baked = world.bake(&folder.output(), chunk, false, false).unwrap();
        assert_eq!((baked.iterations, baked.max_residual), (report.iterations, report.max_residual));
        assert!(std::fs::read(folder.output()).unwrap() == whole, "chunk {chunk}");
    }
    // Stopped once all points are solved, before the correction.
    std::fs::remove_file(folder.output()).unwrap();
    let stopped = world.bake(&folder.output(), 50, false, true).unwrap_err();
    assert!(stopped.to_string().contains("they are kept in"), "{stopped}");
    assert_eq!(folder.names(), ["a.haptize.part"]);
    world.bake(&folder.output(), 50, true, false).unwrap();
    assert!(std::fs::read(folder.output()).unwrap() == whole);
    assert_eq!(folder.names(), ["a.haptize"]);
}
