//! What the name of a column says of it.

use super::super::units::ColumnUnit;

/// What a column holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Role {
    Time,
    Position,
    /// Of a joint, or a force.
    Torque,
}

/// Words for each role, in small letters. A word of the first line makes a column none of the others.
const OTHERS: &str = "velocity vel speed dq qd acceleration acc current voltage temperature temp stress strain des status \
                      state target setpoint desired reference ref command cmd error index";
const TIMES: &str = "time t timestamp stamp clock zeit";
const TORQUES: &str = "torque tau effort eff trq tq moment force f load motor";
const POSITIONS: &str = "position pos angle q joint theta phi displacement disp stroke encoder enc depth x y z";

/// A column's name, read.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Reading {
    pub role: Option<Role>,
    pub unit: Option<ColumnUnit>,
    /// The name without its unit.
    pub label: String,
    /// What is left of the name without role and unit: the joint.
    pub rest: String,
    /// What stands in brackets and is no unit that is known.
    pub unknown: Option<String>,
}

/// Reads the `name` of a column.
pub(super) fn read(name: &str) -> Reading {
    let (bare, bracketed) = split_brackets(name);
    let mut words = words(bare);
    let mut unit = bracketed.and_then(ColumnUnit::spelt);
    let unknown = bracketed.filter(|text| unit.is_none() && text.chars().any(char::is_alphabetic)).map(str::to_owned);
    if unit.is_none()
        && let Some(last) = words.last()
        // One letter is a name as well.
        && (last.chars().count() > 1 || words.len() > 1)
        && let Some(found) = ColumnUnit::spelt(last)
    {
        unit = Some(found);
        words.pop();
    }
    let label = words.join(" ");
    let is_of = |all: &str, word: &String| all.split(' ').any(|known| known == word);
    let is_other = words.iter().any(|word| is_of(OTHERS, word));
    let mut role = None;
    for (words_of, of) in [(TORQUES, Role::Torque), (TIMES, Role::Time), (POSITIONS, Role::Position)] {
        if role.is_none() && words.iter().any(|word| is_of(words_of, word)) {
            role = Some(of);
            words.retain(|word| !is_of(words_of, word));
        }
    }
    let by_unit = unit.map(|unit| match unit.si {
        "s" => Role::Time,
        "rad" | "m" => Role::Position,
        _ => Role::Torque,
    });
    let role = if is_other { None } else { by_unit.or(role) };
    Reading { role, unit, label, rest: words.join(" "), unknown }
}

/// Splits what stands in brackets from a name.
fn split_brackets(name: &str) -> (&str, Option<&str>) {
    let Some(begin) = name.find(['[', '(']) else { return (name, None) };
    let inside = &name[begin + 1..];
    (&name[..begin], Some(inside.find([']', ')']).map_or(inside, |end| &inside[..end])))
}

/// The words of a name, in small letters; digits behind a word are one of their own.
fn words(name: &str) -> Vec<String> {
    let mut words = Vec::new();
    for part in name.split(|c: char| !c.is_alphanumeric()).filter(|part| !part.is_empty()) {
        let part = part.to_lowercase();
        let digits = part.trim_end_matches(|c: char| c.is_ascii_digit()).len();
        let (word, number) = part.split_at(digits);
        words.extend([word, number].into_iter().filter(|part| !part.is_empty()).map(str::to_owned));
    }
    words
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_say_what_a_column_is_and_of_which_joint() {
        let of = |name: &str| {
            let Reading { role, unit, rest, .. } = read(name);
            (role, unit.map(|unit| (unit.factor, unit.si)), rest)
        };
        let degree = Some((std::f64::consts::PI / 180.0, "rad"));
        assert_eq!(of("q1"), (Some(Role::Position), None, "1".into()));
        assert_eq!(of("tau_2"), (Some(Role::Torque), None, "2".into()));
        assert_eq!(of("elbow angle [deg]"), (Some(Role::Position), degree, "elbow".into()));
        assert_eq!(of("elbow_effort"), (Some(Role::Torque), None, "elbow".into()));
        assert_eq!(of("Torque (N·mm)"), (Some(Role::Torque), Some((1e-3, "N m")), String::new()));
        assert_eq!(of("ms"), (Some(Role::Time), Some((1e-3, "s")), String::new()));
        assert_eq!(of("t_s"), (Some(Role::Time), Some((1.0, "s")), String::new()));
        assert_eq!(of("x [N]"), (Some(Role::Torque), Some((1.0, "N")), String::new()));
        assert_eq!(of("displacement_mm"), (Some(Role::Position), Some((1e-3, "m")), String::new()));
        for other in ["velocity [rad/s]", "q_target", "stress_kPa", "index"] {
            assert_eq!(read(other).role, None, "{other}");
        }
        assert_eq!(of("m"), (None, None, "m".into()));
    }
}
