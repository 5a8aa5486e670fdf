//! What each command prints: the keys of its JSON, which other programs rely on, and its text, but for numbers.
//!
//! Compared with `tests/snapshots/printed.txt`; with `UPDATE_SNAPSHOTS=1` that file is written again.

use super::{
    commands::{FINGER, changed, without_grid},
    demo::{FOR_PEOPLE, FOR_PROGRAMS},
};
use crate::common::program::{haptize, text};
use serde_json::Value;
use std::{collections::BTreeMap, fmt::Write, fs, path::Path};

/// The file that is compared with.
const SNAPSHOT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/snapshots/printed.txt");

/// A motion of the finger that presses the ball.
const MOTION: &str = "[motion]\npress = [{ time = 0.0, q = [0.05] }, { time = 0.4, q = [0.22] }]\n";

/// Two joints before a wall, and a plan of twelve configurations.
const PLAN: &str = r#"name = "plan"
[[proxy.joint]]
name = "shoulder"
kind = "revolute"
axis = [1.0, 0.0, 0.0]
origin = [0.0, 0.0, 0.125]
limits = [0.0, 1.75]
rotor_inertia = 5e-4
[[proxy.joint]]
name = "elbow"
kind = "revolute"
origin = [0.0, 0.134, 0.0]
axis = [1.0, 0.0, 0.0]
limits = [-0.739, 1.32]
rotor_inertia = 5e-4
nodes = [{ at = [0.0, 0.0, -0.1325] }]
[scan.joints]
axes = [{ start = 0.18, stop = 0.36, count = 4 }, { start = 0.08, stop = 0.14, count = 3 }]
[scan.control]
stiffness = 4.0
damping = 0.15
[scan.limits]
torque = 0.19
workspace = [[-0.3, -0.1, -0.3], [0.3, 0.3, 0.3]]
[scan.simulated]
corner = [0.0, 0.0, 0.0]
size = [0.1, 0.1, 0.1]
"#;

/// A turning arm of two links with a ball at its tip, and a soft ball within its reach.
const ARM: &str = r#"[object]
sphere = { radius = 0.04, edge = 0.01, centre = [0.3, 0.1, 0.05] }
skin = { tension = 100.0, width = 0.03, foundation = 4e4 }
[contact]
stiffness = 200.0
[[proxy.joint]]
kind = "revolute"
axis = [0, 0, 1]
limits = [-3.0, 3.0]
[[proxy.joint]]
origin = [0, 0, 0.1]
kind = "revolute"
axis = [0, 1, 0]
limits = [-1.5, 1.5]
[[proxy.joint]]
origin = [0.25, 0, 0]
kind = "revolute"
axis = [0, 1, 0]
limits = [-2.5, 2.5]
nodes = [{ at = [0.1, 0, 0] }, { at = [0.2, 0, 0], radius = 0.005 }]
"#;

/// Torque of a slide that is pressed and let go, with friction, 1,000 rows a second.
fn log() -> String {
    let row = |k: usize| {
        let phase = k as f64 * 0.01;
        format!("{},{}\n", 0.01 * phase.sin(), 0.5 * phase.sin() + 0.05 * phase.cos().signum())
    };
    (0..2000).map(row).fold("a,t\n".to_owned(), |log, row| log + &row)
}

const COLUMNS: &str = r#"[table]
header = true
[time]
period = 0.001
[[joint]]
name = "a"
unit = "m"
position = { column = "a" }
torque = { column = "t", unit = "N" }
[filter]
speed_rows = 25
decimate = 1
[torque]
effort = "contact"
keep = "average"
lead = "a"
still = 0.001
cell = [0.002]
"#;

/// Commands in the order in which they run, in one folder.
const COMMANDS: [&[&str]; 38] = [
    &["new", "--from", "mesh", "-o", "my.toml"],
    &["bake", "finger.toml", "--backend", "cpu"],
    &["bake", "finger.toml", "--backend", "cpu", "--max-error", "5%", "-o", "chosen.haptize"],
    &["bake", "finger.toml", "--backend", "cpu", "--max-error", "10%", "--refine", "2", "-o", "refined.haptize"],
    &["bake", "finger.toml", "--backend", "cpu", "--shard", "0/2", "-o", "parts"],
    &["bake", "finger.toml", "--backend", "cpu", "--shard", "0/2", "-o", "parts"],
    &["merge", "parts", "-o", "merged.haptize"],
    &["bake", "finger.toml", "--backend", "cpu", "--shard", "1/2", "-o", "parts"],
    &["merge", "parts", "-o", "merged.haptize"],
    &["bake", "up.toml", "--backend", "cpu"],
    &["plan", "finger.toml", "--shards", "4", "--cores", "2"],
    &["reach", "open.toml", "--backend", "cpu"],
    &["reach", "open.toml", "--backend", "cpu", "--write"],
    &["place", "open.toml"],
    &["place", "arm.toml"],
    &["place", "arm.toml", "--write"],
    &["info", "finger.haptize"],
    &["info", "refined.haptize"],
    &["inspect", "finger.toml", "--q", "0.2"],
    &["inspect", "finger.haptize", "--q", "50%"],
    &["export", "finger.haptize", "--format", "csv"],
    &["export", "finger.haptize", "--format", "csv"],
    &["export", "finger.haptize", "--format", "npz"],
    &["play", "finger.haptize", "--record", "session.csv", "-o", "played"],
    &["play", "finger.haptize", "--record", "session.csv", "-o", "played"],
    &["play", "finger.haptize", "--replay", "session.csv", "-o", "played"],
    &["play", "finger.toml", "-o", "live"],
    &["scan", "plan.toml", "--plan-out", "plan-rows.csv"],
    &["scan", "plan.toml"],
    &["gridize", "plan.csv", "--step", "0.03", "--held-out", "0.2", "--against", "plan.csv"],
    &["gridize", "log.csv", "--columns", "columns.toml", "--step", "0.002", "--figures", "drawn"],
    &["import", "finger.urdf", "--tip", "distal", "-o", "imported.toml"],
    &["device", "list"],
    &["doctor"],
    &["man", "-o", "pages"],
    &["completions", "fish"],
    &["accuracy", "finger.toml", "--configurations", "20", "--points", "100", "--rounds", "1", "-o", "costs"],
    &[],
];

/// Commands whose text is that of the machine, or a file's own: only its JSON is compared.
const TEXT_APART: [&str; 3] = ["doctor", "completions", "device list"];

/// How lines begin that depend on how busy the machine is, or hold a hash.
const UNSTEADY: [&str; 3] = ["  late ", "  missed ", "parts/"];

/// Objects whose keys are not fixed: names of clamps and reasons.
const OPEN: [&str; 2] = ["clamped", "halted"];

/// Puts `#` in the place of every number, and of runs of them.
fn without_numbers(text: &str) -> String {
    let mut masked = String::new();
    let mut rest = text;
    while let Some(start) = rest.find(|c: char| c.is_ascii_digit()) {
        let (before, number) = rest.split_at(start);
        masked.push_str(before.strip_suffix('-').unwrap_or(before));
        let is_part = |(at, c): (usize, char)| {
            let exponent = number[..at].ends_with('e') && c == '-';
            let begins = c == 'e' && number[at + 1..].starts_with(|c: char| c == '-' || c.is_ascii_digit());
            c.is_ascii_digit()
                || c == '.' && number[at + 1..].starts_with(|c: char| c.is_ascii_digit())
                || exponent
                || begins
        };
        let end = number.char_indices().find(|at| !is_part(*at)).map_or(number.len(), |(at, _)| at);
        masked.push('#');
        rest = &number[end..];
    }
    masked + rest
}

/// Returns where `text` counts one of something in the plural: a word that ends in s, or an irregular plural, behind a
/// one that is neither a part of a number nor a unit's.
fn ones_in_the_plural(text: &str) -> Vec<String> {
    let words: Vec<&str> = text.split_whitespace().collect();
    let irregular = ["axes", "vertices", "equilibria", "tetrahedra", "histories"];
    let noun = |word: &&str| {
        let word = word.trim_end_matches(|c: char| !c.is_alphanumeric());
        let is_word = word.len() > 2 && word.chars().all(|c| c.is_ascii_lowercase());
        is_word && (word.ends_with('s') && !word.ends_with("ss") || irregular.contains(&word))
    };
    // "1 grid points", "1 of its rows" is right.
    let is_plural = |at: usize| {
        let next = words.get(at + 1);
        next.is_some_and(|next| noun(next) && !["is", "has", "as", "was", "its"].contains(next))
            || next.is_some_and(|next| ["grid", "contact", "random", "free", "sampled"].contains(next))
                && words.get(at + 2).is_some_and(noun)
    };
    let ones = (0..words.len()).filter(|&at| words[at].trim_start_matches('(') == "1" && is_plural(at));
    ones.map(|at| words[at..words.len().min(at + 4)].join(" ")).collect()
}

/// Returns the keys of `values`, which stand at one place of an object: `{a {b} c [{d}]}`.
fn shape(values: &[&Value]) -> String {
    let elements: Vec<&Value> = values.iter().filter_map(|value| value.as_array()).flatten().collect();
    if !elements.is_empty() {
        let inner = shape(&elements);
        return if inner.is_empty() { inner } else { format!("[{inner}]") };
    }
    let mut entries: BTreeMap<&str, Vec<&Value>> = BTreeMap::new();
    for (key, value) in values.iter().filter_map(|value| value.as_object()).flatten() {
        entries.entry(key).or_default().push(value);
    }
    let entry = |(key, values): (&&str, &Vec<&Value>)| match shape(values) {
        inner if inner.is_empty() || OPEN.contains(key) => (*key).to_owned(),
        inner => format!("{key} {inner}"),
    };
    let entries: Vec<String> = entries.iter().map(entry).collect();
    if entries.is_empty() { String::new() } else { format!("{{{}}}", entries.join(" ")) }
}

/// Writes the scenes and tables that the commands read.
fn furnish(folder: &Path) {
    let write = |name: &str, text: &str| fs::write(folder.join(name), text).unwrap();
    write("finger.toml", &format!("{FINGER}{MOTION}"));
    let axis = "start = 0.0, stop = 0.28, count = 8";
    write("up.toml", &changed(axis, "start = -0.28, stop = -0.1, count = 8"));
    write("open.toml", &without_grid());
    write("arm.toml", ARM);
    write("plan.toml", PLAN);
    write("log.csv", &log());
    write("columns.toml", COLUMNS);
    let robot = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/robots/finger.urdf");
    fs::copy(robot, folder.join("finger.urdf")).unwrap();
}

#[test]
fn commands_print_what_they_always_printed() {
    let [for_people, for_programs] = [(); 2].map(|()| tempfile::tempdir().unwrap());
    [&for_people, &for_programs].into_iter().for_each(|folder| furnish(folder.path()));
    let mut printed = String::new();
    for arguments in COMMANDS {
        let (said, told) = match arguments {
            [] => (FOR_PEOPLE.output.clone(), FOR_PROGRAMS.output.clone()),
            _ => rayon::join(
                || haptize(for_people.path(), arguments),
                || haptize(for_programs.path(), &[arguments, &["--json"]].concat()),
            ),
        };
        let object: Value = serde_json::from_slice(&told.stdout).unwrap_or_default();
        let code = said.status.code();
        assert_eq!(code, told.status.code(), "{arguments:?}: {}{}", text(&said.stderr), text(&told.stderr));
        let command = arguments.join(" ");
        writeln!(printed, "\n$ haptize {command}    [{}]", code.unwrap_or(-1)).unwrap();
        if !TEXT_APART.contains(&command.split(" fish").next().unwrap()) {
            let lines = without_numbers(&text(&said.stdout).replace(std::env::consts::ARCH, "ARCH"));
            let steady = lines.lines().filter(|line| !UNSTEADY.iter().any(|start| line.starts_with(start)));
            steady.for_each(|line| writeln!(printed, "{line}").unwrap());
            let plural = [&said.stdout, &said.stderr].map(|said| ones_in_the_plural(&text(said)));
            assert_eq!(plural, [(); 2].map(|()| Vec::<String>::new()), "{arguments:?}");
        }
        writeln!(printed, "json: {}", shape(&[&object])).unwrap();
    }
    if std::env::var_os("UPDATE_SNAPSHOTS").is_some() {
        fs::write(SNAPSHOT, &printed).unwrap();
    }
    let expected = fs::read_to_string(SNAPSHOT).unwrap();
    let difference = printed.lines().zip(expected.lines()).find(|(now, before)| now != before);
    assert!(printed == expected, "{difference:?}\n{printed}");
}

#[test]
fn one_is_found_in_the_plural_alone() {
    for right in ["1 point, 21 points", "0.1 points", "1 of 2 rows", "1 grid point", "1 has none", "1 mm", "1 loss"] {
        assert_eq!(ones_in_the_plural(right), Vec::<String>::new());
    }
    assert_eq!(
        ones_in_the_plural("in 1 shards, (1 axes) at 1 grid points"),
        ["1 shards, (1 axes)", "(1 axes) at 1", "1 grid points"]
    );
}

#[test]
fn numbers_are_masked_and_words_are_not() {
    assert_eq!(without_numbers("1.5e-3 N, q1 = -0.2."), "# N, q# = #.");
    assert_eq!(without_numbers("10 to 20 mm, 1e9 e"), "# to # mm, # e");
}
