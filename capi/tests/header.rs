//! The header that is committed is the one that the sources make.

#![allow(clippy::unwrap_used)]

use std::path::Path;

#[test]
fn the_header_is_what_the_sources_make() {
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    let config = cbindgen::Config::from_file(here.join("cbindgen.toml")).unwrap();
    let mut builder = cbindgen::Builder::new().with_config(config);
    for source in ["lib.rs", "outcome.rs", "field.rs", "haptic_loop.rs", "solver.rs"] {
        builder = builder.with_src(here.join("src").join(source));
    }
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
        "{}: not what the sources make; write it anew with HAPTIZE_WRITE_HEADER=1 cargo test -p haptize-capi --test header",
        header.display()
    );
}
