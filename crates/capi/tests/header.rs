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

#[test]
fn every_status_is_documented() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let source = std::fs::read_to_string(root.join("src/ffi/status.rs")).unwrap();
    let page = std::fs::read_to_string(root.join("../../docs/reference/c-library.md")).unwrap();
    let body = source.split("pub enum Status {").nth(1).unwrap().split('}').next().unwrap();
    let numbers: Vec<&str> = body
        .lines()
        .filter_map(|line| line.split_once(" = "))
        .map(|(_, number)| number.trim_end_matches(','))
        .collect();
    assert!(numbers.len() > 10);
    for number in numbers {
        assert!(
            page.contains(&format!("` | {number} | ")),
            "docs/reference/c-library.md says nothing of {number}"
        );
    }
}
