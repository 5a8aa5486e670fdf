//! Stores filled by the solver: exact at nodes, within their aim where nothing was solved, with fewer nodes than a
//! uniform grid.

use super::world::World;
use haptize::{
    JointVector,
    contact::{Equilibrium, Status},
    dataset::{Axis, Grid},
    store::record::width,
    sweep::{
        Backend, CpuBackend, Reference, WithFallback,
        refine::{Refine, Refined},
    },
};

/// A ball of 6 mm on two joints and a slide, pressed some 8 mm into a sphere with a skin: so deep it has one
/// equilibrium. No node lies on a plane of symmetry.
const SCENE: &str = r#"
    [object]
    sphere = { radius = 0.05, subdivisions = 3 }
    skin = { tension = 260.0, width = 0.0175, foundation = 1.6e5 }
    [contact]
    surface = "facets"
    stiffness = 3000.0
    [grid]
    axes = [{ start = -0.41, stop = 0.39, count = 9 }, { start = -0.38, stop = 0.42, count = 9 },
        { start = 0.006, stop = 0.022, count = 9 }]
    [[proxy.joint]]
    kind = "revolute"
    axis = [0.0, 1.0, 0.0]
    origin = [0.0, 0.0, 0.14]
    limits = [-4.0, 4.0]
    [[proxy.joint]]
    kind = "revolute"
    axis = [1.0, 0.0, 0.0]
    limits = [-4.0, 4.0]
    [[proxy.joint]]
    kind = "prismatic"
    axis = [0.0, 0.0, -1.0]
    limits = [-0.1, 0.1]
    nodes = [{ at = [0.0, 0.0, -0.076] }]
"#;

struct Filled {
    refined: Refined,
    unseen: f64,
}

impl World {
    /// `cells` cells along each axis.
    fn base(&self, cells: usize) -> Grid {
        let axes = self.scene.proxy.joints.iter().zip(&self.scene.grid.axes).map(|(joint, axis)| {
            let step = axis.step * (axis.count - 1) as f64 / cells as f64;
            Axis { name: joint.name.clone(), unit: "rad".into(), start: axis.start, step, count: cells + 1 }
        });
        Grid { axes: axes.collect() }
    }

    /// A base of `cells` cells along each axis, filled to `aim` by `backend`, `batch` configurations at a time, and its
    /// error at configurations that it has not seen.
    fn fill<B: Backend>(&self, (cells, levels, batch): (usize, u32, usize), aim: f64, backend: &mut B) -> Filled {
        let model = self.model();
        let mut judges = [1, 2].map(|seed| Reference::in_contact(&self.scene, &model, seed, 100).unwrap());
        let refine = Refine { model: &model, base: self.base(cells), levels, aim, most: 20_000, batch };
        let refined = refine.fill(&mut judges, backend).unwrap();
        let unseen = judges[1].relative_error(|q| refined.store.sample(q).torque());
        Filled { refined, unseen }
    }
}

/// The same on the CPU.
fn fill(cells: usize, levels: u32, aim: f64) -> Filled {
    let world = World::of(SCENE);
    world.fill((cells, levels, 100), aim, &mut CpuBackend::new(&world.model(), 0).unwrap())
}

#[test]
fn a_store_keeps_its_aim_where_nothing_was_solved_with_a_fraction_of_a_uniform_grids_nodes() {
    let aim = 0.045;
    let Filled { refined, unseen } = fill(4, 4, aim);
    // Rms errors of a hundred configurations differ by a fifth or so.
    assert!(refined.measured <= aim && unseen < 1.4 * aim, "{} and {unseen}", refined.measured);
    // The coarsest uniform grid, by doubling, that is as good.
    let uniform = [4, 8, 16].map(|cells| fill(cells, 1, f64::INFINITY));
    let as_good = uniform.iter().find(|uniform| uniform.refined.measured <= aim);
    let nodes = as_good.map_or(33_usize.pow(3), |uniform| uniform.refined.nodes);
    assert!(2 * refined.nodes < nodes, "{} of {nodes} nodes", refined.nodes);
    assert!(uniform[0].refined.measured > aim, "the base alone is good enough");
}

#[test]
fn nodes_hold_what_the_solver_found_and_two_fillings_are_the_same() {
    let [one, other] = [(); 2].map(|()| fill(4, 3, 0.05).refined);
    let space = one.store.space();
    let mut seen = [0, 0];
    for ((key, block), (other_key, other)) in one.store.blocks().into_iter().zip(other.store.blocks()) {
        assert_eq!((key, block.nodes()), (other_key, other.nodes()));
        let (level, place) = space.block(key).unwrap();
        let nodes = block.nodes();
        for ((at, record), &status) in nodes.places().zip(nodes.records.chunks_exact(width(3))).zip(&nodes.status) {
            let node = space.nodes(level, &place).find(|(p, _)| *p == at).unwrap().1;
            let sample = one.store.sample(&space.configuration(level, &node));
            let free = status == Status::Free as u8;
            seen[usize::from(free)] += 1;
            let energy = 0.5 * f64::from(record[0]).max(0.0).powi(2);
            assert!((sample.energy() - energy).abs() < 1e-6, "{} for {energy}", sample.energy());
            if free {
                assert!(record[0] <= 0.0);
                assert!(sample.torque().iter().all(|tau| tau.abs() < 1e-5), "{:?}", sample.torque());
            }
        }
    }
    assert!(seen.iter().all(|count| *count > 10), "{seen:?}");
    assert_eq!(one.store.blocks().len(), other.store.blocks().len());
}

#[test]
fn nodes_that_are_solved_together_are_those_solved_one_by_one_to_the_bit() {
    let world = World::of(SCENE);
    let model = world.model();
    let fill = |batch| world.fill((6, 1, batch), 1.0, &mut CpuBackend::new(&model, 2).unwrap()).refined;
    let alone = fill(1);
    // Free nodes near contact take an equilibrium of their own.
    assert!(alone.nodes == 7 * 7 * 7 && alone.equilibria > 150, "{} of {}", alone.equilibria, alone.nodes);
    for batch in [50, 1000] {
        let together = fill(batch);
        assert_eq!((together.nodes, together.equilibria), (alone.nodes, alone.equilibria));
        let blocks = alone.store.blocks().into_iter().zip(together.store.blocks());
        blocks.for_each(|(one, other)| assert_eq!((one.0, one.1.nodes()), (other.0, other.1.nodes())));
    }
}

/// A device that solves as the CPU does, until it has solved so many.
struct Breaking<'a>(CpuBackend<'a>, usize);

#[derive(Debug, thiserror::Error)]
#[error("device lost")]
struct DeviceLost;

impl Backend for Breaking<'_> {
    type Error = DeviceLost;
    fn solve(&mut self, configurations: &[JointVector]) -> Result<Vec<Equilibrium>, DeviceLost> {
        self.1 = self.1.checked_sub(configurations.len()).ok_or(DeviceLost)?;
        self.0.solve(configurations).map_err(|never| match never {})
    }
}

#[test]
fn a_store_whose_device_is_lost_is_filled_by_the_cpu_and_says_so() {
    let world = World::of(SCENE);
    let model = world.model();
    let filled = |breaks_after: usize| {
        let device = Breaking(CpuBackend::new(&model, 2).unwrap(), breaks_after);
        let mut backend = WithFallback::new(device, "a made-up device", &model);
        world.fill((4, 2, 10), 0.05, &mut backend).refined
    };
    let (whole, lossy) = (filled(usize::MAX), filled(35));
    assert!(whole.notices.is_empty() && whole.by_level[1] > 0, "{:?}, {:?}", whole.notices, whole.by_level);
    let [notice] = &lossy.notices[..] else { panic!("{:?}", lossy.notices) };
    // The third batch of ten fails: with each some configurations behind the boundary of contact are solved.
    assert!(notice.starts_with("from the store's node 20 on: solved by "), "{notice}");
    assert!(notice.ends_with("since a made-up device failed: device lost"), "{notice}");
    let blocks = whole.store.blocks().into_iter().zip(lossy.store.blocks());
    blocks.for_each(|((key, block), (other_key, other))| assert_eq!((key, block.nodes()), (other_key, other.nodes())));
    let error = {
        let mut device = Breaking(CpuBackend::new(&model, 2).unwrap(), 35);
        let mut judges = [1, 2].map(|seed| Reference::in_contact(&world.scene, &model, seed, 10).unwrap());
        let base = world.base(4);
        let refine = Refine { model: &model, base, levels: 1, aim: 1.0, most: 1000, batch: 10 };
        refine.fill(&mut judges, &mut device).err().unwrap()
    };
    assert_eq!(error.to_string(), "the backend failed: device lost");
}

#[test]
fn the_torque_begins_at_the_boundary_without_a_jump() {
    let store = fill(4, 2, 0.05).refined.store;
    let mut before: Option<JointVector> = None;
    let mut contact = [false; 2];
    for k in 0..4000 {
        let depth = 0.006 + 4e-6 * f64::from(k);
        let root = store.sample(&[0.11, -0.07, depth]);
        contact[usize::from(root.value > 0.0)] = true;
        let torque = root.torque();
        if let Some(before) = before {
            // 3 kN/m over 4 um, with room for the interpolation's overshoot.
            assert!((torque[2] - before[2]).abs() < 0.1, "{depth}: {} after {}", torque[2], before[2]);
        }
        before = Some(torque);
    }
    assert_eq!(contact, [true; 2]);
}
