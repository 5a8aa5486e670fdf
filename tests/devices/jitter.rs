//! How punctual the loop is against each emulator, as a table. A report: what it prints depends on the machine.
//!
//!     cargo test --locked --test devices -- --ignored --nocapture how_punctual

use crate::{felt::half_space_loop, inverse3, serial, tip, vendor};
use haptize::{
    device::Device,
    proxy::Chain,
    render::{realtime, session::Plan, trace::JointLabel},
};
use std::sync::atomic::AtomicBool;

/// Length of each session [s].
const SECONDS: f64 = 20.0;

/// Runs the loop with `device` against the clock and prints its row.
fn row(name: &str, device: &mut dyn Device, joints: usize) {
    let labels = (0..joints).map(|k| JointLabel { name: format!("joint {k}"), unit: "rad".into() }).collect();
    let plan = Plan::new(labels, crate::felt::PERIOD, SECONDS, 0);
    let haptics = half_space_loop(joints);
    let (trace, timing) = realtime::run(&haptics, device, None, &plan, &AtomicBool::new(false)).unwrap();
    let (period, late) = (timing.interval, timing.lateness);
    let steal = timing.steal.unwrap_or_default();
    println!(
        "| {name} | {} | {:.0} | {:.0} | {:.0} | {:.1} | {:.0} | {:.0} | {} | {} | {} |",
        trace.ticks.len(),
        period.p50,
        period.p99,
        period.max,
        late.p50,
        late.p99,
        late.max,
        steal.late - steal.late_beside_steal,
        steal.late_beside_steal,
        trace.ticks.iter().filter(|tick| tick.applied.halt.is_some()).count(),
    );
    if let Some(halt) = trace.ticks.last().and_then(|tick| tick.applied.halt) {
        println!("{name} ended without torque: {halt}");
    }
}

#[test]
#[ignore = "a report of wall-clock times"]
fn how_punctual_the_loop_is_against_each_emulator() {
    println!(
        "| device | ticks | period: median [us] | 99 % | worst | lateness: median [us] | 99 % | worst | late by the system | by the hypervisor | without torque |"
    );
    println!("|---|---|---|---|---|---|---|---|---|---|---|");
    serial::beside_two_diy(|device| row("2diy", device, 2));
    serial::beside_wooden_haptics(|device| row("woodenhaptics", device, 3));
    let chain: Chain = tip::arm();
    inverse3::beside_the_service(chain.clone(), |device| row("inverse3", device, 3));
    vendor::with_force_dimension(chain, |device| row("force-dimension", device, 3));
    vendor::with_touch(|device| row("touch", device, 3));
}
