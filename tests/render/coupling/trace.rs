//! A trace read back from its file: the energy accounts close from its columns alone.

use super::block::setup;
use haptize::{
    JointVector,
    dataset::Dataset,
    device::Motion,
    render::{accounts::ACCOUNT_ROUNDING, session, setup::Setup},
    scene::Waypoint,
};

/// Every effect that books energy.
const ALL: &str = "[haptics]
passivity_control = true
four_channel = {}
friction = { coefficient = 0.4, stiffness = 2000.0 }
proxy_damping = [0.05, 0.05]
";

/// A file's columns by their names.
struct Columns(Vec<(String, Vec<f64>)>);

impl Columns {
    fn of(csv: &str) -> Self {
        let mut lines = csv.lines();
        let mut columns: Vec<(String, Vec<f64>)> =
            lines.next().unwrap().split(',').map(|name| (name.to_owned(), Vec::new())).collect();
        for line in lines {
            for ((_, column), field) in columns.iter_mut().zip(line.split(',')) {
                column.push(field.parse().unwrap_or(f64::NAN));
            }
        }
        Self(columns)
    }

    fn get(&self, name: &str) -> &[f64] {
        &self.0.iter().find(|(other, _)| other == name).unwrap_or_else(|| panic!("no column {name}")).1
    }

    /// Sum of columns of energy, tick by tick (J).
    fn sum(&self, names: &[&str]) -> Vec<f64> {
        let columns: Vec<&[f64]> = names.iter().map(|name| self.get(&format!("{name} [J]"))).collect();
        (0..columns[0].len()).map(|k| columns.iter().map(|column| column[k]).sum()).collect()
    }

    /// Sum up to each tick of `forces` at the tick before times how `places` moved since.
    fn work(&self, forces: &str, places: &str) -> Vec<f64> {
        let mut work = vec![0.0];
        for k in 1..self.get("time [s]").len() {
            let along = ["slide", "press"].map(|joint| {
                let place = self.get(&format!("{places} {joint} [m]"));
                self.get(&format!("{forces} {joint} [N]"))[k - 1] * (place[k] - place[k - 1])
            });
            work.push(work[k - 1] + along[0] + along[1]);
        }
        work
    }
}

fn largest_difference(a: &[f64], b: &[f64]) -> f64 {
    assert_eq!(a.len(), b.len());
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, |worst, x| if x > worst || x.is_nan() { x } else { worst })
}

#[test]
fn the_accounts_close_from_the_columns_of_the_file_alone() {
    let setup: Setup = setup(ALL).unwrap();
    // From beyond a stop of the proxy, so that the coupling's spring is loaded at the start; into the block, along it,
    // and against the stop again.
    let way = [(0.0, 0.21, -0.005), (0.5, 0.1, 0.012), (1.0, 0.0, 0.008), (1.5, 0.22, 0.01), (2.0, 0.1, -0.01)];
    let way = way.map(|(time, x, z)| Waypoint { time, q: JointVector::from_slice(&[x, z]) });
    let mut hand = setup.hand(Motion::through(&way, 2).unwrap()).unwrap();
    let data: Dataset = super::block::block(ALL);
    let trace = session::run(&setup.haptics, &mut hand, None, &setup.plan(&data, 2.0, 0)).unwrap();
    assert!(trace.ticks.iter().all(|tick| tick.fault.is_none()));
    let mut csv = Vec::new();
    trace.write_ticks(&mut csv).unwrap();
    let columns = Columns::of(&String::from_utf8(csv).unwrap());

    let given = ["initial", "coupling work", "channel work", "field work", "stop work"];
    let taken = ["proxy dissipation", "coupling dissipation", "friction dissipation", "control dissipation"];
    let kept = ["kinetic", "spring", "presliding"];
    let rounding = ACCOUNT_ROUNDING * columns.get("exchanged [J]").last().unwrap();
    let spent: Vec<f64> = columns.sum(&taken).iter().zip(columns.sum(&kept)).map(|(a, b)| a + b).collect();
    assert!(largest_difference(&columns.sum(&given), &spent) < rounding);
    // No term is there for nothing: without it the account does not close.
    for name in [&given[..], &taken, &kept].concat() {
        let size = columns.sum(&[name]).into_iter().map(f64::abs).fold(0.0, f64::max);
        assert!(size > 1e3 * rounding, "{name}: {size} J");
    }

    // What moved under which torque tells the work of both ports again.
    assert!(largest_difference(&columns.work("contact torque", "proxy"), columns.get("field work [J]")) < rounding);
    let port: Vec<f64> = columns.work("device torque", "device").iter().map(|work| -work).collect();
    assert!(largest_difference(&port, columns.get("port work [J]")) < rounding);
    let leak: Vec<f64> = columns
        .sum(&["field work", "stored"])
        .iter()
        .zip(columns.get("first stored [J]"))
        .map(|(a, b)| a - b)
        .collect();
    assert!(largest_difference(&leak, columns.get("leak [J]")) < rounding);
    let damping = &setup.scene.haptics.device_damping;
    let mut heat = vec![0.0];
    for k in 1..trace.ticks.len() {
        let moved = |joint: &str| {
            columns.get(&format!("device {joint} [m]"))[k] - columns.get(&format!("device {joint} [m]"))[k - 1]
        };
        heat.push(heat[k - 1] + (damping[0] * moved("slide").powi(2) + damping[1] * moved("press").powi(2)) / 1e-3);
    }
    assert!(largest_difference(&heat, columns.get("device dissipation [J]")) < rounding);
}
