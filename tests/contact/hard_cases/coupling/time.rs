//! Time that is not what it should be: ticks that jitter, are dropped or late for good, positions from the past.

use super::{
    Altered, Bound, CaseResult, DESKTOP, Failure, Setting, Watch, drive, noise, on_time, open, presses, seconds,
};
use haptize::{
    device::Reading,
    render::{flags::Fault, haptic::GREATEST_GIVEN_ENERGY},
};
use std::collections::VecDeque;

pub(super) fn jitter(setting: &Setting) -> Result<Vec<CaseResult>, Failure> {
    let seconds = seconds(setting, 5.0, 120.0);
    let setup = open(3, DESKTOP)?;
    let mut watch = Watch::new(&setup.scene.haptics);
    for haptics in [DESKTOP.to_owned(), format!("{DESKTOP}passivity_control = true\n")] {
        let setup = open(3, &haptics)?;
        // The mean of a number that is uniform in its logarithm from 0.2 to 20 is 4.3.
        let time = |k: usize| 0.2e-3 * 100_f64.powf(noise(k));
        drive(&setup, &mut presses(&setup, seconds)?, (seconds / 4.3e-3) as usize, time, &mut watch)?;
    }
    Ok(watch.outcomes("jittering ticks", "T from 0.2 to 20 ms, with and without passivity control"))
}

pub(super) fn dropped(setting: &Setting) -> Result<Vec<CaseResult>, Failure> {
    let seconds = seconds(setting, 2.0, 60.0);
    let setup = open(3, DESKTOP)?;
    let mut watch = Watch::new(&setup.scene.haptics);
    for share in [0.1, 0.5, 0.9] {
        // Every tick that is not dropped comes after as many as were.
        let time = |k: usize| 1e-3 * (1.0 + (noise(k).ln() / f64::ln(share)).floor()).min(50.0);
        let count = (seconds * (1.0 - share) * 1e3) as usize;
        drive(&setup, &mut presses(&setup, seconds)?, count, time, &mut watch)?;
    }
    Ok(watch.outcomes("dropped ticks", "10, 50 and 90 % dropped"))
}

/// The energy that a hold gives is seen when it is over: beyond the guard's energy there may be what one hold could
/// give.
pub(super) fn overruns(setting: &Setting) -> Result<Vec<CaseResult>, Failure> {
    let seconds = seconds(setting, 2.0, 20.0);
    let setup = open(3, DESKTOP)?;
    let mut outcomes = Vec::new();
    for late in [12e-3, 20e-3, 50e-3, 100e-3] {
        let mut watch = Watch::new(&setup.scene.haptics);
        // Begins free, in the middle of a press, and deepest in contact.
        for on_time in [50, 250, 500, 700] {
            let time = |k: usize| if k < on_time { 1e-3 } else { late };
            drive(&setup, &mut presses(&setup, seconds)?, on_time + (seconds / late) as usize, time, &mut watch)?;
        }
        let varied = format!("every tick {:.0} ms after the one before", 1e3 * late);
        let mut found = watch.must_let_go("persistent overruns", &varied, &[Fault::Overrun, Fault::Energy]);
        found[2].bound = Bound::AtMost(2.0 * GREATEST_GIVEN_ENERGY + watch.hold);
        outcomes.extend(found);
    }
    Ok(outcomes)
}

pub(super) fn delay(setting: &Setting) -> Result<Vec<CaseResult>, Failure> {
    let seconds = seconds(setting, 2.0, 60.0);
    let setup = open(3, DESKTOP)?;
    let mut watch = Watch::new(&setup.scene.haptics);
    for ticks in [1_u8, 2, 5, 10, 20] {
        for control in ["", "passivity_control = true\n"] {
            let setup = open(3, &format!("{DESKTOP}{control}"))?;
            let device = presses(&setup, seconds)?;
            let mut past: VecDeque<Reading> = VecDeque::new();
            // The device says how old its positions are, as it must.
            let altered = |_, reading: Reading| {
                past.push_back(reading);
                let old = if past.len() > usize::from(ticks) { past.pop_front() } else { past.front().copied() };
                Reading { age: 1e-3 * f64::from(ticks), ..old.unwrap_or(reading) }
            };
            on_time(&setup, &mut Altered { device, tick: 0, altered }, seconds, &mut watch)?;
        }
    }
    Ok(watch.outcomes("delayed positions", "1, 2, 5, 10 and 20 ms one way, with and without passivity control"))
}
