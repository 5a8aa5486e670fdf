//! Stores filled by the solver: exact at nodes, within their aim where nothing was solved, with fewer nodes than a
//! uniform grid.

use haptize::{
    JointVector,
    contact::{Model, Status},
    dataset::{Axis, Grid},
    proxy::Chain,
    scene::Scene,
    store::{Order, record::width},
    sweep::{
        build_object,
        refine::{Judge, Refine, Refined},
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

/// A base of `cells` cells along each axis, filled to `aim`, and its error at configurations that it has not seen.
fn fill(cells: usize, levels: u32, order: Order, aim: f64) -> Filled {
    let scene = Scene::parse(SCENE, "refine.toml").unwrap();
    let object = build_object(&scene).unwrap();
    let chain = Chain::new(&scene.proxy);
    let mut model = Model::new(&object, &chain, scene.contact);
    model.with_tangent = true;
    let axes = scene.proxy.joints.iter().zip(&scene.grid.axes).map(|(joint, axis)| {
        let range = axis.step * (axis.count - 1) as f64;
        Axis {
            name: joint.name.clone(),
            unit: "rad".into(),
            start: axis.start,
            step: range / cells as f64,
            count: cells + 1,
        }
    });
    let base = Grid { axes: axes.collect() };
    let [seen, unseen] = [1, 2].map(|seed| Judge::new(&scene, &model, seed, 100).unwrap());
    let refined = Refine { model: &model, base, levels, order, aim, most: 20_000 }.fill(&seen).unwrap();
    let unseen = unseen.relative_error(|q| refined.store.sample(q).torque());
    Filled { refined, unseen }
}

#[test]
fn a_store_keeps_its_aim_where_nothing_was_solved_with_a_fraction_of_a_uniform_grids_nodes() {
    for (order, aim) in [(Order::Potential, 0.045), (Order::Linear, 0.10)] {
        let Filled { refined, unseen } = fill(4, 4, order, aim);
        // Rms errors of a hundred configurations differ by a fifth or so.
        assert!(refined.measured <= aim && unseen < 1.4 * aim, "{order:?}: {} and {unseen}", refined.measured);
        // The coarsest uniform grid, by doubling, that is as good.
        let uniform = [4, 8, 16].map(|cells| fill(cells, 1, order, f64::INFINITY));
        let as_good = uniform.iter().find(|uniform| uniform.refined.measured <= aim);
        let nodes = as_good.map_or(33_usize.pow(3), |uniform| uniform.refined.nodes);
        assert!(2 * refined.nodes < nodes, "{order:?}: {} of {nodes} nodes", refined.nodes);
        assert!(uniform[0].refined.measured > aim, "{order:?}: the base alone is good enough");
    }
}

#[test]
fn nodes_hold_what_the_solver_found_and_two_fillings_are_the_same() {
    let [one, other] = [(); 2].map(|()| fill(4, 3, Order::Potential, 0.05).refined);
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
fn the_torque_begins_at_the_boundary_without_a_jump() {
    let store = fill(4, 2, Order::Potential, 0.05).refined.store;
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
