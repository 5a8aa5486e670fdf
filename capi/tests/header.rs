//! The header that is committed is the one that the sources make.

#![allow(clippy::unwrap_used)]

use std::path::Path;

#[test]
fn the_header_is_what_the_sources_make() {
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    let config = cbindgen::Config::from_file(here.join("cbindgen.toml")).unwrap();
    // The other files are modules of this one.
    let builder = cbindgen::Builder::new().with_config(config).with_src(here.join("src/lib.rs"));
    let mut made = Vec::new();
    builder.generate().unwrap().write(&mut made);
    // Rust's heading for what an unsafe function asks of its caller.
    let made = String::from_utf8(made).unwrap().replace("// # Safety\n", "// Pointers:\n");
    let header = here.join("include/haptize.h");
    if std::env::var_os("HAPTIZE_WRITE_HEADER").is_some() {
        std::fs::write(&header, &made).unwrap();
    }
    let committed = std::fs::read_to_string(&header).unwrap_or_default();
    assert!(
        committed == made,
        "{}: not what the sources make; write it anew with HAPTIZE_WRITE_HEADER=1 cargo test -p haptize-capi --test \
         header",
        header.display()
    );
}

#[test]
fn every_function_has_its_place_in_the_documentation_and_in_csharp() {
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    let header = std::fs::read_to_string(here.join("include/haptize.h")).unwrap();
    let [page, csharp] =
        ["../docs/c.md", "csharp/Haptize.cs"].map(|file| std::fs::read_to_string(here.join(file)).unwrap());
    let declared = header.lines().filter(|line| !line.trim_start().starts_with("//")).flat_map(|line| {
        let words = line.split(|character: char| !character.is_alphanumeric() && character != '_');
        words.filter(|word| word.starts_with("hz_") && line.contains(&format!("{word}("))).map(str::to_owned)
    });
    let declared: Vec<String> = declared.collect();
    assert!(declared.len() > 15, "{declared:?}");
    for (k, function) in declared.iter().enumerate() {
        assert!(page.contains(&format!("`{function}`")), "docs/c.md does not name {function}");
        assert!(csharp.contains(&format!(" {function}(")), "Haptize.cs does not declare {function}");
        assert!(!declared[..k].contains(function), "{function} is declared twice");
    }
}
