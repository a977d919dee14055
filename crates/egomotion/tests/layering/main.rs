//! The arrows between modules: each may import only what stands before it on the way of the data.
//!
//! The sources are read as text, so an arrow counts wherever it is written: in a `use`, in a path in
//! the middle of a function, behind a chain of `super::`, in a test.

mod circles;
mod sizes;
mod source;

use std::path::Path;

use source::{code, modules, paths, sources};

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

/// What the paths of a source name right under the crate's root.
fn imports(source: &str, modules: &[String]) -> Vec<String> {
    paths(&code(source), modules).into_iter().filter_map(|path| path.into_iter().next()).collect()
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
    let (mut objections, mut arrows) = (Vec::new(), 0);
    for source in sources(&Path::new(env!("CARGO_MANIFEST_DIR")).join("src")) {
        let Some(module) = source.modules.first() else { continue };
        if allowed(module).is_none() {
            objections.push(format!("{}: the module has no place in the order", source.path.display()));
        }
        for to in imports(&source.text, &source.modules) {
            arrows += usize::from(to != *module && allowed(&to).is_some());
            let objection = objection(module, &to);
            objections.extend(objection.map(|why| format!("{}: {why}", source.path.display())));
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
    let names = |of: &[&str]| -> Vec<String> { of.iter().map(|&name| name.to_owned()).collect() };
    let found = imports(source, &names(&["a"]));
    for name in ["geometry", "motion", "sim", "estimate", "pipeline", "observe", "study"] {
        assert!(found.contains(&name.to_owned()), "{name}: {found:?}");
    }
    assert!(!found.contains(&"metrics".to_owned()) && !found.contains(&"constrain".to_owned()));
    assert!(!imports(source, &names(&["a", "b"])).contains(&"observe".to_owned()));
    assert_eq!(modules(Path::new("observe/flow/mod.rs")), ["observe", "flow"]);
    for (from, to) in
        [("geometry", "observe"), ("estimate", "motion"), ("sim", "metrics"), ("motion", "pipeline")]
    {
        assert!(objection(from, to).is_some(), "{from} {to}");
    }
    assert_eq!(objection("pipeline", "motion"), None);
}
