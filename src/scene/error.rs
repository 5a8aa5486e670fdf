//! Errors of the scene file: where, what, and what to do, with the line and a caret under the place.

use crate::{Error, ErrorKind, names::is_disruptive};
use std::fmt;
use std::ops::Range;
use std::path::{Path, PathBuf};
use toml::de::{DeTable, DeValue};

/// Why a scene file is refused.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SceneError {
    /// The file cannot be read at all.
    #[error("{}: cannot read the scene: {reason}", .path.display())]
    Unreadable {
        /// The scene file.
        path: PathBuf,
        /// Why, and what to do.
        reason: String,
    },
    /// The text is not TOML, lacks a key or has an unknown one, or a value is out of range.
    #[error(transparent)]
    Invalid(Box<Diagnostic>),
}

/// A message about a place in a text file. Displays as `path:line:column: message`, then the line and a caret.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Diagnostic {
    /// The file.
    pub path: PathBuf,
    /// From 1.
    pub line: usize,
    /// In characters, from 1.
    pub column: usize,
    /// The defect and its remedy.
    pub message: String,
    /// The line, as far as it fits.
    excerpt: String,
    /// Characters of the excerpt before the place, and in it.
    caret: (usize, usize),
}

/// Most characters of a line that a message shows, and how many of them before the place.
const EXCERPT_WIDTH: usize = 110;
const EXCERPT_LEAD: usize = 60;

impl Diagnostic {
    /// A message about the value that `key` names in a scene's `text`, keys and numbers of entries with dots between,
    /// or about the table around it where it is not there.
    #[must_use]
    pub fn at(path: &Path, text: &str, key: &str, message: impl Into<String>) -> Self {
        Self::new(path, text, find(text, key).0, message)
    }

    /// A message about the bytes `span` of `text`, the content of the file at `path`. A span beyond the text means its
    /// end.
    #[must_use]
    pub fn new(path: &Path, text: &str, span: Range<usize>, message: impl Into<String>) -> Self {
        let start = text.floor_char_boundary(span.start);
        let before = &text[..start];
        let line_start = before.rfind('\n').map_or(0, |newline| newline + 1);
        let line_text = text[line_start..].lines().next().unwrap_or("");
        let column = text[line_start..start].chars().count();
        let inside = text[start..text.floor_char_boundary(span.end.max(start))].lines().next().unwrap_or("");
        let skipped = column.saturating_sub(EXCERPT_LEAD);
        // Some characters would act on the terminal, and tabs would move the caret.
        let printable = |c: char| if is_disruptive(c) { ' ' } else { c };
        let excerpt: String = line_text.chars().skip(skipped).take(EXCERPT_WIDTH).map(printable).collect();
        let lead = column - skipped;
        let width = inside.chars().count().min(EXCERPT_WIDTH.saturating_sub(lead)).max(1);
        Self {
            path: path.to_owned(),
            line: before.matches('\n').count() + 1,
            column: column + 1,
            message: message.into(),
            excerpt,
            caret: (lead, width),
        }
    }
}

/// The place of what `key` names in a TOML text, keys and numbers of entries with dots between; where there is no such
/// thing, that of the table around it, and false.
pub(super) fn find(text: &str, key: &str) -> (Range<usize>, bool) {
    let Ok(root) = DeTable::parse(text) else { return (0..0, false) };
    let root = DeValue::Table(root.into_inner());
    let (mut place, mut value) = (0..0, &root);
    for part in key.split('.') {
        let inner = part.parse::<usize>().map_or_else(|_| value.get(part), |number| value.get(number));
        let Some(inner) = inner else { return (place, false) };
        (place, value) = (inner.span(), inner.get_ref());
    }
    (place, true)
}

impl fmt::Display for Diagnostic {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let number = self.line.to_string();
        let gutter = number.len();
        writeln!(f, "{}:{}:{}: {}", self.path.display(), self.line, self.column, self.message)?;
        writeln!(f, "{:gutter$} |", "")?;
        writeln!(f, "{number} | {}", self.excerpt)?;
        write!(f, "{:gutter$} | {:lead$}{}", "", "", "^".repeat(self.caret.1), lead = self.caret.0)
    }
}

impl std::error::Error for Diagnostic {}

impl From<SceneError> for Error {
    fn from(error: SceneError) -> Self {
        match error {
            SceneError::Unreadable { path, reason } => {
                Self::at(&path, format_args!("cannot read the scene: {reason}")).of(ErrorKind::File)
            }
            SceneError::Invalid(diagnostic) => (*diagnostic).into(),
        }
    }
}

impl From<Diagnostic> for Error {
    fn from(diagnostic: Diagnostic) -> Self {
        let Diagnostic { path, line, column, .. } = &diagnostic;
        Self::new(diagnostic.to_string()).in_file(path, Some((*line, *column))).of(ErrorKind::Scene)
    }
}

impl From<Diagnostic> for SceneError {
    fn from(diagnostic: Diagnostic) -> Self {
        Self::Invalid(Box::new(diagnostic))
    }
}
