//! Continuity at every border of blocks and levels, exactness at nodes and on polynomials, the gradient.

use super::fixture::{blocks, nodes, noise, slip, space, step, store};
use haptize::{
    JointVector, MAX_AXES,
    dataset::{Axis, Dataset, Grid, Provenance},
    field::TorqueField,
    fixtures::Random,
    scene::Interpolation,
    store::{
        Root, Space, Store,
        record::{mixed, slope, width},
    },
};
use std::sync::Arc;

/// Levels of the stores: fewer where a level has more blocks.
fn levels(joints: usize) -> u32 {
    [0, 5, 4, 3, 3, 2, 2][joints]
}

/// Rounding of sums of f32 numbers of order one, relative (1): a few hundred of them.
const ROUNDING: f64 = 1e-5;

/// Greatest of the numbers that say how contacts slip, more or less (1).
const MOST_SLIP: f64 = 3.0;

/// Distance from a border at which both sides are looked at, in steps of the base.
const BESIDE: f64 = 1e-9;

/// Greatest jump of value and slopes (by steps of the base) of `sample` across random points of the planes between
/// cells of the finest level.
fn greatest_jump(store: &Store, joints: usize, mut sample: impl FnMut(&[f64]) -> Root) -> [f64; 2] {
    let mut random = Random::new(7);
    let finest = store.space().levels() - 1;
    let mut jump = [0.0_f64; 2];
    for axis in 0..joints {
        for line in 1..store.space().last(finest)[axis] {
            for _ in 0..60 {
                let mut node = [0; MAX_AXES];
                let mut q = store.space().configuration(finest, &node);
                for a in 0..joints {
                    let cells = store.space().last(0)[a];
                    q[a] += 0.5 * (random.between(-1.0, 1.0) + 1.0) * f64::from(cells) * step(a);
                }
                node[axis] = line;
                let at = store.space().configuration(finest, &node)[axis];
                let [before, after] = [-1.0, 1.0].map(|side| {
                    q[axis] = at + side * BESIDE * step(axis);
                    sample(&q)
                });
                jump[0] = jump[0].max((after.value - before.value).abs());
                for a in 0..joints {
                    jump[1] = jump[1].max((after.slopes[a] - before.slopes[a]).abs() * step(a));
                }
            }
        }
    }
    jump
}

#[test]
fn it_is_smooth_at_every_border_of_blocks_and_levels() {
    for joints in 1..=MAX_AXES {
        for seed in 0..3 {
            let store = store(joints, levels(joints), 0.6, seed, noise(joints, 99 + seed));
            let [value, slope] = greatest_jump(&store, joints, |q| store.sample(q));
            // Both sides are 2 BESIDE apart: of functions of order one, whose slopes are hardly over a hundred a
            // step.
            assert!(value < ROUNDING, "{joints} joints, seed {seed}: value jumps by {value}");
            assert!(slope < 10.0 * ROUNDING, "{joints} joints, seed {seed}: slopes jump by {slope}");
        }
    }
}

#[test]
fn the_comparison_sees_a_step_between_cells() {
    // A reader whose value changes from cell to cell of the finest level.
    for joints in 1..=MAX_AXES {
        let store = store(joints, levels(joints), 0.6, 0, noise(joints, 99));
        let finest = store.space().levels() - 1;
        let [value, _] = greatest_jump(&store, joints, |q| {
            let mut root = store.sample(q);
            let cell = (0..joints).map(|a| ((q[a] + 0.2) / store.space().step(finest, a)) as u32).sum::<u32>();
            root.value += 1e-3 * f64::from(cell & 1);
            root
        });
        assert!(value > 100.0 * ROUNDING, "{joints} joints: {value}");
    }
}

#[test]
fn the_slopes_are_the_gradient_and_so_the_field_has_no_curl() {
    let differs = |joints: usize, seed: u64| {
        let [store, other] = [3, seed].map(|seed| store(joints, levels(joints), 0.6, 5, noise(joints, seed)));
        let mut random = Random::new(11);
        let mut greatest = 0.0_f64;
        for _ in 0..200 {
            let q: Vec<f64> = (0..joints).map(|a| -0.2 + (1.0 + 0.9 * random.between(-1.0, 1.0)) * step(a)).collect();
            let here = other.sample(&q);
            for a in 0..joints {
                let [before, after] = [-1e-4, 1e-4].map(|h| {
                    let mut q = q.clone();
                    q[a] += h * step(a);
                    store.sample(&q).value
                });
                greatest = greatest.max(((after - before) / 2e-4 - here.slopes[a] * step(a)).abs());
            }
        }
        greatest
    };
    for joints in 1..=MAX_AXES {
        // Third derivatives of order 10^3, and kinks of the curvature, by steps of 1e-4.
        let potential = differs(joints, 3);
        assert!(potential < 2e-2, "{joints} joints: {potential}");
        // A value and a gradient that do not belong together: the comparison can fail.
        assert!(differs(joints, 4) > 0.2, "{joints} joints");
    }
}

#[test]
fn every_node_is_met_by_value_slopes_and_mixed_derivatives() {
    for joints in 1..=MAX_AXES {
        let store = store(joints, levels(joints), 0.6, 21, noise(joints, 4));
        let space = store.space();
        let mut seen = 0;
        for (key, block) in store.blocks() {
            let (level, place) = space.block(key).unwrap();
            let records = block.nodes().records.chunks_exact(width(joints));
            for (at, record) in block.nodes().places().zip(records) {
                let node = space.nodes(level, &place).find(|(p, _)| *p == at).unwrap().1;
                let q = space.configuration(level, &node);
                let root = store.sample(&q);
                assert!((root.value - f64::from(record[0])).abs() < ROUNDING, "{joints} {level}");
                for a in 0..joints {
                    let error = (root.slopes[a] - f64::from(record[slope(a)])).abs() * step(a);
                    assert!(error < 10.0 * ROUNDING, "{joints} {level} {a}: {error}");
                }
                seen += 1;
            }
        }
        assert!(seen > 10);
    }
}

/// Value, slopes and mixed derivatives of a polynomial: products of two different coordinates at most, each to the
/// third power at most where `cubic`.
fn polynomial(q: &[f64], cubic: bool) -> Vec<f64> {
    let joints = q.len();
    let f = |x: f64| if cubic { x + 2.0 * x * x - 3.0 * x * x * x } else { x };
    let g = |x: f64| if cubic { 1.0 + 4.0 * x - 9.0 * x * x } else { 1.0 };
    let mut record = vec![0.0; width(joints)];
    record[0] = 0.5;
    for a in 0..joints {
        record[0] += (a + 1) as f64 * f(q[a]);
        record[slope(a)] += (a + 1) as f64 * g(q[a]);
        for b in 0..a {
            if cubic {
                record[0] += f(q[a]) * f(q[b]);
                record[slope(a)] += g(q[a]) * f(q[b]);
                record[slope(b)] += f(q[a]) * g(q[b]);
                record[mixed(a, b)] += g(q[a]) * g(q[b]);
            }
        }
    }
    record
}

#[test]
fn polynomials_are_met_everywhere_whatever_nodes_there_are() {
    for joints in 1..=MAX_AXES {
        let store = store(joints, levels(joints), 0.5, 8, |q| polynomial(q, true));
        let mut random = Random::new(2);
        for _ in 0..200 {
            let q: Vec<f64> = (0..joints).map(|a| -0.2 + (1.0 + 0.99 * random.between(-1.0, 1.0)) * step(a)).collect();
            let (root, exact) = (store.sample(&q), polynomial(&q, true));
            assert!((root.value - exact[0]).abs() < 10.0 * ROUNDING, "{joints}");
            for a in 0..joints {
                assert!((root.slopes[a] - exact[slope(a)]).abs() < 100.0 * ROUNDING, "{joints} {a}");
            }
        }
        // Other polynomials are not met.
        let other = polynomial(&vec![0.05; joints], false);
        assert!((store.sample(&vec![0.05; joints]).value - other[0]).abs() > 1e-3);
    }
}

#[test]
fn slips_that_are_affine_are_met_everywhere_whatever_nodes_there_are() {
    for joints in 1..=MAX_AXES {
        let store = store(joints, levels(joints), 0.5, 8, noise(joints, 3));
        assert!(store.has_slips());
        let mut random = Random::new(2);
        for _ in 0..200 {
            let q: Vec<f64> = (0..joints).map(|a| -0.2 + (1.0 + 0.99 * random.between(-1.0, 1.0)) * step(a)).collect();
            let found = store.slip(&q);
            for (found, exact) in found.iter().zip(slip(&q)) {
                // They are kept to eight bits, and mixed with weights that sum to one.
                assert!((found - exact).abs() < MOST_SLIP / 512.0 + ROUNDING, "{joints}: {found} for {exact}");
            }
            assert!(found[width(joints)..].iter().all(|rest| *rest == 0.0));
        }
        // Another one is not met.
        assert!((store.slip(&vec![0.05; joints])[0] - slip(&vec![0.1; joints])[0]).abs() > MOST_SLIP / 256.0);
    }
}

#[test]
fn a_wrong_mixed_derivative_is_seen_between_the_nodes() {
    let joints = 3;
    let wrong = |q: &[f64]| {
        let mut record = polynomial(q, true);
        record[mixed(1, 0)] *= 3.0;
        record
    };
    let right = store(joints, 1, 0.5, 8, |q| polynomial(q, true));
    let wrong = store(joints, 1, 0.5, 8, wrong);
    let q: Vec<f64> = (0..joints).map(|a| -0.2 + 2.25 * step(a)).collect();
    assert!((right.sample(&q).value - wrong.sample(&q).value).abs() > 10.0 * ROUNDING);
}

#[test]
fn beyond_the_grid_and_what_is_no_number_is_answered_at_the_border() {
    let store = store(3, 3, 0.6, 1, noise(3, 1));
    let corner = store.sample(&store.space().configuration(0, &store.space().last(0)));
    assert_eq!(store.sample(&[9.0, 1e300, f64::INFINITY]), corner);
    let first = store.sample(&store.space().configuration(0, &[0; MAX_AXES]));
    assert_eq!(store.sample(&[f64::NAN, -9.0, f64::NEG_INFINITY]), first);
    let empty = Store::new(space(3, 2));
    let root = empty.sample(&[0.0; 3]);
    assert!(root.value == 0.0 && root.absent);
    assert_eq!(blocks(&space(3, 2), 0).len(), 8);
}

/// Frobenius norm of d tau/d q at `q` by differences over a step so small that both ends lie in one cell of the finest
/// level, over the stiffness of slopes of one.
fn steepness(store: &Store, q: &[f64]) -> f64 {
    let mut sum = 0.0;
    for b in 0..q.len() {
        let [before, after] = [-1e-6, 1e-6].map(|step| {
            let mut at = q.to_vec();
            at[b] += step;
            store.sample(&at).torque()
        });
        sum += before.iter().zip(after.iter()).map(|(a, b)| ((b - a) / 2e-6).powi(2)).sum::<f64>();
    }
    sum.sqrt()
}

#[test]
fn the_torque_is_nowhere_steeper_than_the_bound_on_which_gains_rest() {
    for (joints, samples) in [(1, 20_000), (2, 20_000), (3, 20_000), (4, 3000)] {
        for seed in 0..3 {
            let store = Arc::new(store(joints, levels(joints).min(3), 0.6, seed, noise(joints, 31 + seed)));
            let count = store.space().last(0)[0] as usize + 1;
            let axis =
                |a: usize| Axis { name: format!("joint {a}"), unit: "rad".into(), start: -0.2, step: step(a), count };
            let grid = Grid { axes: (0..joints).map(axis).collect() };
            let text = "name = \"steep\"".into();
            let data = Dataset::refined(Arc::clone(&store), grid, None, text, Provenance::default());
            let ones = JointVector::from_slice(&vec![1.0; joints]);
            let field = TorqueField::interpolated(&data, Interpolation::Potential, 0.5, &ones).unwrap();
            let bound = field.relative_stiffness(&ones);
            let mut random = Random::new(5);
            let mut steepest = 0.0_f64;
            for _ in 0..samples {
                let place = |a: usize| -0.2 + step(a) * (count - 1) as f64 * (0.5 + 0.4999 * random.between(-1.0, 1.0));
                steepest = steepest.max(steepness(&store, &(0..joints).map(place).collect::<Vec<_>>()));
            }
            assert!(steepest <= bound * (1.0 + 1e-5), "{joints} joints: {steepest} beyond {bound}");
            // The bound is of use: looser with each joint; of four, these places do not find the steepest.
            let looser = 2.0 * f64::from(1 << joints);
            assert!(joints > 3 || bound < looser * steepest, "{joints}: {steepest}, {bound}");
        }
    }
}

/// A store of one level whose nodes are all there, `count` along each axis.
fn whole(joints: usize, count: usize, mut record: impl FnMut(&[f64]) -> Vec<f64>) -> (Store, Grid) {
    let axis = |a: usize| Axis { name: format!("joint {a}"), unit: "rad".into(), start: 0.0, step: 0.1, count };
    let grid = Grid { axes: (0..joints).map(axis).collect() };
    let space = Space::new(&grid, 1).unwrap();
    let places = blocks(&space, 0);
    let mut store = Store::new(space);
    for place in places {
        store.publish(0, &place, nodes(store.space(), 0, &place, |_| true, &mut record)).unwrap();
    }
    (store, grid)
}

#[test]
fn one_steep_cell_among_thousands_is_bounded() {
    // A constant, with a bend at one node: whichever cells a choice would leave out, it leaves out one of these.
    for (joints, count, places) in [(3, 24, 200), (6, 4, 8)] {
        let mut random = Random::new(3);
        for _ in 0..places {
            let bent: Vec<f64> =
                (0..joints).map(|_| (0.5 * (random.between(-1.0, 1.0) + 1.0) * count as f64).floor() * 0.1).collect();
            let (store, grid) = whole(joints, count, |q| {
                let mut record = vec![0.0; width(joints)];
                let is_bent = q.iter().zip(&bent).all(|(q, bent)| (q - bent).abs() < 0.05);
                record[0] = if is_bent { 2.0 } else { 1.0 };
                record
            });
            let data = Dataset::refined(Arc::new(store), grid, None, "name = \"bent\"".into(), Provenance::default());
            let ones = JointVector::from_slice(&vec![1.0; joints]);
            let field = TorqueField::interpolated(&data, Interpolation::Potential, 0.5, &ones).unwrap();
            let bound = field.relative_stiffness(&ones);
            let store = data.refinement.as_ref().unwrap();
            // A little inside, in each cell around the node.
            let steepest = (0..1_usize << joints).map(|side| {
                let beside = |(a, bent): (usize, &f64)| bent + if side >> a & 1 == 1 { 1e-3 } else { -1e-3 };
                steepness(store, &bent.iter().enumerate().map(beside).collect::<Vec<_>>())
            });
            let steepest = steepest.fold(0.0, f64::max);
            assert!(steepest > 100.0 && steepest <= bound, "{joints} joints, {bent:?}: {steepest} beyond {bound}");
        }
    }
}

#[test]
fn where_nothing_bends_the_bound_is_below_what_a_bend_has() {
    // What the comparison above would see of a bound that left out the cells around the bend.
    for (joints, count) in [(3, 24), (6, 4)] {
        let (store, grid) = whole(joints, count, |_| {
            let mut record = vec![0.0; width(joints)];
            record[0] = 1.0;
            record
        });
        let data = Dataset::refined(Arc::new(store), grid, None, "name = \"flat\"".into(), Provenance::default());
        let ones = JointVector::from_slice(&vec![1.0; joints]);
        let field = TorqueField::interpolated(&data, Interpolation::Potential, 0.5, &ones).unwrap();
        assert!(field.relative_stiffness(&ones) < 100.0);
    }
}
