//! A half space felt through a device, tick by tick.

use crate::common::desktop::{haptics, proxy};
use assert_no_alloc::assert_no_alloc;
use haptize::{
    JointVector,
    device::{Device, Motion, SimulatedHand},
    field::TorqueField,
    fixtures::grids::{grid, half_space},
    render::{haptic::Haptics, session::Driver, trace::Tick},
    scene::{Interpolation, Waypoint},
};

/// Nominal time between ticks (s).
pub const PERIOD: f64 = 1e-3;

/// `joints` times the same number.
pub fn all(joints: usize, x: f64) -> JointVector {
    JointVector::from_slice(&vec![x; joints])
}

/// A loop over a half space that is entered where the mean of the joints is positive.
pub fn half_space_loop(joints: usize) -> Haptics {
    let data = half_space(grid(&vec![(-0.6, 0.3, 5); joints]), 5.0);
    let spec = haptics(joints);
    let field = TorqueField::interpolated(&data, Interpolation::Linear, spec.threshold, &spec.boundary_slope).unwrap();
    Haptics::new(field, proxy(joints), &spec).unwrap()
}

/// A simulated hand and device whose joints, `offset` added, go from outside of the half space into it and stay there.
pub fn pressing(joints: usize, offset: &JointVector) -> SimulatedHand {
    let at = |x: f64| {
        let mut q = *offset;
        q.iter_mut().for_each(|q| *q += x);
        q
    };
    let way = [(0.0, -0.2), (0.3, 0.3), (10.0, 0.3)].map(|(time, x)| Waypoint { time, q: at(x) });
    SimulatedHand::new(&haptics(joints), Motion::through(&way, joints).unwrap()).unwrap()
}

/// Runs `count` ticks; `between` is called after each with its record. Ticks allocate nothing.
pub fn run(haptics: &Haptics, device: &mut dyn Device, count: usize, mut between: impl FnMut(&Tick)) -> Vec<Tick> {
    let mut driver = Driver::new(haptics, device).unwrap();
    let tick = |driver: &mut Driver<'_>| assert_no_alloc(|| driver.tick(PERIOD, PERIOD)).0;
    (0..count)
        .map(|_| {
            let tick = tick(&mut driver);
            between(&tick);
            tick
        })
        .collect()
}

/// Whether the accounts of all `ticks` close to rounding.
pub fn accounts_close(ticks: &[Tick]) -> bool {
    let exchanged = ticks.last().map_or(0.0, |tick| tick.accounts.exchanged);
    exchanged > 0.0 && ticks.iter().all(|tick| tick.accounts.residual().abs() <= 1e-11 * exchanged)
}
