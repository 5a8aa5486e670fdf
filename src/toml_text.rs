//! Lines, values and comments of a scene file, as a person would have written them.

use crate::names::{escaped, is_disruptive};
use glam::DVec3;
use std::fmt::Write;

/// Writes a heading as wide as those of the scenes that ship.
pub fn heading(text: &mut String, title: &str) -> std::fmt::Result {
    writeln!(text, "\n# ---- {title} {}\n", "-".repeat(112_usize.saturating_sub(title.len())))
}

/// Writes a key with its value and a comment.
pub fn entry(text: &mut String, key: &str, value: &str, meaning: &str) -> std::fmt::Result {
    let assignment = format!("{key} = {value}");
    if meaning.is_empty() {
        writeln!(text, "{assignment}")
    } else {
        writeln!(text, "{assignment:<39} # {}", comment(meaning))
    }
}

/// Returns text that stays within a comment.
pub fn comment(text: &str) -> String {
    text.chars().map(|c| if is_disruptive(c) { ' ' } else { c }).collect()
}

/// Returns `text` as a TOML string in which every character is seen.
pub fn quoted(text: &str) -> String {
    if !text.contains(is_disruptive) {
        return toml::Value::from(text).to_string();
    }
    format!("\"{}\"", escaped(&text.replace('\\', "\\\\").replace('"', "\\\"")))
}

/// Returns `values` as a TOML array.
pub fn list<T>(values: &[T], each: impl FnMut(&T) -> String) -> String {
    format!("[{}]", values.iter().map(each).collect::<Vec<_>>().join(", "))
}

/// Returns `v` as a TOML array.
pub fn vector(v: DVec3, decimals: usize) -> String {
    list(&v.to_array(), |x| number(*x, decimals))
}

/// Returns `x` with at most `decimals` decimals, and at least one.
pub fn number(x: f64, decimals: usize) -> String {
    let text = format!("{x:.decimals$}");
    let trimmed = text.trim_end_matches('0');
    match trimmed.strip_suffix('.').unwrap_or(trimmed) {
        "-0" | "0" => "0.0".to_owned(),
        whole if !whole.contains('.') => format!("{whole}.0"),
        fraction => fraction.to_owned(),
    }
}

/// Returns `x` to six significant digits.
pub fn significant(x: f64) -> String {
    plain(&format!("{x:.5e}"))
}

/// Returns `x` to three significant digits.
pub fn coarse(x: f64) -> String {
    plain(&format!("{x:.2e}"))
}

/// Returns a number in scientific notation as one reads it more easily.
fn plain(scientific: &str) -> String {
    let x: f64 = scientific.parse().unwrap_or_default();
    if x == 0.0 || (1e-4..1e6).contains(&x.abs()) { format!("{x:?}") } else { format!("{x:e}") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn strings_are_read_as_they_were_and_show_what_is_in_them() {
        for text in ["", "elbow [rad]", "a \"b\" \\ c", "a\nb\u{202e}\\\"c\u{0}", "'\u{2028}"] {
            let written = quoted(text);
            assert!(!written.contains(is_disruptive), "{written}");
            assert_eq!(toml::from_str::<toml::Table>(&format!("a = {written}")).unwrap()["a"].as_str(), Some(text));
        }
    }

    #[test]
    fn numbers_are_short_and_have_a_point() {
        assert_eq!(
            [0.0, -0.0, 1.0, 0.25, -1e-12, 0.392_25].map(|x| number(x, 9)),
            ["0.0", "0.0", "1.0", "0.25", "0.0", "0.39225"]
        );
        assert_eq!([0.0, 1234.56789, 1.2e-7, 0.01].map(significant), ["0.0", "1234.57", "1.2e-7", "0.01"]);
        assert_eq!([2.345_678, 1e7].map(coarse), ["2.35", "1e7"]);
    }
}
