//! Tables of text: the one way in which they are written, and in which their lines are read.

use crate::{
    Error, input,
    names::{escaped, is_disruptive},
};
use std::{
    fmt::Display,
    fs::File,
    io::{self, BufRead, BufReader, Read, Write},
    path::{Path, PathBuf},
};

/// Longest line that is read (bytes); a binary file has no line ends.
pub(crate) const LONGEST_LINE: u64 = 1 << 20;

/// The lines of a table, read one at a time: nothing of the text is held but the caller's line.
pub(crate) struct Lines<R> {
    file: PathBuf,
    reader: R,
    /// Number of the line read last, from 1.
    pub number: u64,
    /// Bytes read so far.
    pub bytes: u64,
}

impl Lines<BufReader<File>> {
    /// Opens `file`, unless it is larger than `greatest` bytes, where `remedy` is what it is not or what to do.
    pub fn open(file: &Path, greatest: u64, remedy: &'static str) -> Result<Self, Error> {
        let opened = input::open(file).and_then(|opened| Ok((opened.metadata()?.len(), opened)));
        match opened {
            Err(source) => Err(Error::unreadable(file, &source)),
            Ok((length, _)) if length > greatest => {
                Err(Error::at(file, format_args!("larger than {greatest} bytes: {remedy}")))
            }
            Ok((_, opened)) => Ok(Self::new(file, BufReader::new(opened))),
        }
    }
}

impl<R: BufRead> Lines<R> {
    /// The lines of `reader`, which messages call `file`.
    pub fn new(file: &Path, reader: R) -> Self {
        Self { file: file.into(), reader, number: 0, bytes: 0 }
    }

    /// An error in the line read last.
    pub fn error(&self, what: impl Display) -> Error {
        // An empty file ends on its first line.
        Error::on_line(&self.file, self.number.max(1), what)
    }

    /// Reads a line into `line`, without its end and without a byte order mark; none at the end of the text.
    pub fn next<'l>(&mut self, line: &'l mut Vec<u8>) -> Result<Option<&'l [u8]>, Error> {
        line.clear();
        let read = self.reader.by_ref().take(LONGEST_LINE).read_until(b'\n', line);
        let read = read
            .map_err(|source| source.downcast().unwrap_or_else(|source| Error::unreadable(&self.file, &source)))?
            as u64;
        if read == 0 {
            return Ok(None);
        }
        self.number += 1;
        self.bytes += read;
        if read == LONGEST_LINE && !line.ends_with(b"\n") {
            let what = format!("the line is longer than {LONGEST_LINE} bytes: this is not a table of text");
            return Err(self.error(what));
        }
        while line.last().is_some_and(|byte| matches!(byte, b'\n' | b'\r')) {
            line.pop();
        }
        let mark: &[u8] = if self.number == 1 { "\u{feff}".as_bytes() } else { b"" };
        Ok(Some(line.strip_prefix(mark).unwrap_or(line)))
    }

    /// Reads a line of text into `line`, as [`Lines::next`] does.
    pub fn next_text<'l>(&mut self, line: &'l mut Vec<u8>) -> Result<Option<&'l str>, Error> {
        let text = self.next(line)?.map(std::str::from_utf8).transpose();
        text.map_err(|_| self.error("not text in UTF-8"))
    }
}

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
    fn lines_are_numbered_and_none_is_longer_than_a_table_has() {
        let lines = |text: &[u8]| -> Result<Vec<(u64, String)>, String> {
            let (mut lines, mut line, mut found) = (Lines::new(Path::new("t.csv"), text), Vec::new(), Vec::new());
            while let Some(text) = lines.next_text(&mut line).map_err(|error| error.to_string())? {
                let text = text.to_owned();
                found.push((lines.number, text));
            }
            assert_eq!(lines.bytes, text.len() as u64);
            Ok(found)
        };
        let rows = |texts: [&str; 3]| (1..).zip(texts.map(str::to_owned)).collect::<Vec<_>>();
        assert_eq!(lines(b"\xef\xbb\xbfa,b \r\n\n1,2").unwrap(), rows(["a,b ", "", "1,2"]));
        assert_eq!(lines(b"a\n\xef\xbb\xbfb\n \n").unwrap(), rows(["a", "\u{feff}b", " "]));
        assert_eq!(lines(b"").unwrap(), []);
        assert_eq!(lines(b"a\n\xff\n").unwrap_err(), "t.csv:2: not text in UTF-8");
        let longest = LONGEST_LINE as usize - 1;
        let with_end = [vec![b'x'; longest], vec![b'\n', b'y']].concat();
        assert_eq!(lines(&with_end).unwrap().len(), 2);
        let refused = lines(&vec![b'x'; longest + 1]).unwrap_err();
        assert!(refused.starts_with("t.csv:1: the line is longer"), "{refused}");
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
