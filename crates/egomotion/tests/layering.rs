//! The arrows between modules: each may import only what stands before it on the way of the data.
//!
//! The sources are read as text, so an arrow counts wherever it is written: in a `use`, in a path in
//! the middle of a function, behind a chain of `super::`, in a test.

use std::fs;
use std::path::{Path, PathBuf};

/// Top-level modules and what each may import besides itself.
const ALLOWED: [(&str, &[&str]); 9] = [
    ("simd", &[]),
    ("geometry", &["simd"]),
    ("observe", &["geometry", "simd"]),
    ("constrain", &["geometry", "observe"]),
    ("estimate", &["geometry", "observe", "constrain", "simd"]),
    ("motion", &["geometry", "observe", "constrain", "estimate"]),
    ("pipeline", &["geometry", "observe", "constrain", "estimate", "motion", "simd"]),
    ("sim", &["geometry", "simd"]),
    ("metrics", &["geometry"]),
];

fn is_word(c: char) -> bool {
    c.is_alphanumeric() || c == '_'
}

fn word(text: &str) -> &str {
    &text[..text.find(|c| !is_word(c)).unwrap_or(text.len())]
}

/// First names of the paths that follow a prefix such as `crate::`: one, or those of a `{…}` group.
fn heads(rest: &str) -> Vec<&str> {
    let Some(group) = rest.strip_prefix('{') else { return vec![word(rest)] };
    let (mut depth, mut heads, mut start) = (0, Vec::new(), true);
    for (i, c) in group.char_indices() {
        match c {
            '{' => depth += 1,
            '}' if depth == 0 => break,
            '}' => depth -= 1,
            ',' if depth == 0 => start = true,
            c if start && is_word(c) => {
                heads.push(word(&group[i..]));
                start = false;
            }
            _ => {}
        }
    }
    heads
}

/// What the paths of a source name right under the crate's root; `depth` is the module's own depth.
fn imports(source: &str, depth: usize) -> Vec<String> {
    let code: String =
        source.lines().map(|line| line.split("//").next().unwrap_or("")).collect::<Vec<_>>().join("\n");
    let mut found: Vec<String> = Vec::new();
    for prefix in ["crate::", "super::"] {
        for (i, _) in code.match_indices(prefix) {
            let before = &code[..i];
            if before.ends_with(is_word) || before.ends_with("super::") {
                continue;
            }
            let mut rest = &code[i + prefix.len()..];
            let mut climbs = 1;
            while let Some(further) = rest.strip_prefix("super::") {
                (rest, climbs) = (further, climbs + 1);
            }
            if prefix == "crate::" || climbs >= depth {
                found.extend(heads(rest).into_iter().map(str::to_owned));
            }
        }
    }
    found
}

fn sources(folder: &Path, into: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            sources(&path, into);
        } else if path.extension().is_some_and(|e| e == "rs") {
            into.push(path);
        }
    }
}

/// Names of a file's modules from the root: `observe/flow/mod.rs` is observe, flow.
fn modules(relative: &Path) -> Vec<String> {
    let mut names: Vec<String> =
        relative.with_extension("").iter().map(|part| part.to_string_lossy().into_owned()).collect();
    names.pop_if(|last| last == "mod");
    names
}

fn allowed(module: &str) -> Option<&'static [&'static str]> {
    ALLOWED.iter().find(|(name, _)| *name == module).map(|(_, imports)| *imports)
}

/// Why an arrow may not be, if so. Names under the root that are no modules do not count.
fn objection(from: &str, to: &str) -> Option<String> {
    let may = allowed(from)?;
    (from != to && allowed(to).is_some() && !may.contains(&to)).then(|| format!("{from} imports {to}"))
}

#[test]
fn no_arrow_points_backwards() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut files = Vec::new();
    sources(&root, &mut files);
    let (mut objections, mut arrows) = (Vec::new(), 0);
    for file in files {
        let relative = file.strip_prefix(&root).unwrap();
        let names = modules(relative);
        let source = fs::read_to_string(&file).unwrap();
        let module = names[0].as_str();
        if module == "lib" {
            continue;
        }
        if allowed(module).is_none() {
            objections.push(format!("{}: the module has no place in the order", relative.display()));
        }
        for to in imports(&source, names.len()) {
            arrows += usize::from(to != module && allowed(&to).is_some());
            let objection = objection(module, &to);
            objections.extend(objection.map(|why| format!("{}: {why}", relative.display())));
        }
    }
    assert!(objections.is_empty(), "{}", objections.join("\n"));
    assert!(arrows > 50, "only {arrows} arrows were read");
}

#[test]
fn the_reader_of_arrows_sees_them_all() {
    let source = "
        use crate::geometry::{Field, Grid};
        use crate::{motion::impact::{nearest, Candidate}, sim, estimate::Row};
        // use crate::metrics::Nees;
        fn f() { crate::pipeline::run(); my_crate::constrain::x(); super::observe::y(); }
        mod tests { use super::super::study; use super::*; }
    ";
    assert_eq!(
        imports(source, 2),
        ["geometry", "motion", "sim", "estimate", "pipeline", "study"].map(str::to_owned)
    );
    assert_eq!(imports(source, 1).iter().filter(|m| *m == "observe").count(), 1);
    assert_eq!(modules(Path::new("observe/flow/mod.rs")), ["observe", "flow"]);
    for (from, to) in
        [("geometry", "observe"), ("estimate", "motion"), ("sim", "metrics"), ("motion", "pipeline")]
    {
        assert!(objection(from, to).is_some(), "{from} {to}");
    }
    assert_eq!(objection("pipeline", "motion"), None);
}
