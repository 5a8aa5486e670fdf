//! The dataset of a real object with its twin: torque from what was measured, and from the twin where nothing was.

use super::*;
use haptize::{
    contact::Solver,
    render::{live::LiveScene, twinned::TwinnedField},
};
use std::sync::Arc;

/// The finger and the ball, finer.
fn scene() -> Scene {
    let path = format!("{}/tests/scenes/small.toml", env!("CARGO_MANIFEST_DIR"));
    let text = std::fs::read_to_string(&path).unwrap();
    let text = text.replace("step = 0.1, count = 7", "step = 0.05, count = 13");
    let text = text.replace("step = 0.004, count = 9", "step = 0.002, count = 17");
    let text = text.replace("rings = 4, segments = 5", "rings = 10, segments = 16");
    let text = text.replace("[contact]\n", "[contact]\nlaw = \"rest\"\n");
    Scene::parse(&text, &path).unwrap()
}

/// What was measured of an object whose stiffness is not that of the twin, nor the same multiple of it everywhere; of a
/// deep part nothing was.
fn measured(scene: &Scene) -> Dataset {
    let mut dataset = baked(scene).unwrap().0;
    let energy: Vec<f64> = dataset.energy.as_ref().unwrap().to_vec();
    let deepest = energy.iter().copied().fold(0.0, f64::max);
    let (mut torques, mut energies, mut status) = (dataset.torque.to_vec(), energy.clone(), dataset.status.to_vec());
    for point in 0..dataset.grid.points() {
        let q = dataset.grid.configuration(point);
        let (stiffer, change) = (1.2 + 0.1 * (8.0 * q[0]).sin(), 0.8 * (8.0 * q[0]).cos());
        let torque = &mut torques[2 * point..2 * point + 2];
        torque.iter_mut().for_each(|tau| *tau *= stiffer);
        torque[0] -= change * energy[point];
        energies[point] *= stiffer;
        if energy[point] > 0.4 * deepest {
            status[point] = Status::Outside as u8;
            torque.fill(0.0);
            energies[point] = 0.0;
        }
    }
    (dataset.torque, dataset.energy, dataset.status) = (torques.into(), Some(energies.into()), status.into());
    (dataset.surface, dataset.contacts, dataset.gap, dataset.tangent, dataset.slip) = (None, None, None, None, None);
    dataset
}

fn twinned() -> (Dataset, Setup) {
    let scene = scene();
    let twin = Arc::new(LiveScene::new(scene.clone()).unwrap());
    let dataset = twin.beside(measured(&scene));
    let setup = Setup::twinned(twin, &dataset).unwrap();
    (dataset, setup)
}

/// Measured points in contact beside which one was not measured.
fn border(dataset: &Dataset) -> Vec<JointVector> {
    let points = (0..dataset.grid.points()).filter(|&point| dataset.status(point) == Status::Contact);
    let is_border = |point: &usize| {
        let beside = dataset.grid.neighbours(*point).flatten();
        beside.flatten().any(|beside| dataset.status(beside) == Status::Outside)
    };
    points.filter(is_border).map(|point| dataset.grid.configuration(point)).collect()
}

#[test]
fn no_closed_way_across_the_border_gives_energy_and_the_torque_is_continuous() {
    let (dataset, setup) = twinned();
    let field = setup.haptics.source().twinned().unwrap();
    assert!((1.1..1.3).contains(&field.factor()), "{}", field.factor());
    let greatest = dataset.energy.as_ref().unwrap().iter().copied().fold(0.0, f64::max);
    let mut slopes = JointVector::zeros(2);
    slopes.fill(1.0);
    let alone = TorqueField::interpolated(&dataset, Interpolation::Potential, 0.5, &slopes).unwrap();
    let mut twin = Solver::new(field.twin().direct().model());
    let border = border(&dataset);
    let around = |centre: &JointVector, angle: f64| {
        let mut q = *centre;
        q[0] += 1.6 * dataset.grid.axes[0].step * angle.cos();
        q[1] += 1.6 * dataset.grid.axes[1].step * angle.sin();
        q
    };
    let mut contact = setup.haptics.source().begin();
    let (mut crossed, mut naive_work) = (0, 0.0_f64);
    for centre in &border {
        let mut sampled = |steps: u32, step: &mut dyn FnMut(&Sample, &JointVector, &JointVector)| {
            for k in 0..steps {
                let angle = |k: f64| k * std::f64::consts::TAU / f64::from(steps);
                let [from, at, to] = [0.0, 0.5, 1.0].map(|part| around(centre, angle(f64::from(k) + part)));
                let mut moved = to;
                moved.iter_mut().zip(from.iter()).for_each(|(to, from)| *to -= from);
                step(&sample(&setup, &mut contact, &at), &at, &moved);
            }
        };
        let (mut work, mut naive, mut shares) = (0.0, 0.0, [1.0_f64, 0.0]);
        sampled(8000, &mut |felt, at, moved| {
            let along = |torque: &JointVector| torque.iter().zip(moved.iter()).map(|(tau, dq)| tau * dq).sum::<f64>();
            work += along(&felt.torque);
            shares = [shares[0].min(felt.twin), shares[1].max(felt.twin)];
            let (own, factor) = (twin.solve(at).torque, field.factor() * felt.twin);
            naive += (1.0 - felt.twin) * along(&alone.sample(at).torque) + factor * along(&own);
        });
        crossed += usize::from(shares == [0.0, 1.0]);
        naive_work = naive_work.max(naive.abs());
        assert!(work.abs() < 1e-4 * greatest, "{centre:?}: {work} of {greatest} J");
        // Of a torque that is continuous, half the step makes half the change.
        let mut changes = [0.0_f64; 2];
        for (steps, greatest) in [4000, 8000].into_iter().zip(&mut changes) {
            let mut before: Option<JointVector> = None;
            sampled(steps, &mut |felt, _, _| {
                if let Some(before) = before.replace(felt.torque) {
                    let square = felt.torque.iter().zip(before.iter()).map(|(a, b)| (a - b).powi(2)).sum::<f64>();
                    *greatest = greatest.max(square.sqrt());
                }
            });
        }
        assert!(changes[1] < 0.6 * changes[0], "{centre:?}: {changes:?}");
    }
    assert!(crossed > 3, "{crossed} of {}", border.len());
    // Shares of torques alone, without the slope of the share, do give energy.
    assert!(naive_work > 1e-3 * greatest, "{naive_work} of {greatest}");
}

/// What the loop feels with the proxy at `at`.
fn sample(setup: &Setup, contact: &mut haptize::render::source::ContactSession<'_>, at: &JointVector) -> Sample {
    let mut state = setup.haptics.start(at).unwrap();
    let inputs = Inputs { position: *at, age: 0.0, elapsed: 1e-3, interval: 1e-3 };
    setup.haptics.tick_with(&mut state, &inputs, contact).sample
}

#[test]
fn a_session_feels_the_measured_torque_sees_the_twin_and_keeps_its_accounts() {
    let (dataset, setup) = twinned();
    let way = [(0.0, 0.02), (2.0, 0.055), (4.0, 0.02)];
    let way = way.map(|(time, slide)| Waypoint { time, q: vector(&[0.02, slide]) });
    let press = Motion::through(&way, 2).unwrap();
    let plan = setup.plan(&dataset, press.duration(), 20);
    let mut graphics = setup.graphics(&dataset).unwrap().unwrap();
    let trace = session::run(&setup.haptics, &mut Recorded::new(press), Some(&mut graphics), &plan).unwrap();
    let summary = trace.summary();
    assert!(summary.twin_alone > 100 && summary.twin_ticks > summary.twin_alone, "{summary:?}");
    let measured = trace.ticks.iter().filter(|tick| tick.sample.contact && tick.sample.twin == 0.0).count();
    assert!(measured > 50 && summary.faults == 0 && summary.unconverged == 0, "{measured} {summary:?}");
    assert!(summary.max_relative_account_residual < 1e-9, "{summary:?}");
    let stored = trace.ticks.iter().map(|tick| tick.sample.energy).fold(0.0, f64::max);
    assert!(summary.leak < 0.02 * stored, "{} of {stored} J", summary.leak);
    let rest = &setup.object.as_ref().unwrap().rest;
    let moved = |frame: &Frame| frame.nodes.iter().zip(rest).map(|(x, at)| x.distance(*at)).fold(0.0, f64::max);
    assert!(trace.frames.iter().map(moved).fold(0.0, f64::max) > 1e-4);
}

#[test]
fn a_dataset_without_energy_is_not_twinned() {
    let scene = scene();
    let twin = Arc::new(LiveScene::new(scene.clone()).unwrap());
    let dataset = Dataset { energy: None, ..measured(&scene) };
    assert!(TwinnedField::new(&dataset, twin).err().unwrap().to_string().contains("energy"));
}
