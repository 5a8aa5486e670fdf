//! Comma-separated text as it is written: the one way of all tables.

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

/// Returns `text` as one field (RFC 4180).
pub(crate) fn quoted(text: &str) -> String {
    if text.contains([',', '"', '\n', '\r']) { format!("\"{}\"", text.replace('"', "\"\"")) } else { text.into() }
}

/// Returns a name without the characters that structure a table, for readers that know no quotes.
pub(crate) fn plain(name: &str) -> String {
    name.replace([',', '"', '\n', '\r'], "_")
}
