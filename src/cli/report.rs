//! What a subcommand returns: one value, printed as text for people or as JSON for programs.

use super::Failure;
use serde::Serialize;
use std::{
    fmt::{self, Display},
    path::Path,
};

/// The result of a subcommand.
pub struct Report {
    /// For people.
    pub text: String,
    /// For programs: one object.
    pub json: serde_json::Value,
    /// False where something is missing from the result (unfinished, or not as it should be): exit code 1.
    pub whole: bool,
}

impl Report {
    /// Returns the report of a `result` that is whole.
    ///
    /// # Errors
    /// If `result` cannot be written as JSON.
    pub fn new(result: &(impl Describe + Serialize)) -> Result<Self, Failure> {
        let mut text = Text::default();
        result.describe(&mut text);
        Ok(Self { text: text.to_string(), json: serde_json::to_value(result)?, whole: true })
    }

    /// Returns the report of a `result` that may lack something.
    ///
    /// # Errors
    /// As for [`Self::new`].
    pub fn of(result: &(impl Describe + Serialize), whole: bool) -> Result<Self, Failure> {
        Ok(Self { whole, ..Self::new(result)? })
    }
}

/// What can be described to people.
pub trait Describe {
    /// Adds the description.
    fn describe(&self, text: &mut Text);
}

impl<T: Describe> Describe for Option<T> {
    fn describe(&self, text: &mut Text) {
        self.iter().for_each(|described| described.describe(text));
    }
}

/// Text for people: lines, and rows of a label and what it labels.
#[derive(Default)]
pub struct Text(Vec<Entry>);

enum Entry {
    Line(String),
    Row(String, String),
}

/// Width of labels, unless one of the rows around has a longer one: rows of different commands stand alike (characters).
const LABEL: usize = 12;

/// Greatest width for the sake of a long label (characters): joints may have long names.
const LONGEST_LABEL: usize = 24;

impl Text {
    /// Adds a line.
    pub fn line(&mut self, line: impl Display) {
        self.0.push(Entry::Line(line.to_string()));
    }

    /// Adds a row. An empty label continues the row above.
    pub fn row(&mut self, label: impl Into<String>, value: impl Display) {
        self.0.push(Entry::Row(label.into(), value.to_string()));
    }

    /// Adds rows under one label.
    pub fn rows(&mut self, label: &str, values: impl IntoIterator<Item = impl Display>) {
        let labels = std::iter::once(label).chain(std::iter::repeat(""));
        labels.zip(values).for_each(|(label, value)| self.row(label, value));
    }
}

impl Display for Text {
    /// Writes lines as they are; rows that follow one another have their values below one another.
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        for block in self.0.chunk_by(|a, b| matches!((a, b), (Entry::Row(..), Entry::Row(..)))) {
            let widths = block.iter().map(|entry| match entry {
                Entry::Line(_) => 0,
                Entry::Row(label, _) => label.chars().count(),
            });
            let width = widths.max().unwrap_or(0).clamp(LABEL, LONGEST_LABEL);
            for entry in block {
                match entry {
                    Entry::Line(line) => writeln!(formatter, "{line}")?,
                    Entry::Row(label, value) => writeln!(formatter, "  {label:<width$} {value}")?,
                }
            }
        }
        Ok(())
    }
}

/// Returns the names of `files`, as they are printed.
pub fn names(files: &[impl AsRef<Path>]) -> Vec<String> {
    files.iter().map(|file| file.as_ref().display().to_string()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_of_rows_stand_below_one_another_and_lines_part_them() {
        let mut text = Text::default();
        text.line("head");
        text.rows("one", ["1", "2"]);
        text.row("a longer label", 3);
        text.line("apart");
        text.row("x".repeat(30), 4);
        text.row("y", 5);
        let expected = format!(
            "head\n  one            1\n                 2\n  a longer label 3\napart\n  {} 4\n  y{} 5\n",
            "x".repeat(30),
            " ".repeat(23)
        );
        assert_eq!(text.to_string(), expected);
    }
}
