//! Comma-separated text: the one way in which all tables are written, and the fields of a line that is read.

use crate::names::{escaped, is_disruptive};
use std::{
    fmt::Display,
    io::{self, Write},
};

/// A table that is being written, field by field.
pub(crate) struct Table<W> {
    out: W,
    row_is_empty: bool,
}

impl<W: Write> Table<W> {
    /// Begins a table in `out`, or goes on with one at the beginning of a row.
    pub fn new(out: W) -> Self {
        Self { out, row_is_empty: true }
    }

    /// Appends a field.
    ///
    /// # Errors
    /// Those of the output, here and below.
    pub fn field(&mut self, field: impl Display) -> io::Result<&mut Self> {
        if !std::mem::take(&mut self.row_is_empty) {
            self.out.write_all(b",")?;
        }
        write!(self.out, "{field}")?;
        Ok(self)
    }

    /// Appends a field for each of `fields`.
    pub fn fields(&mut self, fields: impl IntoIterator<Item: Display>) -> io::Result<&mut Self> {
        for field in fields {
            self.field(field)?;
        }
        Ok(self)
    }

    /// Appends a field that is empty where there is nothing.
    pub fn optional(&mut self, field: Option<impl Display>) -> io::Result<&mut Self> {
        match field {
            Some(field) => self.field(field),
            None => self.field(""),
        }
    }

    /// Ends the row.
    pub fn end(&mut self) -> io::Result<()> {
        self.row_is_empty = true;
        self.out.write_all(b"\n")
    }

    /// Flushes the output.
    pub fn finish(mut self) -> io::Result<()> {
        self.out.flush()
    }
}

/// Returns `text` as one field (RFC 4180) of one line, which commands no terminal.
pub(crate) fn quoted(text: &str) -> String {
    let text = escaped(text);
    if text.contains([',', '"']) { format!("\"{}\"", text.replace('"', "\"\"")) } else { text.into_owned() }
}

/// Returns a name without the characters that structure a table, for readers that know no quotes.
pub(crate) fn plain(name: &str) -> String {
    name.replace(|c| matches!(c, ',' | '"') || is_disruptive(c), "_")
}

/// Returns the fields of a line, trimmed of blanks and quotation marks. Between quotation marks a delimiter is a
/// character like any other (RFC 4180). A blank as delimiter takes any run of blanks and tabs.
pub(crate) fn fields(text: &str, delimiter: char) -> impl Iterator<Item = &str> {
    let blank = delimiter == ' ';
    let parts = move |c: char| if blank { c.is_ascii_whitespace() } else { c == delimiter };
    let mut rest = Some(text);
    let split = std::iter::from_fn(move || {
        let text = rest?;
        let begin = end_of_quotation(text);
        let end = text[begin..].find(parts).map(|at| begin + at);
        rest = end.map(|end| &text[end + text[end..].chars().next().map_or(0, char::len_utf8)..]);
        Some(text[..end.unwrap_or(text.len())].trim().trim_matches('"'))
    });
    split.filter(move |field| !(blank && field.is_empty()))
}

/// Where the quotation ends with which `text` begins; 0 where there is none, or no end of it.
fn end_of_quotation(text: &str) -> usize {
    let blanks = text.len() - text.trim_start().len();
    let Some(quoted) = text[blanks..].strip_prefix('"') else { return 0 };
    // A doubled mark stands for itself.
    let mut from = 0;
    while let Some(at) = quoted[from..].find('"') {
        from += at + 1;
        if !quoted[from..].starts_with('"') {
            return blanks + 1 + from;
        }
        from += 1;
    }
    0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_field_is_one_line_that_commands_no_terminal() {
        for (text, field) in [
            ("torque a [N m]", "torque a [N m]"),
            ("a, \"b\"", "\"a, \"\"b\"\"\""),
            ("a\nb\u{1b}[2J\u{9b}c\u{202e}", "a\\u000ab\\u001b[2J\\u009bc\\u202e"),
        ] {
            assert_eq!(quoted(text), field);
        }
        assert_eq!(plain("a,b\"c\nd\u{1b}e\u{2028}f"), "a_b_c_d_e_f");
    }

    #[test]
    fn quotation_marks_hold_a_field_together() {
        let cases: [(&str, char, &[&str]); 8] = [
            ("a, \"b, c\" ,d", ',', &["a", "b, c", "d"]),
            ("\"a \"\"b, c\"\"\",d", ',', &["a \"\"b, c", "d"]),
            ("5\" probe,1,2\" probe,3", ',', &["5\" probe", "1", "2\" probe", "3"]),
            ("\"open,1", ',', &["open", "1"]),
            ("", ',', &[""]),
            (",", ',', &["", ""]),
            (" 1 \t 2  3", ' ', &["1", "2", "3"]),
            ("a│b│", '│', &["a", "b", ""]),
        ];
        for (text, delimiter, expected) in cases {
            assert_eq!(fields(text, delimiter).collect::<Vec<_>>(), expected, "{text}");
        }
    }
}
