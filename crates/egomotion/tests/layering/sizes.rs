//! Files that can be read in one go.

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
