//! How a table of text is laid out, guessed from its first lines.

use super::super::rows::number;
use crate::{
    Error,
    csv::{Lines, fields},
};
use std::path::Path;

/// Lines that are looked at (1): twenty seconds of a log at 1 kHz.
const LINES: usize = 20_000;

/// Longest file of which the first lines are read (bytes).
const LARGEST: u64 = u64::MAX;

/// Share of a column's fields that must be numbers for it to be one (1), and of the rows that must be whole: a sensor may
/// drop out.
const NUMERIC: f64 = 0.5;

/// Delimiters and decimal marks that are tried. Where several fit alike, the first is taken.
const LAYOUTS: [(char, char); 9] =
    [(',', '.'), (';', '.'), ('\t', '.'), ('|', '.'), (' ', '.'), (';', ','), ('\t', ','), ('|', ','), (' ', ',')];

/// What begins a comment, or the line by which a spreadsheet names its delimiter.
const COMMENTS: [&str; 5] = ["#", "%", "//", "!", "sep="];

/// A table as it seems to be laid out, and its first rows.
pub(super) struct Layout {
    pub delimiter: char,
    pub decimal: char,
    /// What its comments begin with; empty where there are none.
    pub comment: &'static str,
    /// Names of the columns, where a line names them.
    pub names: Option<Vec<String>>,
    /// The numbers of each column; not a number where a field is none.
    pub columns: Vec<Vec<f64>>,
    /// Whether each column is one of numbers.
    pub is_numeric: Vec<bool>,
    /// Rows that have another number of fields, or a field that is no number in a column of numbers.
    pub bad_rows: usize,
}

impl Layout {
    /// Looks at the first lines of the table in `file`.
    ///
    /// # Errors
    /// When it cannot be read, or is no table of numbers.
    pub fn read(file: &Path) -> Result<Self, Error> {
        let mut lines = Lines::open(file, LARGEST, "")?;
        let (mut line, mut texts) = (Vec::new(), Vec::new());
        while texts.len() < LINES
            && let Some(text) = lines.next(&mut line)?
        {
            if texts.is_empty() && std::str::from_utf8(text).is_err() {
                let what = "the line is not UTF-8: convert the file, for example by `iconv -f CP1252 -t UTF-8 FILE`";
                return Err(lines.error(what));
            }
            let text = String::from_utf8_lossy(text).trim_end().to_owned();
            if !text.is_empty() {
                texts.push(text);
            }
        }
        let comment = COMMENTS.into_iter().find(|mark| texts.first().is_some_and(|text| text.starts_with(mark)));
        let comment = comment.unwrap_or_default();
        if !comment.is_empty() {
            texts.retain(|text| !text.starts_with(comment));
        }
        let layouts = LAYOUTS.into_iter().filter_map(|layout| Self::of(&texts, layout, comment));
        // Of those that fit alike the first.
        let best = layouts.reduce(|best, other| if other.fit() > best.fit() { other } else { best });
        best.ok_or_else(|| {
            Error::at(
                file,
                "this is no table of numbers: give a file with a row for each time, and a column for each \
                             position and torque",
            )
        })
    }

    /// The table `texts`, laid out so; none where it has no two columns of numbers.
    fn of(texts: &[String], (delimiter, decimal): (char, char), comment: &'static str) -> Option<Self> {
        let of = |text: &String| fields(text, delimiter).map(str::to_owned).collect::<Vec<_>>();
        let numbers = |fields: &[String]| fields.iter().map(|field| number(field, decimal)).collect::<Vec<_>>();
        let (first, rest) = texts.split_first()?;
        let first = of(first);
        let is_header = numbers(&first).iter().filter(|field| field.is_some()).count() * 2 < first.len();
        let rows = (!is_header).then(|| first.clone()).into_iter().chain(rest.iter().map(of));
        let (mut columns, mut bad_rows) = (vec![Vec::new(); first.len()], 0);
        for row in rows {
            if row.len() == first.len() {
                for (column, value) in columns.iter_mut().zip(numbers(&row)) {
                    column.push(value.unwrap_or(f64::NAN));
                }
            } else {
                bad_rows += 1;
            }
        }
        let rows = columns.first().map_or(0, Vec::len);
        let finite = |column: &Vec<f64>| column.iter().filter(|value| value.is_finite()).count();
        let is_numeric: Vec<bool> =
            columns.iter().map(|column| rows > 0 && finite(column) as f64 >= NUMERIC * rows as f64).collect();
        let of_numbers = || columns.iter().zip(&is_numeric).filter(|(_, numeric)| **numeric);
        bad_rows += (0..rows).filter(|&row| of_numbers().any(|(column, _)| column[row].is_nan())).count();
        let names = is_header.then_some(first);
        let found = of_numbers().count() >= 2 && (bad_rows as f64) < (1.0 - NUMERIC) * (rows + bad_rows) as f64;
        found.then_some(Self { delimiter, decimal, comment, names, columns, is_numeric, bad_rows })
    }

    /// How well it fits: the share of its columns that are numbers, and how many these are.
    fn fit(&self) -> (f64, usize) {
        let numeric = self.is_numeric.iter().filter(|numeric| **numeric).count();
        (numeric as f64 / self.columns.len() as f64, numeric)
    }
}
