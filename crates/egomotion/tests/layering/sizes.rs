//! Files that can be read in one go, and tests that are run.

use std::fs;

use crate::source::{crates, sources};

/// Most lines of a source file, its unit tests included.
const LONGEST_FILE: usize = 400;

#[test]
fn no_source_file_is_too_long() {
    let mut objections = Vec::new();
    for source in crates().iter().flat_map(|root| sources(root)) {
        let lines = source.text.lines().count();
        if lines > LONGEST_FILE {
            objections.push(format!("{}: {lines} lines", source.path.display()));
        }
    }
    assert!(objections.is_empty(), "more than {LONGEST_FILE} lines:\n{}", objections.join("\n"));
}

/// A test file that no program names would never run, and nothing else would say so.
#[test]
fn every_test_file_is_run() {
    let mut objections = Vec::new();
    for folder in crates().iter().map(|sources| sources.with_file_name("tests")) {
        let Ok(program) = fs::read_to_string(folder.join("main.rs")) else { continue };
        for entry in fs::read_dir(&folder).unwrap() {
            let path = entry.unwrap().path();
            let name = path.file_stem().unwrap().to_string_lossy().into_owned();
            let is_test = path.extension().is_some_and(|extension| extension == "rs") && name != "main";
            if is_test && !program.lines().any(|line| line == format!("mod {name};")) {
                objections.push(path.display().to_string());
            }
        }
    }
    assert!(objections.is_empty(), "not named in main.rs: {}", objections.join(", "));
}
