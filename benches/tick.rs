//! What one tick of the haptic loop costs, for one to six joints and each interpolation: look-up alone and the whole
//! tick, side by side.
//!
//!     cargo bench --bench tick

#![allow(clippy::unwrap_used)] // A benchmark may stop.

mod clock;
#[path = "../tests/desktop/mod.rs"]
mod desktop;
#[path = "../tests/synthetic/mod.rs"]
mod synthetic;

use clock::nanoseconds;
use haptize as engine;
use haptize::{
    JointVector, MAX_JOINTS,
    field::TorqueField,
    render::haptic::{Haptics, Inputs},
    scene::Interpolation,
};
use std::hint::black_box;

const TICKS: u32 = 100_000;

fn main() {
    println!(
        "joints  interpolation  grid points  look-up [ns]  tick [ns]  look-up / linear  tick / linear of 3 joints"
    );
    let cost = |joints: usize, interpolation: Interpolation| {
        let count = [0, 4000, 200, 30, 14, 9, 7][joints];
        let mut data =
            synthetic::half_space(synthetic::grid(&vec![(-0.6, 1.2 / (count - 1) as f64, count); joints]), 5.0);
        let depth = |point: usize| data.grid.configuration(point).iter().sum::<f64>() / (joints as f64).sqrt();
        data.gap = Some((0..data.grid.points()).map(|point| -depth(point) as f32).collect::<Vec<_>>().into());
        let spec = desktop::haptics(joints);
        let field = TorqueField::interpolated(&data, interpolation, spec.threshold, &spec.boundary_slope).unwrap();
        // In and out of contact, through many cells.
        let place = |k: f64| {
            let mut q = JointVector::zeros(joints);
            q.iter_mut().enumerate().for_each(|(a, q)| *q = 0.1 + 0.4 * (1e-3 * k + a as f64).sin());
            q
        };
        let placing = nanoseconds(TICKS / 1000, 1000, |k| {
            black_box(place(k));
        });
        let look_up = nanoseconds(TICKS / 1000, 1000, |k| {
            black_box(field.sample(&place(k)));
        });
        let haptics = Haptics::new(field, desktop::proxy(joints), &spec).unwrap();
        let mut state = haptics.start(&place(0.0)).unwrap();
        let tick = nanoseconds(TICKS / 1000, 1000, |k| {
            let inputs = Inputs { position: place(k), age: 0.0, elapsed: 1e-3, interval: 1e-3 };
            black_box(haptics.tick(&mut state, &inputs));
        });
        (data.grid.points(), look_up - placing, tick - placing)
    };
    let three = cost(3, Interpolation::Linear).2;
    for joints in 1..=MAX_JOINTS {
        let linear = cost(joints, Interpolation::Linear).1;
        for interpolation in Interpolation::ALL {
            let (points, look_up, tick) = cost(joints, interpolation);
            let (ratio, relative) = (look_up / linear, tick / three);
            let name = interpolation.name();
            println!("{joints:6}  {name:13}  {points:11}  {look_up:12.0}  {tick:9.0}  {ratio:16.1}  {relative:25.2}");
        }
    }
}
