//! Names from files: of joints, scenes, topics, devices. They are printed in lines and tables, where some characters
//! would forge a line, hide what stands beside them or command a terminal. Counts and times as sentences have them.

use std::{
    borrow::Cow,
    fmt::{self, Write as _},
};

/// Whether `c` does more than to be seen: a control character, an end of a line or a paragraph, or one that changes the
/// direction of text.
pub(crate) fn is_disruptive(c: char) -> bool {
    let turns = matches!(c, '\u{61c}' | '\u{200e}' | '\u{200f}' | '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}');
    c.is_control() || matches!(c, '\u{2028}' | '\u{2029}') || turns
}

/// Returns `text` with its disruptive characters spelt as in JSON, `\u202e`, but for those in `kept`.
pub(crate) fn escaped_but<'a>(text: &'a str, kept: &[char]) -> Cow<'a, str> {
    let is_bad = |c: char| is_disruptive(c) && !kept.contains(&c);
    if !text.contains(is_bad) {
        return Cow::Borrowed(text);
    }
    let spelt = |c: char| if is_bad(c) { format!("\\u{:04x}", u32::from(c)) } else { c.into() };
    Cow::Owned(text.chars().map(spelt).collect())
}

/// Returns `text` with its disruptive characters spelt as in JSON, `\u202e`.
pub(crate) fn escaped(text: &str) -> Cow<'_, str> {
    escaped_but(text, &[])
}

/// Text as it stands in an element or an attribute of XML or HTML.
pub(crate) struct Xml<'a>(pub &'a str);

impl fmt::Display for Xml<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.chars().try_for_each(|character| match character {
            '&' => f.write_str("&amp;"),
            '<' => f.write_str("&lt;"),
            '>' => f.write_str("&gt;"),
            '"' => f.write_str("&quot;"),
            other => f.write_char(other),
        })
    }
}

/// Returns a whole number with its noun, in the singular or the plural.
pub(crate) fn counted<N: fmt::Display + PartialEq + From<bool>>(count: N, [one, more]: [&str; 2]) -> String {
    let noun = if count == N::from(true) { one } else { more };
    format!("{count} {noun}")
}

/// Writes a time as people say it: `0.4 s`, `35 s`, `12 min`, `7.5 h`.
pub(crate) fn duration(seconds: f64) -> String {
    match seconds {
        s if s < 10.0 => format!("{s:.1} s"),
        s if s < 120.0 => format!("{s:.0} s"),
        s if s < 7200.0 => format!("{:.0} min", s / 60.0),
        s => format!("{:.1} h", s / 3600.0),
    }
}

/// Returns the first of `names`, as many as a message has room for.
pub(crate) fn listed<S: AsRef<str>>(names: &[S]) -> String {
    const MOST_NAMES: usize = 20;
    const MOST_CHARACTERS: usize = 40;
    let shown = |name: &S| match name.as_ref().char_indices().nth(MOST_CHARACTERS) {
        Some((end, _)) => format!("{}…", &name.as_ref()[..end]),
        None => name.as_ref().to_owned(),
    };
    let mut list = names.iter().take(MOST_NAMES).map(shown).collect::<Vec<_>>().join(", ");
    if names.len() > MOST_NAMES {
        list.push_str(&format!(" and {} more", names.len() - MOST_NAMES));
    }
    list
}

/// Checks that `name` may be printed in a line, and is seen there.
///
/// # Errors
/// Problem, in words.
pub(crate) fn check(name: &str) -> Result<(), String> {
    if name.trim().is_empty() {
        return Err("a name is blank: give it letters or digits".into());
    }
    match name.chars().find(|c| is_disruptive(*c)) {
        None => Ok(()),
        Some(c) => Err(format!(
            "the name \"{}\" holds the character U+{:04X}, which would disturb what is printed: leave it out",
            escaped(name),
            u32::from(c)
        )),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_moves_hides_or_ends_text_is_spelt_and_refused() {
        for c in [
            '\n', '\r', '\t', '\0', '\u{1b}', '\u{7f}', '\u{9b}', '\u{2028}', '\u{2029}', '\u{202e}', '\u{2066}',
            '\u{200f}',
        ] {
            let name = format!("a{c}b");
            let spelt = format!("a\\u{:04x}b", u32::from(c));
            assert_eq!(escaped(&name), spelt);
            let why = check(&name).unwrap_err();
            assert!(why.contains(&spelt) && !why.contains(c), "{why}");
            // As a reader of JSON has it.
            assert_eq!(serde_json::from_str::<String>(&format!("\"{spelt}\"")).unwrap(), name);
        }
        for name in ["", " ", "\u{2003}"] {
            assert!(check(name).unwrap_err().contains("blank"), "{name:?}");
        }
        for name in ["joint 1", "Gelenk_ä", "関節", "مفصل", "a\\u000a", "😀"] {
            assert!(matches!(escaped(name), Cow::Borrowed(same) if same == name), "{name}");
            assert_eq!(check(name), Ok(()));
        }
        assert_eq!(escaped_but("a\nb\u{202e}", &['\n']), "a\nb\\u202e");
    }
}
