//! What failed: one sentence that names the place, the problem and the remedy, and a kind where code asks for it.

use crate::{
    input,
    memory::Shortage,
    names::{self, is_disruptive},
};
use std::{
    fmt::Display,
    io,
    ops::Range,
    path::{Path, PathBuf},
};

/// Most characters of a line that a message shows, and how many of them before the place.
const EXCERPT_WIDTH: usize = 110;
const EXCERPT_LEAD: usize = 60;

/// Work failed.
///
/// Its text names the place first (a file, a line of it), then the problem, then what to do.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{text}")]
pub struct Error {
    kind: ErrorKind,
    location: Option<Location>,
    /// See [`Error::key`].
    key: Option<String>,
    text: String,
}

/// Kinds of errors that a program answers differently.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum ErrorKind {
    /// Any other: the text says all.
    Other,
    /// The system refuses to read or to write a file.
    File,
    /// A file is not of the kind that was asked for.
    Foreign,
    /// A dataset is damaged, of another version, or lacks what is asked of it.
    Dataset,
    /// A scene is not valid.
    Scene,
    /// Work was stopped from outside.
    Stopped,
    /// A matrix that has to be positive definite is not.
    Indefinite,
}

/// Where an error lies.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Location {
    /// The file.
    pub path: PathBuf,
    /// Line and column in it, from one, where they are known.
    pub line: Option<(usize, usize)>,
}

impl Error {
    /// Returns the error that `text` tells.
    pub fn new(text: impl Into<String>) -> Self {
        Self { kind: ErrorKind::Other, location: None, key: None, text: text.into() }
    }

    /// Returns what is wrong with the file at `path`.
    pub(crate) fn at(path: &Path, what: impl Display) -> Self {
        Self::new(format!("{}: {what}", shown(path))).in_file(path, None)
    }

    /// Returns what is wrong with a line, counted from one, of the file at `path`.
    pub(crate) fn on_line(path: &Path, line: u64, what: impl Display) -> Self {
        Self::new(format!("{}:{line}: {what}", shown(path))).in_file(path, Some((line as usize, 1)))
    }

    /// Returns what is wrong with the bytes `span` of `text`, the content of the file at `path`: behind it stands the
    /// line, with carets under the place. A span beyond the text means its end.
    pub(crate) fn in_text(path: &Path, text: &str, span: Range<usize>, what: impl Display) -> Self {
        let start = text.floor_char_boundary(span.start);
        let before = &text[..start];
        let line_start = before.rfind('\n').map_or(0, |newline| newline + 1);
        let line_text = text[line_start..].lines().next().unwrap_or("");
        let lead = text[line_start..start].chars().count();
        let inside = text[start..text.floor_char_boundary(span.end.max(start))].lines().next().unwrap_or("");
        let skipped = lead.saturating_sub(EXCERPT_LEAD);
        // Some characters would act on the terminal, and tabs would move the caret.
        let printable = |c: char| if is_disruptive(c) { ' ' } else { c };
        let excerpt: String = line_text.chars().skip(skipped).take(EXCERPT_WIDTH).map(printable).collect();
        let (line, column, lead) = (before.matches('\n').count() + 1, lead + 1, lead - skipped);
        let carets = "^".repeat(inside.chars().count().min(EXCERPT_WIDTH.saturating_sub(lead)).max(1));
        let gutter = line.to_string().len();
        let (path_text, empty) = (shown(path), "");
        Self::new(format!(
            "{path_text}:{line}:{column}: {what}\n{empty:gutter$} |\n{line} | {excerpt}\n{empty:gutter$} | {empty:lead$}{carets}"
        ))
        .in_file(path, Some((line, column)))
    }

    /// Returns that the file at `path` cannot be read, and what to do.
    pub(crate) fn unreadable(path: &Path, source: &io::Error) -> Self {
        Self::at(path, format_args!("cannot be read: {}", input::remedied(source))).of(ErrorKind::File)
    }

    /// Returns the same error, which lies at a line and column of the file at `path`, where they are known.
    pub(crate) fn in_file(self, path: impl Into<PathBuf>, line: Option<(usize, usize)>) -> Self {
        Self { location: Some(Location { path: path.into(), line }), ..self }
    }

    /// Returns the same error, of another kind.
    pub(crate) fn of(self, kind: ErrorKind) -> Self {
        Self { kind, ..self }
    }

    /// Returns the same error, which lies at `key` of a scene, unless it names one already.
    pub(crate) fn about(self, key: impl Into<String>) -> Self {
        Self { key: self.key.or_else(|| Some(key.into())), ..self }
    }

    /// Returns the same error; its text says first what it befell.
    pub(crate) fn within(self, context: impl Display) -> Self {
        Self { text: format!("{context}: {}", self.text), ..self }
    }

    /// Returns its kind.
    #[must_use]
    pub fn kind(&self) -> ErrorKind {
        self.kind
    }

    /// Returns the key of a scene at which it lies, with dots between its parts, where whoever found it has not the text.
    pub(crate) fn key(&self) -> Option<&str> {
        self.key.as_deref()
    }

    /// Returns where it lies, where that is a file.
    #[must_use]
    pub fn location(&self) -> Option<&Location> {
        self.location.as_ref()
    }
}

/// Returns a path that may be printed in a line: a file's name may hold an end of one.
fn shown(path: &Path) -> String {
    names::escaped(&path.to_string_lossy()).into_owned()
}

impl From<String> for Error {
    fn from(text: String) -> Self {
        Self::new(text)
    }
}

impl From<&str> for Error {
    fn from(text: &str) -> Self {
        Self::new(text)
    }
}

impl From<Shortage> for Error {
    fn from(shortage: Shortage) -> Self {
        Self::new(shortage.to_string())
    }
}

/// Makes an [`Error`] of a sentence, as `format!` does.
macro_rules! error {
    ($($text:tt)*) => {
        $crate::Error::new(format!($($text)*))
    };
}
pub(crate) use error;
