//! How punctual the loop is against each emulator, as a table, and that each of its deadlines is accounted for. The
//! times depend on the machine; docs/devices.md has those of sessions of 20 s:
//!
//!     HAPTIZE_SECONDS=20 cargo test --locked --test devices -- --nocapture accounted_for

use crate::{felt::half_space_loop, inverse3, serial, tip, vendor};
use haptize::{
    dataset::JointLabel,
    device::{Device, Halt},
    proxy::Chain,
    render::{
        realtime::{self, Options},
        session::Plan,
    },
};

/// Length of each session, unless HAPTIZE_SECONDS gives another (s).
const SECONDS: f64 = 0.25;

/// Runs the loop with `device` against the clock and prints its row.
fn row(name: &str, device: &mut dyn Device, joints: usize) {
    let labels = (0..joints).map(|k| JointLabel { name: format!("joint {k}"), unit: "rad".into() }).collect();
    let seconds = std::env::var("HAPTIZE_SECONDS").map_or(SECONDS, |seconds| seconds.parse().unwrap());
    let plan = Plan::new(labels, crate::felt::PERIOD, seconds, 0);
    let haptics = half_space_loop(joints);
    let (trace, timing) = realtime::run(&haptics, device, None, &plan, Options::default()).unwrap();
    let (period, late) = (timing.interval, timing.lateness);
    println!(
        "| {name} | {} | {:.0} | {:.0} | {:.0} | {:.1} | {:.0} | {:.0} | {} | {:.2} | {} |",
        trace.ticks.len(),
        period.p50,
        period.p99,
        period.max,
        late.p50,
        late.p99,
        late.max,
        timing.late,
        timing.stolen.unwrap_or(0.0),
        trace.ticks.iter().filter(|tick| tick.applied.halt.is_some()).count(),
    );
    let halt = trace.ticks.last().and_then(|tick| tick.applied.halt);
    if let Some(halt) = halt {
        println!("{name} ended without torque: {halt}");
    }
    // A deadline has a tick, recorded or not, or was left out because an earlier tick ran late.
    let deadlines = trace.ticks.len() + (timing.missed_deadlines + timing.unrecorded) as usize;
    let stopped = halt.is_some_and(Halt::is_final);
    assert!(deadlines >= plan.ticks || stopped && !trace.ticks.is_empty(), "{name}: {deadlines} of {}", plan.ticks);
    assert!(trace.ticks.windows(2).all(|pair| pair[0].time < pair[1].time), "{name}");
    assert!(
        trace.ticks.len() < 2 || period.p50 > 0.0 && period.p50 <= period.p99 && period.p99 <= period.max,
        "{name}"
    );
}

#[test]
fn each_deadline_against_each_emulator_is_accounted_for() {
    println!(
        "| device | ticks | period: median [us] | 99 % | worst | lateness: median [us] | 99 % | worst | late | taken by \
         the hypervisor [s] | without torque |"
    );
    println!("|---|---|---|---|---|---|---|---|---|---|---|");
    serial::beside_two_diy(|device| row("2diy", device, 2));
    serial::beside_wooden_haptics(|device| row("woodenhaptics", device, 3));
    let chain: Chain = tip::arm();
    inverse3::beside_the_service(chain.clone(), |device| row("inverse3", device, 3));
    vendor::with_force_dimension(chain, |device| row("force-dimension", device, 3));
    vendor::with_touch(|device| row("touch", device, 3));
}
