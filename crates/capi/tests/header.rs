//! The header is what cbindgen makes of the sources.
//!
//! `TRUEARM_WRITE_HEADER=1 cargo test -p truearm-capi --test header` writes it again.
#![allow(clippy::unwrap_used, reason = "a test may stop")]

use std::path::Path;

const SOURCES: [&str; 6] = ["status", "handles", "types", "load", "correct", "stream"];

#[test]
fn the_header_is_fresh() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let config = cbindgen::Config::from_file(root.join("cbindgen.toml")).unwrap();
    let mut builder = cbindgen::Builder::new().with_config(config);
    for source in SOURCES {
        builder = builder.with_src(root.join("src/ffi").join(source).with_extension("rs"));
    }
    let mut fresh = Vec::new();
    builder.generate().unwrap().write(&mut fresh);
    let path = root.join("include/truearm.h");
    if std::env::var_os("TRUEARM_WRITE_HEADER").is_some() {
        std::fs::create_dir_all(root.join("include")).unwrap();
        std::fs::write(&path, &fresh).unwrap();
    }
    let stored = std::fs::read(&path).unwrap();
    let again = "write it again: TRUEARM_WRITE_HEADER=1 cargo test -p truearm-capi --test header";
    assert!(String::from_utf8(stored) == String::from_utf8(fresh), "include/truearm.h is stale; {again}");
}
