//! The lowest equilibrium in stores that are filled for an error, where contact has several.

use super::world::World;
use haptize::{
    contact::Status,
    dataset::Dataset,
    store::Store,
    sweep::{
        CpuBackend, Reference, Run, Sweep, grid_of,
        refine::{Refine, Refined},
    },
};
use std::sync::atomic::AtomicBool;

/// Contact with several equilibria.
const SCENE: &str = include_str!("../../scenes/deep_points.toml");

/// Rms error that a store of the lowest equilibria keeps, over the rms force (1): where two branches cross the lowest
/// energy has a kink, at which the force of a cell errs by its jump. Those cells are few: 3.5 % were measured. With
/// equilibria of different branches side by side the error was 141 %.
const KEPT: f64 = 0.1;

impl World {
    /// Both levels of a store, whole, filled on so many threads.
    fn fill_whole(&self, threads: usize, batch: usize) -> Refined {
        let (model, base) = (self.model(), grid_of(&self.scene));
        let mut judges = [1, 2].map(|seed| Reference::in_contact(&self.scene, &model, seed, 100).unwrap());
        let (aim, most) = (f64::MIN_POSITIVE, usize::MAX);
        let refine = Refine { model: &model, base, levels: 2, aim, most, batch };
        let mut backend = CpuBackend::new(&model, threads).unwrap();
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| refine.fill(&mut judges, &mut backend).unwrap())
    }

    /// The lowest equilibria of a uniform grid of half the spacing, none of whose points is a node of the store.
    fn lowest(&self) -> Dataset {
        let mut scene = self.scene.clone();
        for axis in &mut scene.grid.axes {
            axis.step *= 0.5;
            axis.start += 0.37 * axis.step;
            axis.count = 2 * axis.count - 2;
        }
        let model = self.model();
        let mut sweep = Sweep::new(&scene, &self.object, "cpu", "none", "2012-03-04T00:00:00Z").unwrap();
        sweep.find_lowest(&model).unwrap();
        let run = Run { chunk: 1000, stop: &AtomicBool::new(false), progress: &mut |_| () };
        sweep.run(&mut CpuBackend::new(&model, 0).unwrap(), run).unwrap().0
    }
}

/// Rms error of the force of `store` at the points of `exact` in contact, over the rms force (1).
fn error(store: &Store, exact: &Dataset) -> f64 {
    let (mut missed, mut whole) = (0.0, 0.0);
    for point in (0..exact.grid.points()).filter(|&point| exact.status(point) == Status::Contact) {
        let found = store.sample(&exact.grid.configuration(point)).torque();
        let force = exact.torque(point);
        missed += found.iter().zip(force).map(|(a, b)| (a - b).powi(2)).sum::<f64>();
        whole += force.iter().map(|force| force.powi(2)).sum::<f64>();
    }
    (missed / whole).sqrt()
}

#[test]
fn a_store_of_the_lowest_equilibria_keeps_its_error_where_there_are_several() {
    let world = World::of(SCENE);
    let (filled, exact) = (world.fill_whole(2, 100), world.lowest());
    let (kept, lowered) = (error(&filled.store, &exact), filled.lowered.unwrap());
    println!("{kept}; {lowered:?}, of {} nodes", filled.nodes);
    assert!(kept < KEPT, "{kept}");
    // What was measured while it was filled says the same, of equilibria that were lowered, too.
    assert!(filled.measured < KEPT, "{}", filled.measured);
    assert!(lowered.points > 100 && lowered.searches >= lowered.points, "{lowered:?}");
    assert!(lowered.greatest > 0.01 && lowered.rounds > 3, "{lowered:?}");
}

#[test]
fn the_lowest_equilibria_of_a_store_depend_on_neither_threads_nor_batches() {
    let world = World::of(SCENE);
    let [one, other] = [(1, 7), (3, 1000)].map(|(threads, batch)| world.fill_whole(threads, batch));
    assert_eq!(one.store.blocks().len(), other.store.blocks().len());
    for ((key, block), (other_key, other)) in one.store.blocks().into_iter().zip(other.store.blocks()) {
        assert_eq!((key, block.nodes()), (other_key, other.nodes()));
    }
    assert_eq!((one.measured, one.rounds), (other.measured, other.rounds));
}
