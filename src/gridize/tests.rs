//! The promises of a gridization: linear fields exactly, SciPy's values, and no arrangement of points that breaks it.

use super::*;
use crate::{dataset::JointLabel, random::mix};

fn label(name: usize) -> JointLabel {
    JointLabel { name: format!("joint {name}"), unit: "rad".to_owned() }
}

/// Samples at `points` with torque `field(q)` on joint 0 and multiples of it on the others.
fn samples(points: &[Vec<f64>], field: impl Fn(&[f64]) -> f64) -> Samples {
    let joints = points[0].len();
    Samples {
        joints: (0..joints).map(label).collect(),
        configurations: points.concat(),
        torques: points
            .iter()
            .flat_map(|q| {
                let tau = field(q);
                (1..=joints).map(move |k| k as f64 * tau)
            })
            .collect(),
        deviations: None,
    }
}

fn uniform(seed: u64) -> f64 {
    (mix(seed) >> 11) as f64 / (1_u64 << 53) as f64
}

fn random_points(count: usize, joints: usize, seed: u64) -> Vec<Vec<f64>> {
    (0..count).map(|i| (0..joints).map(|k| uniform(seed + (i * joints + k) as u64) - 0.4).collect()).collect()
}

fn lattice(side: usize, joints: usize, step: f64) -> Vec<Vec<f64>> {
    (0..side.pow(joints as u32))
        .map(|i| (0..joints).map(|k| (i / side.pow(k as u32) % side) as f64 * step).collect())
        .collect()
}

fn options(step: f64) -> GridizeOptions {
    GridizeOptions { epsilon: Some(0.0), within: f64::INFINITY, ..GridizeOptions::new(vec![step]) }
}

fn linear_field(q: &[f64]) -> f64 {
    q.iter().enumerate().map(|(k, x)| (2.0 - k as f64 * 0.7) * x).sum::<f64>() + 0.25
}

/// Greatest error of joint 0 against `field` over the points inside, and how many are inside.
fn worst(dataset: &Dataset, field: impl Fn(&[f64]) -> f64) -> (f64, usize) {
    let inside = (0..dataset.grid.points()).filter(|&p| dataset.status(p) != Status::Outside);
    inside.fold((0.0, 0), |(worst, count), p| {
        let error = (dataset.torque(p)[0] - field(&dataset.grid.configuration(p))).abs();
        (error.max(worst), count + 1)
    })
}

fn assert_linear(points: &[Vec<f64>], step: f64, all_inside: bool) {
    let (dataset, report) = gridize(&samples(points, linear_field), &options(step)).unwrap();
    let (error, inside) = worst(&dataset, linear_field);
    assert!(error < 1e-12, "linear field off by {error:e}");
    assert!(inside > 0 && inside == report.inside);
    assert!(!all_inside || inside == report.points, "{inside} of {} inside", report.points);
}

#[test]
fn linear_fields_are_reproduced_in_every_number_of_joints() {
    for (joints, count, step) in
        [(1, 20, 0.01), (2, 300, 0.02), (3, 600, 0.04), (4, 300, 0.1), (5, 300, 0.15), (6, 250, 0.24)]
    {
        assert_linear(&random_points(count, joints, 7), step, false);
    }
}

#[test]
fn an_exact_grid_is_reproduced_on_itself_and_between_its_points_hull_included() {
    for (joints, side) in [(1, 12), (2, 12), (3, 8), (4, 4), (5, 3)] {
        let points = lattice(side, joints, 0.1);
        assert_linear(&points, 0.1, true);
        assert_linear(&points, 0.05, true);
        assert_linear(&points, 0.03, true);
    }
}

#[test]
fn a_curved_field_on_an_exact_grid_stays_within_the_values_of_its_cell() {
    let field = |q: &[f64]| (3.0 * q[0]).sin() * (2.0 * q[1]).cos() + q[2] * q[2];
    let (dataset, _) = gridize(&samples(&lattice(6, 3, 0.2), field), &options(0.05)).unwrap();
    for p in 0..dataset.grid.points() {
        let q = dataset.grid.configuration(p);
        let corners = (0..8).map(|corner| {
            let node: Vec<f64> =
                (0..3).map(|k| ((q[k] / 0.2 + 1e-9).floor().min(4.0) + f64::from(corner >> k & 1)) * 0.2).collect();
            field(&node)
        });
        let (low, high) = corners.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (v.min(l), v.max(h)));
        let tau = dataset.torque(p)[0];
        assert!(tau > low - 1e-9 && tau < high + 1e-9, "{q:?}: {tau} not in {low}..{high}");
    }
}

#[test]
fn values_and_hull_are_scipys() {
    let text = include_str!("../../tests/references/gridize_scipy.csv");
    let cases: Vec<&str> = text.split("case,").skip(1).collect();
    assert_eq!(cases.len(), 5);
    for case in cases {
        let mut lines = case.lines();
        let head: Vec<&str> = lines.next().unwrap().split(',').collect();
        let (mut points, mut torques, mut expected) = (Vec::new(), Vec::new(), Vec::new());
        for line in lines {
            let numbers: Vec<f64> = line.split(',').skip(1).map(|x| x.parse().unwrap()).collect();
            if line.starts_with("sample") {
                let (tau, q) = numbers.split_last().unwrap();
                points.push(q.to_vec());
                torques.push(*tau);
            } else {
                expected.push(numbers[0]);
            }
        }
        let mut given = samples(&points, |_| 0.0);
        let joints = points[0].len();
        for (row, tau) in given.torques.chunks_exact_mut(joints).zip(torques) {
            row.iter_mut().enumerate().for_each(|(k, x)| *x = (k + 1) as f64 * tau);
        }
        let (dataset, _) = gridize(&given, &options(head[2].parse().unwrap())).unwrap();
        assert_eq!(dataset.grid.points(), expected.len(), "{head:?}");
        let mut inside = 0;
        for (p, value) in expected.iter().enumerate() {
            let outside = dataset.status(p) == Status::Outside;
            assert_eq!(outside, value.is_nan(), "{head:?} point {p}");
            if !outside {
                inside += 1;
                for (k, tau) in dataset.torque(p).iter().enumerate() {
                    let want = (k + 1) as f64 * value;
                    assert!((tau - want).abs() < 1e-9 * want.abs().max(0.1), "{head:?} point {p}: {tau} {want}");
                }
            }
        }
        assert!(inside > 20, "{head:?} {inside}");
    }
}

#[test]
fn the_search_without_a_triangulation_agrees_with_the_tetrahedra() {
    let points = random_points(500, 3, 99);
    let given = samples(&points, |q| (5.0 * q[0]).sin() + q[1] * q[2]);
    let cloud = Cloud::new(&given).unwrap();
    let grid = grid(&given, &[0.05]).unwrap();
    let (a, a_near) = fill_linear(Tetrahedra::new(&cloud).unwrap(), HULL_PULL, &cloud, &grid);
    let (b, b_near) = fill_linear(Hyperspace::new(&cloud), HULL_PULL, &cloud, &grid);
    assert!(a_near.iter().zip(&b_near).all(|(a, b)| a == b));
    assert!(a_near.iter().filter(|nearest| nearest.is_finite()).count() > 2000);
    let worst = a.iter().zip(&b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    assert!(worst < 1e-9, "{worst:e}");
}

#[test]
fn duplicates_are_averaged_and_near_duplicates_survive() {
    let mut points = random_points(200, 3, 3);
    let copies = points.clone();
    points.extend(copies);
    let mut given = samples(&points, linear_field);
    let half = given.torques.len() / 2;
    given.torques[..half].iter_mut().for_each(|tau| *tau += 0.5);
    given.torques[half..].iter_mut().for_each(|tau| *tau -= 0.5);
    let (dataset, report) = gridize(&given, &options(0.05)).unwrap();
    assert_eq!(report.merged, 200);
    assert!(worst(&dataset, linear_field).0 < 1e-12);
    for distance in [1e-8, 1e-10, 3e-16] {
        for joints in [2, 3, 4] {
            let mut points = random_points(120, joints, 3);
            let near: Vec<Vec<f64>> = points.iter().map(|q| q.iter().map(|x| x + distance).collect()).collect();
            points.extend(near);
            assert_linear(&points, 0.1, false);
        }
    }
}

#[test]
fn points_on_a_sphere_and_on_scan_lines_are_triangulated() {
    let mut sphere = vec![vec![0.0; 3]];
    for i in 0..24 {
        for j in 1..12 {
            let (a, b) = (f64::from(i) * std::f64::consts::TAU / 24.0, f64::from(j) * std::f64::consts::PI / 12.0);
            sphere.push(vec![a.cos() * b.sin(), a.sin() * b.sin(), b.cos()]);
        }
    }
    assert_linear(&sphere, 0.11, false);
    let lines: Vec<Vec<f64>> = (0..5000)
        .map(|i| vec![f64::from(i % 200) * 0.004, f64::from(i / 200 % 5) * 0.2, f64::from(i / 1000) * 0.2])
        .collect();
    assert_linear(&lines, 0.04, true);
}

#[test]
fn flat_clouds_are_refused_with_the_reason() {
    let line: Vec<Vec<f64>> = (0..50).map(|i| vec![f64::from(i), 2.0 * f64::from(i), 0.5 * f64::from(i)]).collect();
    let plane: Vec<Vec<f64>> = random_points(50, 2, 1).into_iter().map(|q| vec![q[0], q[1], q[0] - q[1]]).collect();
    for (points, rank) in [(line, 1), (plane, 2)] {
        let refused = gridize(&samples(&points, linear_field), &options(0.1)).err().unwrap().to_string();
        assert!(refused.starts_with(&format!("the samples span only {rank} of 3 joint directions")), "{refused}");
    }
    let still: Vec<Vec<f64>> = random_points(50, 2, 1).into_iter().map(|q| vec![q[0], 0.25]).collect();
    let error = gridize(&samples(&still, linear_field), &options(0.1)).err().unwrap().to_string();
    assert!(error.contains("`joint 1`"), "{error}");
}

#[test]
fn hostile_input_is_refused() {
    let good = samples(&random_points(30, 2, 1), linear_field);
    let refused = |change: &dyn Fn(&mut Samples, &mut GridizeOptions)| {
        let (mut samples, mut options) = (good.clone(), options(0.1));
        change(&mut samples, &mut options);
        gridize(&samples, &options).err().unwrap().to_string()
    };
    assert!(refused(&|s, _| s.torques[7] = f64::NAN).contains("sample 3 has the torque NaN at joint `joint 1`"));
    assert!(refused(&|s, _| s.configurations[4] = f64::INFINITY).contains("sample 2"));
    assert!(refused(&|s, _| s.torques.truncate(59)).contains("59"));
    assert!(refused(&|s, _| *s = Samples::default()).contains("0 joints"));
    assert!(refused(&|_, o| o.steps = vec![1e-9]).contains("take a larger step"));
    assert!(refused(&|_, o| o.steps = vec![-1.0]).contains("not a positive number"));
    assert!(refused(&|_, o| o.steps = vec![f64::NAN]).contains("not a positive number"));
    assert!(refused(&|_, o| o.steps = vec![0.1; 3]).contains("3 grid steps"));
    assert!(refused(&|s, _| s.configurations.truncate(4)).contains("holds 60"));
    assert!(refused(&|_, o| o.epsilon = Some(f64::NAN)).contains("threshold"));
    let two = samples(&random_points(2, 2, 1), linear_field);
    assert!(gridize(&two, &options(0.1)).err().unwrap().to_string().contains("at least 3"));
    let three = samples(&random_points(9, 3, 1), linear_field);
    let natural = GridizeOptions { interpolation: Interpolation::Natural, ..options(0.1) };
    assert!(gridize(&three, &natural).is_err());
}

#[test]
fn joints_of_different_units_are_scaled_apart() {
    let mut given = samples(&random_points(200, 2, 5), |q| (4.0 * q[0]).sin() + q[1]);
    let reference = gridize(&given, &options(0.05)).unwrap().0;
    given.joints[1].unit = "m".to_owned();
    given.configurations.iter_mut().skip(1).step_by(2).for_each(|x| *x *= 1e-3);
    let scaled = GridizeOptions { steps: vec![0.05, 0.05e-3], ..options(0.05) };
    let (dataset, _) = gridize(&given, &scaled).unwrap();
    assert_eq!(dataset.grid.points(), reference.grid.points());
    // The extents of the two joints differ by a per cent, so a few triangles may; the field is smooth.
    let worst = dataset.torque.iter().zip(reference.torque.iter()).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    assert!(worst < 0.1, "{worst}");
}

#[test]
fn natural_neighbours_reproduce_linear_fields_and_are_smoother() {
    let points = random_points(400, 2, 11);
    let natural = GridizeOptions { interpolation: Interpolation::Natural, ..options(0.02) };
    let (dataset, _) = gridize(&samples(&points, linear_field), &natural).unwrap();
    assert!(worst(&dataset, linear_field).0 < 1e-9);
    let curved = |q: &[f64]| (6.0 * q[0]).sin() * (5.0 * q[1]).cos();
    let linear = gridize(&samples(&points, curved), &options(0.02)).unwrap().0;
    let natural = gridize(&samples(&points, curved), &natural).unwrap().0;
    let rms = |dataset: &Dataset| {
        // Away from the hull, where both fall back on long edges.
        let inner = |q: &[f64]| q.iter().all(|x| (x - 0.1).abs() < 0.4);
        let configurations = (0..dataset.grid.points()).map(|p| (p, dataset.grid.configuration(p)));
        let square = |(p, q): (usize, crate::JointVector)| (dataset.torque(p)[0] - curved(&q)).powi(2);
        configurations.filter(|(_, q)| inner(q)).map(square).sum::<f64>().sqrt()
    };
    assert!(rms(&natural) < rms(&linear), "{} {}", rms(&natural), rms(&linear));
}

#[test]
fn contact_is_where_the_torque_exceeds_epsilon() {
    let given = samples(&lattice(11, 1, 0.1), |q| q[0]);
    let with = GridizeOptions { epsilon: Some(0.45), ..options(0.1) };
    let (dataset, report) = gridize(&given, &with).unwrap();
    let contact: Vec<usize> = (0..11).filter(|&p| dataset.status(p) == Status::Contact).collect();
    assert_eq!(contact, [5, 6, 7, 8, 9, 10]);
    assert_eq!(report.contact_points, 6);
    let mut noisy = given.clone();
    noisy.deviations = Some(vec![0.2; 11]);
    let (_, report) = gridize(&noisy, &GridizeOptions { epsilon: None, ..options(0.1) }).unwrap();
    assert!((report.epsilon - 0.6).abs() < 1e-12);
}

#[test]
fn the_same_samples_in_another_order_give_the_same_torque() {
    let points = random_points(300, 3, 21);
    let mut reversed = points.clone();
    reversed.reverse();
    let field = |q: &[f64]| (7.0 * q[0]).sin() + q[1] * q[2];
    let a = gridize(&samples(&points, field), &options(0.05)).unwrap().0;
    let b = gridize(&samples(&reversed, field), &options(0.05)).unwrap().0;
    assert!(a.status[..] == b.status[..]);
    let worst = a.torque.iter().zip(b.torque.iter()).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    assert!(worst < 1e-12, "{worst:e}");
}

#[test]
fn smoothing_removes_noise_of_the_measured_size_and_leaves_the_rest() {
    let points = random_points(3000, 2, 31);
    let noise = |q: &[f64]| 0.2 * (uniform(q[0].to_bits() ^ q[1].to_bits().rotate_left(17)) - 0.5) * 12_f64.sqrt();
    let field = |q: &[f64]| 3.0 * q[0] + if q[1] > 0.1 { 5.0 } else { 0.0 };
    let mut noisy = samples(&points, |q| field(q) + noise(q));
    noisy.deviations = Some([0.2, 0.4].repeat(points.len()));
    let smooth = GridizeOptions { smooth: true, ..options(0.02) };
    let rms = |dataset: &Dataset, near: &dyn Fn(&[f64]) -> bool| {
        let points = (0..dataset.grid.points()).filter(|&p| dataset.status(p) != Status::Outside);
        let chosen: Vec<f64> = points
            .map(|p| (dataset.torque(p)[0], dataset.grid.configuration(p)))
            .filter(|(_, q)| near(q))
            .map(|(tau, q)| (tau - field(&q)).powi(2))
            .collect();
        (chosen.iter().sum::<f64>() / chosen.len() as f64).sqrt()
    };
    let away = |q: &[f64]| (q[1] - 0.1).abs() > 0.1;
    let rough = gridize(&noisy, &options(0.02)).unwrap().0;
    let smoothed = gridize(&noisy, &smooth).unwrap().0;
    assert!(rms(&smoothed, &away) < 0.6 * rms(&rough, &away), "{} {}", rms(&smoothed, &away), rms(&rough, &away));
    let step = |q: &[f64]| (q[1] - 0.1).abs() > 0.03 && (q[1] - 0.1).abs() < 0.07;
    assert!(rms(&smoothed, &step) < 1.5 * rms(&rough, &step), "the step is kept");
    noisy.deviations = Some(vec![0.0; 2 * points.len()]);
    let unchanged = gridize(&noisy, &smooth).unwrap().0;
    assert!(unchanged.torque[..] == rough.torque[..]);
    noisy.deviations = None;
    assert!(gridize(&noisy, &smooth).err().unwrap().to_string().contains("none was measured"));
}

#[test]
fn a_hollow_inside_the_hull_that_nobody_measured_has_no_torque() {
    let step = 0.05;
    let is_hollow = |q: &[f64]| (q[0] - 0.5).hypot(q[1] - 0.5) < 0.3;
    let points: Vec<Vec<f64>> = lattice(21, 2, step).into_iter().filter(|q| !is_hollow(q)).collect();
    let given = samples(&points, linear_field);
    let whole = gridize(&given, &options(0.02)).unwrap();
    let (dataset, report) = gridize(&given, &GridizeOptions { within: WITHIN, ..options(0.02) }).unwrap();
    assert!(report.spacing.iter().all(|spacing| (spacing - step).abs() < 1e-12));
    assert_eq!((whole.1.far, whole.1.inside), (0, whole.1.points));
    assert!(report.far > 200 && report.far + report.inside == report.points);
    for p in 0..dataset.grid.points() {
        let q = dataset.grid.configuration(p);
        let nearest = points.iter().map(|x| (x[0] - q[0]).hypot(x[1] - q[1])).fold(f64::INFINITY, f64::min);
        let is_known = dataset.status(p) != Status::Outside;
        // Beside the hollow the triangle that spans it may have other corners than the nearest sample.
        assert!(if is_known { nearest <= WITHIN * step } else { is_hollow(&q) }, "{q:?}, {nearest}");
        let kept = if is_known { std::array::from_fn(|k| whole.0.torque(p)[k]) } else { [0.0; 2] };
        assert_eq!(dataset.torque(p), kept);
    }
    for within in [0.0, -1.0, f64::NAN] {
        let error = gridize(&given, &GridizeOptions { within, ..options(0.02) }).err().unwrap().to_string();
        assert!(error.contains("spacings from the samples"), "{error}");
    }
}

#[test]
fn regular_scans_have_no_holes_however_finely_their_lines_are_divided() {
    for (joints, side) in [(1, 12), (2, 12), (3, 8), (4, 5), (5, 4)] {
        for (fine, sheared) in [(1.0, 0.0), (0.2, 0.0), (0.2, 0.5)] {
            let mut points = lattice(side, joints, 0.1);
            points.iter_mut().for_each(|q| {
                q[0] = fine * q[0] + sheared * q[joints - 1];
            });
            let near = GridizeOptions { within: WITHIN, ..options(0.07) };
            let (_, report) = gridize(&samples(&points, linear_field), &near).unwrap();
            let longest = if joints == 1 { 0.1 * (fine + sheared) } else { 0.1 };
            assert!(report.spacing[0] < 1.2 * longest, "{joints} joints: {}", report.spacing[0]);
            assert_eq!(report.far, 0, "{joints} joints");
        }
    }
}
