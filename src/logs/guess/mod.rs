//! A column mapping for a log, guessed from the names of its columns and their numbers: a start, in which what no table
//! tells is marked.

mod column;
mod table;

use super::{ColumnUnit, Effort};
use crate::{
    Error, MAX_AXES, csv,
    gridize::pull,
    names::escaped,
    toml_text::{coarse, comment, list, quoted},
};
use column::{Reading, Role};
use std::{
    collections::HashSet,
    f64::consts::TAU,
    fmt::{self, Write},
    path::Path,
};
use table::Layout;

/// Cells into which the range of a joint is cut where rows are averaged (1).
const CELLS: f64 = 100.0;

/// Spacing of the grid that is proposed, over the range of a joint (1): of one joint, and of several, which a log seldom
/// fills.
const STEP: f64 = 0.04;
const STEP_OF_SEVERAL: f64 = 0.08;

/// Speed below which a joint stands still, over its greatest (1).
const STILL: f64 = 0.02;

/// Share of the rows in the rarer direction from which on a joint goes to and fro (1).
const TO_AND_FRO: f64 = 0.2;

/// Share of the rows at which the time is later than at the row before (1): stamps may be rounded.
const GROWING: f64 = 0.9;

/// Share of the rows at which a column that is called the time has to grow (1): one of whole seconds hardly does.
const RISING: f64 = 0.5;

/// Time between rows where no column tells it (s).
const PERIOD: f64 = 1e-3;

/// Angle that no joint in radians is at (rad): three turns.
const GREATEST_ANGLE: f64 = 3.0 * TAU;

/// Time between rows from which on it is not in seconds (1): nothing that touches is measured once a second.
const LONGEST_PERIOD: f64 = 0.9;

/// Returns the spacing of a grid to begin with, for samples in which each joint goes over a range (rad or m).
#[must_use]
pub fn suggested_steps(ranges: &[f64]) -> Vec<f64> {
    let share = if ranges.len() == 1 { STEP } else { STEP_OF_SEVERAL };
    ranges.iter().map(|range| share * range).collect()
}

/// A guessed mapping.
#[derive(Clone, Debug)]
pub struct GuessedMapping {
    /// The mapping's file.
    pub text: String,
    /// What to check, one sentence each.
    pub doubts: Vec<String>,
    /// Spacing of a grid to begin with, a number a joint (rad or m).
    pub steps: Vec<f64>,
}

/// A column that is a quantity.
struct GuessedColumn {
    column: usize,
    unit: Option<ColumnUnit>,
    /// In SI units.
    values: Vec<f64>,
}

impl GuessedColumn {
    fn new(layout: &Layout, column: usize, unit: Option<ColumnUnit>) -> Self {
        let factor = unit.map_or(1.0, |unit| unit.factor);
        Self { column, unit, values: layout.columns[column].iter().map(|value| factor * value).collect() }
    }
}

struct GuessedJoint {
    name: String,
    position: GuessedColumn,
    torque: GuessedColumn,
    /// Whether the name of the torque's column says that it is the motor's.
    of_motor: bool,
}

/// Guesses what the columns of the table in `log` are.
///
/// # Errors
/// When it cannot be read, is no table, or has no column for positions or torques.
pub fn guess(log: &Path) -> Result<GuessedMapping, Error> {
    let layout = Layout::read(log)?;
    let mut doubts = Vec::new();
    let readings: Vec<Reading> = match &layout.names {
        Some(names) => names.iter().map(|name| column::read(name)).collect(),
        None => unnamed(&layout, &mut doubts),
    };
    let of = |role| {
        let is_one = |column: &usize| role_of(&readings, &layout, *column) == Some(role);
        (0..layout.columns.len()).filter(is_one).collect::<Vec<_>>()
    };
    let (times, positions, torques) = (of(Role::Time), of(Role::Position), of(Role::Torque));
    if positions.is_empty() || torques.is_empty() {
        let what = if positions.is_empty() { "position" } else { "torque" };
        return Err(Error::at(
            log,
            format_args!(
                "no column looks like a joint's {what}: {}; write the mapping by hand, or name the columns such as \
                 `elbow angle [deg]` and `elbow torque [N m]`",
                described(&layout)
            ),
        ));
    }
    let pairs = pairs(&readings, &positions, &torques, &mut doubts);
    let joints: Vec<GuessedJoint> =
        pairs.into_iter().map(|pair| joint(&layout, &readings, pair, &mut doubts)).collect();
    let (mut joints, still): (Vec<GuessedJoint>, Vec<GuessedJoint>) =
        joints.into_iter().partition(|joint| range(&joint.position.values).is_some_and(|[low, high]| high > low));
    if !still.is_empty() {
        let names: Vec<&str> = still.iter().map(|joint| joint.name.as_str()).collect();
        doubts.push(format!("joints that do not move are left out: {}", names.join(", ")));
    }
    if joints.is_empty() {
        return Err(Error::at(log, format_args!("no joint moves in its rows: {}", described(&layout))));
    }
    let mut known = HashSet::new();
    if !joints.iter().all(|joint| known.insert(joint.name.clone())) {
        joints.iter_mut().enumerate().for_each(|(k, joint)| joint.name = format!("joint {}", k + 1));
    }
    let rising = times.iter().find(|column| rises(&layout.columns[**column]) >= RISING);
    let time = rising.map(|column| time(&layout, &readings, *column, &mut doubts));
    if time.is_none() {
        doubts.push("no column is the time: rows are taken to be 1 ms apart".to_owned());
    }
    let facts = MappingFacts { layout: &layout, time, joints, effort: Effort::Contact, average: None };
    Ok(facts.complete(log, doubts))
}

/// The role of a column; none where it holds no numbers.
fn role_of(readings: &[Reading], layout: &Layout, column: usize) -> Option<Role> {
    layout.is_numeric[column].then(|| readings[column].role).flatten()
}

/// What the columns of a table without names may be: time, if one never falls, and then positions before as
/// many torques.
fn unnamed(layout: &Layout, doubts: &mut Vec<String>) -> Vec<Reading> {
    let of = |role| Reading { role, ..Reading::default() };
    let mut readings = vec![of(None); layout.columns.len()];
    let mut others: Vec<usize> = (0..layout.columns.len()).filter(|&column| layout.is_numeric[column]).collect();
    let grows = |column: &usize| {
        let values = &layout.columns[*column];
        rises(values) >= GROWING && values.windows(2).all(|pair| pair[1] >= pair[0])
    };
    if let Some(at) = others.iter().position(grows) {
        readings[others.remove(at)] = of(Some(Role::Time));
    }
    let joints = others.len() / 2;
    for (k, column) in others.into_iter().enumerate().take(2 * joints) {
        readings[column] = of(Some(if k < joints { Role::Position } else { Role::Torque }));
    }
    doubts.push(format!(
        "no line names the columns: {}; positions are taken to come first, and then as many torques",
        described(layout)
    ));
    readings
}

/// Share of the rows at which a column is greater than at the row before (1).
fn rises(values: &[f64]) -> f64 {
    let up = values.windows(2).filter(|pair| pair[1] > pair[0]).count();
    up as f64 / values.len().saturating_sub(1).max(1) as f64
}

/// The columns with their ranges, for messages.
fn described(layout: &Layout) -> String {
    let name = |column: usize| {
        let name = layout.names.as_ref().map(|names| format!(" `{}`", escaped(&names[column])));
        format!("column {}{}", column + 1, name.unwrap_or_default())
    };
    let columns = (0..layout.columns.len()).map(|column| match range(&layout.columns[column]) {
        Some([low, high]) if layout.is_numeric[column] => {
            format!("{} from {} to {}", name(column), coarse(low), coarse(high))
        }
        _ => format!("{} no numbers", name(column)),
    });
    columns.collect::<Vec<_>>().join(", ")
}

/// Least and greatest of the numbers among `values`.
fn range(values: &[f64]) -> Option<[f64; 2]> {
    let finite = || values.iter().copied().filter(|value| value.is_finite());
    Some([finite().reduce(f64::min)?, finite().reduce(f64::max)?])
}

/// Positions with their torques: those whose names have the same rest, else in their order.
fn pairs(
    readings: &[Reading],
    positions: &[usize],
    torques: &[usize],
    doubts: &mut Vec<String>,
) -> Vec<(usize, usize)> {
    let same = |position: &usize| {
        let mut found = torques.iter().filter(|torque| readings[**torque].rest == readings[*position].rest);
        found.next().filter(|_| found.next().is_none()).map(|torque| (*position, *torque))
    };
    let mut pairs: Vec<(usize, usize)> = positions.iter().filter_map(same).collect();
    let distinct: HashSet<usize> = pairs.iter().map(|pair| pair.1).collect();
    if distinct.len() < pairs.len() {
        pairs.clear();
    }
    let others = |all: &[usize], taken: Vec<usize>| -> Vec<usize> {
        all.iter().copied().filter(|column| !taken.contains(column)).collect()
    };
    let [left_positions, left_torques] = [
        others(positions, pairs.iter().map(|pair| pair.0).collect()),
        others(torques, pairs.iter().map(|pair| pair.1).collect()),
    ];
    if left_positions.len().min(left_torques.len()) > 0 && positions.len() > 1 {
        doubts.push("torques are given to positions in their order where no name tells".to_owned());
    }
    pairs.extend(left_positions.into_iter().zip(left_torques));
    pairs.sort_unstable();
    let left = positions.len().max(torques.len()) - pairs.len().min(MAX_AXES);
    if left > 0 {
        doubts.push(format!("{left} more columns of positions or torques are left out"));
    }
    pairs.truncate(MAX_AXES);
    pairs
}

fn joint(layout: &Layout, readings: &[Reading], pair: (usize, usize), doubts: &mut Vec<String>) -> GuessedJoint {
    let (position, torque) = pair;
    let rests = [position, torque].map(|column| readings[column].rest.as_str());
    let name = match rests.into_iter().find(|rest| !rest.is_empty()).unwrap_or(&readings[position].label) {
        "" => format!("joint {}", position + 1),
        rest if rest.chars().all(|c| c.is_ascii_digit()) => format!("joint {rest}"),
        rest => csv::plain(rest),
    };
    let turns = range(&layout.columns[position]).is_some_and(|[low, high]| high.max(-low) > GREATEST_ANGLE);
    for column in [position, torque] {
        if let Some(unknown) = &readings[column].unknown {
            let what = "which is none that is known: give its factor to SI by `scale`, and no `unit`";
            doubts.push(format!("{name}: the name of column {} says {}, {what}", column + 1, escaped(unknown)));
        }
    }
    let turns = turns && readings[position].unknown.is_none();
    let unit = readings[position].unit.or_else(|| {
        let unit = if turns { "deg" } else { "rad" };
        doubts.push(format!("{name}: the position is taken to be in {unit}"));
        ColumnUnit::named(unit)
    });
    let slides = unit.is_some_and(|unit| unit.si == "m");
    let unit_of_torque = readings[torque].unit.or_else(|| {
        let unit = if slides { "N" } else { "N m" };
        doubts.push(format!("{name}: the torque is taken to be in {unit}"));
        ColumnUnit::named(unit)
    });
    let is_force = unit_of_torque.is_some_and(|unit| unit.si == "N");
    if is_force != slides {
        let other = if slides { "a sliding joint has a force in N" } else { "a turning joint has a torque in N m" };
        doubts.push(format!("{name}: {other}: multiply by the lever by `scale`, or take another column"));
    }
    let of_motor = readings[torque].label.contains("motor");
    let position = GuessedColumn::new(layout, position, unit);
    GuessedJoint { name, position, torque: GuessedColumn::new(layout, torque, unit_of_torque), of_motor }
}

/// The column of time, in seconds.
fn time(layout: &Layout, readings: &[Reading], column: usize, doubts: &mut Vec<String>) -> GuessedColumn {
    let values = &layout.columns[column];
    let unit = readings[column].unit.or_else(|| {
        let mut steps: Vec<f64> = values.windows(2).map(|pair| pair[1] - pair[0]).filter(|step| *step > 0.0).collect();
        steps.sort_unstable_by(f64::total_cmp);
        let period = steps.get(steps.len() / 2).copied().unwrap_or_default();
        let unit = if period >= LONGEST_PERIOD { "ms" } else { "s" };
        doubts.push(format!("the time is taken to be in {unit}: rows are {} apart", coarse(period)));
        ColumnUnit::named(unit)
    });
    GuessedColumn::new(layout, column, unit)
}

/// What is written.
struct MappingFacts<'a> {
    layout: &'a Layout,
    time: Option<GuessedColumn>,
    joints: Vec<GuessedJoint>,
    effort: Effort,
    /// Speed of the first joint below which it stands still, and the sides of the cells, where rows are averaged.
    average: Option<(f64, Vec<f64>)>,
}

impl MappingFacts<'_> {
    fn complete(mut self, log: &Path, mut doubts: Vec<String>) -> GuessedMapping {
        let ranges: Vec<f64> = self
            .joints
            .iter()
            .map(|joint| range(&joint.position.values).map_or(0.0, |[low, high]| high - low))
            .collect();
        let pulls = pull(self.joints.iter().map(|joint| (&joint.position.values[..], &joint.torque.values[..])));
        if pulls > 0.0 || self.joints.iter().any(|joint| joint.of_motor) {
            self.effort = Effort::Motor;
        }
        let mut told = vec![match self.effort {
            Effort::Motor if pulls <= 0.0 => {
                "the torque is taken to be the motor's, as its name says, though it does not grow on the way in"
            }
            Effort::Motor => {
                "the torque is taken to be the motor's, which balances the contact: it grows on the way in; if it is the \
                 contact's own, the object would pull"
            }
            Effort::Contact if pulls < 0.0 => "the torque is taken to be the contact's own: it pushes the arm back",
            Effort::Contact => "nothing tells whether the torque is the contact's own or the motor's",
        }];
        told.push("torques must not contain the weight of the arm");
        self.average = self.to_and_fro().map(|still| (still, ranges.iter().map(|range| range / CELLS).collect()));
        if self.average.is_some() {
            told.push(
                "the first joint goes to and fro: the mean of both directions is taken, in which dry friction cancels",
            );
        }
        doubts.extend(told.into_iter().map(str::to_owned));
        let mut text = String::new();
        // Writing to a string fails only where memory does.
        let _ = self.write(&mut text, log, &doubts);
        GuessedMapping { text, doubts, steps: suggested_steps(&ranges) }
    }

    /// Speed below which the first joint stands still, where it goes to and fro.
    fn to_and_fro(&self) -> Option<f64> {
        let passed = |row: usize| self.time.as_ref().map_or(PERIOD, |time| time.values[row + 1] - time.values[row]);
        let steps = self.joints[0].position.values.windows(2).enumerate();
        let speeds = steps.map(|(row, q)| (q[1] - q[0]) / passed(row)).filter(|speed| speed.is_finite());
        let speeds: Vec<f64> = speeds.collect();
        let greatest = speeds.iter().fold(0.0, |greatest: f64, speed| greatest.max(speed.abs()));
        let still = STILL * greatest;
        let [up, down] = [1.0, -1.0].map(|sign| speeds.iter().filter(|speed| sign * **speed > still).count());
        (up.min(down) as f64 > TO_AND_FRO * (up + down) as f64).then_some(still)
    }

    fn write(&self, text: &mut String, log: &Path, doubts: &[String]) -> fmt::Result {
        let Self { layout, time, joints, effort, average, .. } = self;
        writeln!(text, "# Column mapping of {}, guessed. Check:", comment(&log.display().to_string()))?;
        doubts.iter().try_for_each(|doubt| writeln!(text, "# - {}", comment(doubt)))?;
        writeln!(text, "\n[table]\ndelimiter = {}", quoted(&layout.delimiter.to_string()))?;
        writeln!(text, "decimal = {}", quoted(&layout.decimal.to_string()))?;
        writeln!(text, "comment = {}\nheader = {}", quoted(layout.comment), layout.names.is_some())?;
        if layout.bad_rows > 0 {
            writeln!(text, "bad_rows = \"drop\"")?;
        }
        // Two columns of one name are told apart by their numbers.
        let column = |column: usize| match &layout.names {
            Some(names) if names.iter().filter(|name| **name == names[column]).count() == 1 => quoted(&names[column]),
            _ => (column + 1).to_string(),
        };
        let unit =
            |unit: Option<ColumnUnit>| unit.map_or(String::new(), |unit| format!(", unit = {}", quoted(unit.name)));
        writeln!(text, "\n[time]")?;
        match time {
            Some(time) => {
                writeln!(text, "column = {}", column(time.column))?;
                time.unit.iter().try_for_each(|unit| writeln!(text, "unit = {}", quoted(unit.name)))?;
            }
            None => writeln!(text, "period = {PERIOD}    # [s]")?,
        }
        for GuessedJoint { name, position, torque, .. } in joints {
            writeln!(text, "\n[[joint]]\nname = {}", quoted(name))?;
            for (key, quantity) in [("position", position), ("torque", torque)] {
                let [low, high] = range(&layout.columns[quantity.column]).unwrap_or_default().map(coarse);
                let (column, unit) = (column(quantity.column), unit(quantity.unit));
                writeln!(text, "{key} = {{ column = {column}{unit} }}    # {low} to {high}")?;
            }
        }
        let name = if *effort == Effort::Motor { "motor" } else { "contact" };
        writeln!(text, "\n[torque]\neffort = \"{name}\"")?;
        if let Some((still, cell)) = average {
            writeln!(text, "keep = \"average\"\nstill = {}", coarse(*still))?;
            writeln!(text, "cell = {}", list(cell, |side| coarse(*side)))?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::logs::{Mapping, import};
    use std::path::PathBuf;

    /// Angle (rad) and contact torque (N m) in row `k` of 1,000 at 1 kHz: two strokes onto a spring from 0.2 rad on.
    fn row(k: usize) -> [f64; 2] {
        let q = 0.3 * (1.0 - (TAU * k as f64 / 500.0).cos());
        [q, -3.0 * (q - 0.2).max(0.0)]
    }

    /// The log in `folder`, below this first line: of each row the time in milliseconds, the angle in degrees and the
    /// torque in N mm times `sign`, with what a program may put between them.
    fn log(folder: &Path, head: &str, sign: f64, delimiter: char, decimal: char) -> PathBuf {
        let file = folder.join("log.csv");
        let mut text = head.to_owned();
        for k in 0..1000 {
            let [q, torque] = row(k);
            let line = format!("{k}{delimiter}{:.6}{delimiter}{:.6}\n", q.to_degrees(), sign * 1e3 * torque);
            text += &line.replace('.', &decimal.to_string());
        }
        std::fs::write(&file, text).unwrap();
        file
    }

    #[test]
    fn what_is_guessed_reads_the_log_however_it_is_laid_out() {
        let folder = tempfile::tempdir().unwrap();
        for (head, delimiter, decimal) in [
            ("ms,elbow angle [deg],elbow torque [N mm]\n", ',', '.'),
            ("# a remark\nt (ms);elbow_pos_deg;elbow_effort_Nmm\n", ';', ','),
            ("time [ms]\telbow q (degrees)\telbow tau (N·mm)\n", '\t', '.'),
            ("stamp_ms elbow_theta_deg elbow_load_mNm\n", ' ', ','),
            ("sep=;\nms;elbow angle [deg];elbow torque [N mm]\n", ';', ','),
            ("ms|elbow angle [deg]|elbow torque [N mm]\n", '|', '.'),
            ("% one\n% two\n\u{feff}", ' ', '.'),
        ] {
            for sign in [1.0, -1.0] {
                let is_named = !head.ends_with('\u{feff}');
                let file = log(folder.path(), head.trim_end_matches('\u{feff}'), sign, delimiter, decimal);
                let GuessedMapping { mut text, doubts, steps } = guess(&file).unwrap();
                if !is_named {
                    // Nothing tells the unit of a torque that has no name.
                    assert!(doubts[0].contains("no line names the columns: column 1 from 0.0 to 999.0"), "{doubts:?}");
                    text = text.replace("\"N m\"", "\"N mm\"");
                }
                // Each row, not the mean of both directions.
                assert!(text.contains("keep = \"average\""), "{text}");
                let kept = text.split("keep = ").next().unwrap();
                let imported = import(&Mapping::parse(kept, &file).unwrap(), &[file], &mut |_| ()).unwrap();
                let samples = imported.samples;
                assert_eq!(samples.joints[0].name, if is_named { "elbow" } else { "joint 2" });
                assert_eq!((samples.len(), samples.joints[0].unit.as_str()), (1000, "rad"), "{text}");
                for (k, (q, torque)) in samples.configurations.iter().zip(&samples.torques).enumerate() {
                    let exact = row(k);
                    // Six decimals of a degree and of a newton millimetre.
                    assert!((q - exact[0]).abs() < 1e-8 && (torque - exact[1]).abs() < 1e-9, "{head}, {sign}, row {k}");
                }
                assert!((steps[0] - STEP * 0.6).abs() < 1e-6, "{steps:?}");
            }
        }
    }

    #[test]
    fn torques_go_to_the_joint_of_their_name_and_what_is_no_quantity_is_left_out() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("log.csv");
        let mut text = "index,time,tau_2 [Nm],tau_1 [Nm],q_1 [rad],q_2 [rad],dq_1,note\n".to_owned();
        (0..50).for_each(|k| text += &format!("{k},{k}.5,{},{},0.{k},1.{k},9,ok\n", -k, -2 * k));
        text += "1,2\n";
        std::fs::write(&file, text).unwrap();
        let GuessedMapping { text, .. } = guess(&file).unwrap();
        let mapping = Mapping::parse(&text, &file).unwrap();
        let columns = mapping.joints.iter().map(|joint| (&joint.name, &joint.position.column, &joint.torque.column));
        let named = |name: &str| crate::logs::ColumnName::Name(name.into());
        let expected = [("joint 1", "q_1 [rad]", "tau_1 [Nm]"), ("joint 2", "q_2 [rad]", "tau_2 [Nm]")];
        for ((name, position, torque), expected) in columns.zip(expected) {
            assert_eq!((name.as_str(), position, torque), (expected.0, &named(expected.1), &named(expected.2)));
        }
        assert_eq!(import(&mapping, &[file], &mut |_| ()).unwrap().samples.len(), 50, "the short row is dropped");
    }

    /// What is guessed of the table with this `head`, each row of which `row` writes.
    fn guessed(head: &str, row: impl Fn(usize) -> String) -> GuessedMapping {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("log.csv");
        std::fs::write(&file, format!("{head}\n{}", (0..200).map(|k| row(k) + "\n").collect::<String>())).unwrap();
        guess(&file).unwrap()
    }

    #[test]
    fn what_the_names_contradict_or_no_row_tells_is_said() {
        let q = |k: usize| (TAU * k as f64 / 100.0).sin();
        let told = |guessed: &GuessedMapping, what: &str| guessed.doubts.iter().any(|doubt| doubt.contains(what));
        let unknown = guessed("t [s],q [mrad],tau [ozf in]", |k| format!("0.{k:03},{},{}", 400.0 * q(k), -q(k)));
        assert!(told(&unknown, "column 2 says mrad, which is none") && told(&unknown, "column 3 says ozf in"));
        assert!(unknown.text.contains("column = \"q [mrad]\", unit = \"rad\""), "{}", unknown.text);
        // Whole seconds beside their fractions; a joint that stands; a torque that drops out; the motor's by its name.
        let seconds = guessed("sec,nanosec,q,q2,tau_motor,tau2", |k| {
            let torque = if k % 5 == 0 { String::new() } else { (-q(k)).to_string() };
            format!("{},{},{},0.5,{torque},0", k / 100, k % 100 * 10_000_000, q(k))
        });
        assert!(told(&seconds, "no column is the time") && seconds.text.contains("period = 0.001"));
        assert!(
            told(&seconds, "do not move are left out: joint 2") && seconds.steps.len() == 1,
            "{:?}",
            seconds.doubts
        );
        assert!(told(&seconds, "as its name says, though") && seconds.text.contains("keep = \"average\""));
        assert!(seconds.text.contains("bad_rows = \"drop\""), "{}", seconds.text);
        let free = guessed("t,q,tau,q_des", |k| format!("0.{k:03},{},0,9", q(k)));
        assert!(told(&free, "nothing tells whether the torque is") && free.steps.len() == 1);
    }

    #[test]
    fn a_log_of_which_nothing_can_be_guessed_is_refused_with_its_columns() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("log.csv");
        for (text, expected) in [
            ("time,velocity\n1,2\n2,3\n", "no column looks like a joint's position: column 1 `time` from 1.0 to 2.0"),
            ("time,angle\n1,2\n2,3\n", "a joint's torque: column 1 `time` from 1.0 to 2.0, column 2 `angle`"),
            ("<html>\n<body>\n", "no table of numbers"),
            ("", "no table of numbers"),
            ("t,q,tau\n1,2,3\n2,2,3\n", "no joint moves in its rows"),
        ] {
            std::fs::write(&file, text).unwrap();
            let error = guess(&file).unwrap_err().to_string();
            assert!(error.contains("log.csv") && error.contains(expected), "{text:?}: {error}");
        }
    }
}
