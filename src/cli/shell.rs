//! Words of commands that are printed: as a shell takes each for one word, and the program for what it is.

use std::path::Path;

/// `word` as a shell takes it for one word.
pub fn word(word: &str) -> String {
    let is_plain = |c: char| c.is_ascii_alphanumeric() || "-_./+,:=".contains(c);
    if !word.is_empty() && word.chars().all(is_plain) {
        word.to_owned()
    } else {
        format!("'{}'", word.replace('\'', "'\\''"))
    }
}

/// The file at `path` as one word that is no option.
pub fn file(path: &Path) -> String {
    let path = path.display().to_string();
    word(&if path.starts_with('-') { format!("./{path}") } else { path })
}

/// An option with its value, which may begin like an option.
pub fn option(name: &str, value: &str) -> String {
    let between = if value.starts_with('-') { '=' } else { ' ' };
    format!("{name}{between}{}", word(value))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_are_quoted_for_a_shell_and_files_are_no_options() {
        assert_eq!(word("arm.toml"), "arm.toml");
        assert_eq!(word("my arm.toml"), "'my arm.toml'");
        assert_eq!(word("it's $HOME"), "'it'\\''s $HOME'");
        let of = |path: &str| file(Path::new(path));
        assert_eq!(
            ["arm.toml", "-x.toml", "./-x.toml", "- x", "a/-x"].map(of),
            ["arm.toml", "./-x.toml", "./-x.toml", "'./- x'", "a/-x"]
        );
        assert_eq!([option("--tip", "probe"), option("--tip", "-p q")], ["--tip probe", "--tip='-p q'"]);
    }
}
