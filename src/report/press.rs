//! The press as time curves (paper's Fig. 5): contact torque, configuration, number of contacting nodes, and the
//! energy accounts of proxy and coupling.

use crate::{
    JointVector,
    draw::{
        canvas::Canvas,
        chart::{Lane, Stack},
        plot::Curve,
    },
    render::{
        accounts::Accounts,
        trace::{Tick, Trace},
    },
    scene::effort_unit,
};

/// Draws joint contact torque, change of configuration and number of contacting object nodes against time, contact
/// shaded (Fig. 5).
#[must_use]
pub fn press(trace: &Trace) -> Canvas {
    titled("Multi-point contact felt through the 1 kHz loop", trace)
}

/// Draws the figure of [`press`] under another title.
#[must_use]
pub fn titled(headline: &str, trace: &Trace) -> Canvas {
    let mut lanes =
        per_joint(trace, ["Contact torque on the proxy", "Contact force on the proxy"], TORQUE, |tick, joint| {
            tick.sample.torque.get(joint).copied()
        });
    lanes.extend(per_joint(trace, ["Torque on the device", "Force on the device"], TORQUE, |tick, joint| {
        tick.device_torque.get(joint).copied()
    }));
    let start = trace.ticks.first().map_or_else(|| JointVector::zeros(trace.joints.len()), |tick| tick.proxy);
    lanes.extend(per_joint(trace, ["Motion from the start"; 2], "Δq", |tick, joint| {
        Some(tick.proxy.get(joint)? - start.get(joint)?)
    }));
    // A measured dataset knows no nodes.
    if trace.ticks.iter().all(|tick| !tick.sample.contact)
        || trace.ticks.iter().any(|tick| tick.sample.contact_nodes > 0)
    {
        let nodes = curve(trace, "", 0, |tick| f64::from(tick.sample.contact_nodes));
        let title = "Object nodes in contact, as its grid point knows them [1]";
        lanes.push(Lane { height: 90.0, counts: true, ..Lane::new(title, vec![nodes]) });
    }
    stack(headline, trace, lanes)
}

/// Draws where the energy of proxy and coupling comes from, is kept and goes.
#[must_use]
pub fn energy(trace: &Trace) -> Canvas {
    type Account = (&'static str, fn(&Accounts) -> f64);
    let lane = |title: &str, accounts: &[Account]| {
        let curves = accounts
            .iter()
            .enumerate()
            .map(|(number, (name, account))| curve(trace, name, number, |tick| 1e3 * account(&tick.accounts)));
        Lane::new(title, curves.collect())
    };
    let kept: [Account; 3] = [
        ("stored in the object, U", |accounts| accounts.stored),
        ("coupling spring", |accounts| accounts.spring),
        ("kinetic", |accounts| accounts.kinetic),
    ];
    // A measured dataset knows no stored energy, and so no leak.
    let knows_energy = trace.ticks.iter().any(|tick| tick.accounts.stored != 0.0 || tick.accounts.leak != 0.0);
    let mut lanes = vec![
        lane("Energy held [mJ]", &kept[usize::from(!knows_energy)..]),
        lane(
            "Work and losses [mJ]",
            &[
                ("by the coupling", |accounts| accounts.coupling_work),
                ("by the contact torque", |accounts| accounts.field_work),
                ("lost in the coupling", |accounts| accounts.coupling_dissipation),
                ("lost in the proxy", |accounts| accounts.proxy_dissipation),
            ],
        ),
    ];
    if knows_energy {
        lanes
            .push(lane("Created at the object by time step and interpolation [mJ]", &[("", |accounts| accounts.leak)]));
    }
    stack("Energy accounts of proxy and coupling", trace, lanes)
}

pub(super) fn stack(headline: &str, trace: &Trace, lanes: Vec<Lane>) -> Canvas {
    Stack {
        headline: headline.to_owned(),
        across: "Time [s]".to_owned(),
        lanes,
        contact: contact_intervals(&trace.ticks),
    }
    .draw()
}

/// Symbol of a torque or force.
pub(super) const TORQUE: &str = "τ";

/// A panel for each unit that occurs among the joints, with a curve for each joint of that unit; `names` are those of
/// the quantity for joints in radians and in metres, which is an effort where its `symbol` is [`TORQUE`].
pub(super) fn per_joint(
    trace: &Trace,
    names: [&str; 2],
    symbol: &str,
    value: impl Fn(&Tick, usize) -> Option<f64>,
) -> Vec<Lane> {
    let occurs = |unit: &str| trace.joints.iter().any(|joint| joint.unit == unit);
    let units = ["rad", "m"].into_iter().zip(names).filter(|(unit, _)| occurs(unit));
    let lanes = units.map(|(unit, what)| {
        let of_unit = trace.joints.iter().enumerate().filter(|(_, joint)| joint.unit == unit);
        let curves = of_unit.map(|(number, joint)| {
            let name = format!("{symbol}{} {}", subscript(number + 1), joint.name);
            curve(trace, &name, number, |tick| value(tick, number).unwrap_or(f64::NAN))
        });
        let unit = if symbol == TORQUE { effort_unit(unit) } else { unit };
        Lane::new(format!("{what} [{unit}]"), curves.collect())
    });
    let lanes: Vec<Lane> = lanes.collect();
    if lanes.is_empty() {
        return vec![Lane::new(names[0], Vec::new())];
    }
    lanes
}

pub(super) fn curve(trace: &Trace, name: &str, number: usize, value: impl Fn(&Tick) -> f64) -> Curve {
    Curve::new(name, number, trace.ticks.iter().map(|tick| (tick.time, value(tick))))
}

/// The configuration with the largest contact torque, if there is contact (rad or m).
pub(super) fn deepest(trace: &Trace) -> Option<JointVector> {
    let size = |tick: &&Tick| tick.sample.torque.norm();
    let touching = trace.ticks.iter().filter(|tick| tick.sample.contact);
    touching.max_by(|a, b| size(a).total_cmp(&size(b))).map(|tick| tick.proxy)
}

/// Begin and end of each uninterrupted contact (s).
pub(super) fn contact_intervals(ticks: &[Tick]) -> Vec<[f64; 2]> {
    ticks
        .chunk_by(|a, b| a.sample.contact == b.sample.contact)
        .filter(|run| run[0].sample.contact)
        .map(|run| [run[0].time, run[run.len() - 1].time])
        .collect()
}

/// `number` as subscript digits.
pub(super) fn subscript(number: usize) -> String {
    const DIGITS: [char; 10] = ['₀', '₁', '₂', '₃', '₄', '₅', '₆', '₇', '₈', '₉'];
    number.to_string().bytes().map(|byte| DIGITS[usize::from(byte - b'0')]).collect()
}
