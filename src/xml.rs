//! XML of files that may be hostile.

use roxmltree::{Document, ParsingOptions, TextPos};
use std::ops::Range;

/// Most XML nodes of a file: a hundred times as many as those of robots have.
const MAX_NODES: u32 = 1 << 20;

/// Most attributes of an element, and namespaces of a file: ten times as many as files have. The parser compares each
/// with all others.
const MAX_ATTRIBUTES: usize = 100;

/// Why a text is no XML that is read, and where (B).
pub(crate) struct XmlError {
    pub span: Range<usize>,
    pub reason: String,
    /// The prefix of a namespace that is not declared, if that is why.
    pub prefix: Option<String>,
}

impl XmlError {
    /// The line and the reason.
    pub fn sentence(&self, text: &str) -> String {
        format!("line {}: {}", line(text, self.span.start), self.reason)
    }
}

/// Parses `text` without a document type, in which entities may be defined that grow without bound.
pub(crate) fn parse(text: &str) -> Result<Document<'_>, XmlError> {
    check_attributes(text)?;
    let options = ParsingOptions { allow_dtd: false, nodes_limit: MAX_NODES, ..ParsingOptions::default() };
    Document::parse_with_options(text, options).map_err(|error| match error {
        roxmltree::Error::DtdDetected => {
            let start = text.find("<!DOCTYPE").unwrap_or(0);
            let reason = "no document type is read, since entities can grow without bound: remove <!DOCTYPE ..>";
            XmlError { span: start..start + "<!DOCTYPE".len(), reason: reason.into(), prefix: None }
        }
        error => {
            let offset = offset(text, error.pos());
            let reason = format!("this is not well-formed XML: {error}");
            let prefix = match error {
                roxmltree::Error::UnknownNamespace(prefix, _) => Some(prefix),
                _ => None,
            };
            XmlError { span: offset..offset, reason, prefix }
        }
    })
}

/// The line of the byte at `offset`, from 1.
pub(crate) fn line(text: &str, offset: usize) -> usize {
    text.as_bytes().iter().take(offset).filter(|byte| **byte == b'\n').count() + 1
}

/// Refuses what the parser would take very long for. No value of an attribute holds a `<`, so an element's are between
/// its own and the next.
fn check_attributes(text: &str) -> Result<(), XmlError> {
    let refuse = |span: Range<usize>, what: &str| {
        let reason = format!("{what} more than {MAX_ATTRIBUTES}, which no such file has");
        Err(XmlError { span, reason, prefix: None })
    };
    let mut start = 0;
    for element in text.split_inclusive('<') {
        let values = element.split('=').skip(1).filter(|value| value.trim_start().starts_with(['"', '\'']));
        if values.count() > MAX_ATTRIBUTES {
            return refuse(start..start, "the attributes of an element are");
        }
        start += element.len();
    }
    match text.match_indices("xmlns").nth(MAX_ATTRIBUTES) {
        Some((place, name)) => refuse(place..place + name.len(), "the namespaces of the file are"),
        None => Ok(()),
    }
}

fn offset(text: &str, place: TextPos) -> usize {
    let before: usize = text.split_inclusive('\n').take(place.row.saturating_sub(1) as usize).map(str::len).sum();
    let line = text.get(before..).unwrap_or_default();
    let column = place.col.saturating_sub(1) as usize;
    before + line.char_indices().nth(column).map_or(line.trim_end().len(), |(offset, _)| offset)
}
