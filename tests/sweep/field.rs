//! Interpolation of the contact torque, against configurations that were solved and not stored: error, order, energy.

use crate::work::Work;
use haptize::{
    JointVector,
    contact::{Model, Solver, Status},
    dataset::{Axis, Dataset, Grid},
    field::TorqueField,
    fixtures::{Random, grids::grid},
    object::Object,
    proxy::Chain,
    scene::{Interpolation, Scene},
    sweep,
};
use std::path::Path;

fn vector(values: &[f64]) -> JointVector {
    JointVector::from_slice(values)
}

/// A configuration inside `grid`.
fn inside(random: &mut Random, grid: &Grid) -> JointVector {
    let mut at = |axis: &Axis| axis.start + random.between(0.0, axis.step * (axis.count - 1) as f64);
    vector(&grid.axes.iter().map(&mut at).collect::<Vec<_>>())
}

/// The paper's sphere, its grid `coarser` times as coarse over the same region.
fn sphere(coarser: f64) -> Scene {
    let mut scene = Scene::load(Path::new("tests/scenes/sphere.toml")).unwrap();
    for axis in &mut scene.grid.axes {
        let length = axis.step * (axis.count - 1) as f64;
        let cells = ((axis.count - 1) as f64 / coarser).round();
        (axis.count, axis.step) = (cells as usize + 1, length / cells);
    }
    scene
}

fn baked(scene: &Scene) -> Dataset {
    sweep::baked(scene).unwrap().0
}

fn field(scene: &Scene, data: &Dataset, interpolation: Interpolation) -> TorqueField {
    TorqueField::interpolated(data, interpolation, scene.haptics.threshold, &scene.haptics.boundary_slope).unwrap()
}

/// Root mean square of the error of `field` over `exact` (N m).
fn error(field: &TorqueField, exact: &[(JointVector, JointVector)]) -> f64 {
    let square = |(q, tau): &(JointVector, JointVector)| {
        field.sample(q).torque.iter().zip(tau.iter()).map(|(a, b)| (a - b).powi(2)).sum::<f64>()
    };
    (exact.iter().map(square).sum::<f64>() / exact.len() as f64).sqrt()
}

#[test]
fn potential_does_with_an_eighth_of_the_grid_points_of_linear() {
    let (fine, coarse) = (sphere(1.0), sphere(2.3));
    let (fine_data, coarse_data) = (baked(&fine), baked(&coarse));
    let ratio = fine_data.grid.points() as f64 / coarse_data.grid.points() as f64;
    assert!(ratio >= 8.0, "{ratio}");

    let (object, chain) = (Object::build(&fine.object).unwrap(), Chain::new(&fine.proxy));
    let model = Model::new(&object, &chain, fine.contact);
    let mut solver = Solver::new(&model);
    let mut random = Random::new(1);
    let exact: Vec<_> = (0..3000)
        .map(|_| inside(&mut random, &fine_data.grid))
        .map(|q| (q, solver.solve(&q)))
        .inspect(|(q, equilibrium)| assert_ne!(equilibrium.status, Status::Unconverged, "{q:?}"))
        .map(|(q, equilibrium)| (q, equilibrium.torque))
        .collect();
    let linear = error(&field(&fine, &fine_data, Interpolation::Linear), &exact);
    let potential = error(&field(&coarse, &coarse_data, Interpolation::Potential), &exact);
    assert!(potential <= linear, "potential {potential} N m with {ratio} times fewer points than linear's {linear}");
    // On the same grid, too.
    let same = error(&field(&fine, &fine_data, Interpolation::Potential), &exact);
    assert!(same < 0.8 * linear, "linear {linear}, potential {same}");
}

#[test]
fn potential_makes_no_energy_around_loops_and_linear_does() {
    let scene = sphere(1.5);
    let data = baked(&scene);
    let greatest = data.energy.as_ref().unwrap().iter().copied().fold(0.0, f64::max);
    let [linear, potential] = [Interpolation::Linear, Interpolation::Potential].map(|i| field(&scene, &data, i));
    let mut random = Random::new(7);
    let (mut worst, mut made) = (0.0_f64, 0.0_f64);
    for _ in 0..20 {
        let path: Vec<JointVector> = (0..4).map(|_| inside(&mut random, &data.grid)).collect();
        worst = worst.max(Work(&potential).around(&path).abs());
        made = made.max(Work(&linear).around(&path).abs());
    }
    assert!(worst < 1e-11 * greatest, "{worst} J of {greatest} J");
    assert!(made > 1e-3 * greatest, "{made} J of {greatest} J");
    // Between any two configurations the work is the difference of the energy.
    for _ in 0..20 {
        let (from, to) = (inside(&mut random, &data.grid), inside(&mut random, &data.grid));
        let difference = potential.sample(&from).energy - potential.sample(&to).energy;
        let work = Work(&potential).along(&from, &to);
        assert!((work - difference).abs() < 1e-11 * greatest, "{work} J for {difference} J");
    }
}

/// A ball of radius 0.5 in three joints that pushes outwards with `U = 2 d^2 (1 + d)`, d the depth.
fn ball(count: usize) -> Dataset {
    let grid = grid(&[(-0.61, 1.2 / (count - 1) as f64, count); 3]);
    let depth = |q: &[f64]| 0.5 - q.iter().map(|x| x * x).sum::<f64>().sqrt();
    Dataset::of_field(grid, |q| {
        let energy = 2.0 * depth(q).max(0.0).powi(2) * (1.0 + depth(q));
        (push(q), energy, if depth(q) > 0.0 { Status::Contact } else { Status::Free })
    })
}

fn push(q: &[f64]) -> JointVector {
    let radius = q.iter().map(|x| x * x).sum::<f64>().sqrt();
    let depth = (0.5 - radius).max(0.0);
    vector(&q.iter().map(|x| x / radius.max(1e-9) * (4.0 * depth + 6.0 * depth * depth)).collect::<Vec<_>>())
}

#[test]
fn error_falls_with_the_order_of_each_interpolation_where_the_field_is_smooth() {
    // Through the boundary of the object, away from its centre, where depth has no gradient.
    let mut random = Random::new(3);
    let grid = ball(13).grid;
    let shell = |q: &JointVector| (0.2..0.6).contains(&q.norm());
    let exact: Vec<_> = (0..8000).map(|_| inside(&mut random, &grid)).filter(shell).map(|q| (q, push(&q))).collect();
    let slopes = vector(&[1e6; 3]);
    let order = |interpolation: Interpolation| {
        let at = |count| error(&TorqueField::interpolated(&ball(count), interpolation, 0.5, &slopes).unwrap(), &exact);
        (at(21) / at(41)).log2()
    };
    let [linear, potential] = Interpolation::ALL.map(order);
    assert!((1.2..1.8).contains(&linear), "the kink at the boundary leaves 1.5: {linear}");
    assert!((2.4..3.3).contains(&potential), "{potential}");
}
