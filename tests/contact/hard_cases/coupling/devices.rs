//! Devices that lie: they leap, report no numbers, or see the hand in coarse steps.

use super::{Altered, CaseResult, DESKTOP, Failure, Setting, Watch, on_time, open, presses, seconds};
use haptize::{device::Reading, render::flags::Fault};

/// `reading` with each joint's position changed.
fn moved(reading: Reading, change: impl Fn(f64) -> f64) -> Reading {
    let mut position = reading.position;
    position.iter_mut().for_each(|x| *x = change(*x));
    Reading { position, ..reading }
}

pub(super) fn leap(_: &Setting) -> Result<Vec<CaseResult>, Failure> {
    let setup = open(3, DESKTOP)?;
    let mut watch = Watch::new(&setup.scene.haptics);
    for by in [1.0, -1.0, 0.1] {
        let device = presses(&setup, 1.0)?;
        let altered = |tick, reading| moved(reading, |x| if tick > 500 { x + by } else { x });
        on_time(&setup, &mut Altered { device, tick: 0, altered }, 1.0, &mut watch)?;
    }
    Ok(watch.must_let_go("leaping device", "by 1, -1 and 0.1 rad within a tick, in contact", &[Fault::Leap]))
}

pub(super) fn not_finite(_: &Setting) -> Result<Vec<CaseResult>, Failure> {
    let setup = open(3, DESKTOP)?;
    let mut watch = Watch::new(&setup.scene.haptics);
    for value in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1e300] {
        let device = presses(&setup, 1.0)?;
        // For one tick only: what comes after is not trusted either.
        let altered = |tick, reading| moved(reading, |x| if tick == 500 { value } else { x });
        on_time(&setup, &mut Altered { device, tick: 0, altered }, 1.0, &mut watch)?;
    }
    Ok(watch.must_let_go(
        "no numbers from the device",
        "NaN, infinities and 1e300 for one tick, in contact",
        &[Fault::NotFinite],
    ))
}

pub(super) fn encoders(setting: &Setting) -> Result<Vec<CaseResult>, Failure> {
    let seconds = seconds(setting, 1.0, 60.0);
    let setup = open(3, DESKTOP)?;
    let mut watch = Watch::new(&setup.scene.haptics);
    for step in [1e-5, 1e-4, 1e-3, 1e-2] {
        let device = presses(&setup, seconds)?;
        let altered = |_, reading| moved(reading, |x| step * (x / step).round());
        on_time(&setup, &mut Altered { device, tick: 0, altered }, seconds, &mut watch)?;
    }
    Ok(watch.outcomes("coarse encoders", "steps of 1e-5 to 1e-2 rad"))
}
