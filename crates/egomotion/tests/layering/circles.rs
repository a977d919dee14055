//! No circle between siblings: at every level of every crate the modules of a folder can be put in an order in which
//! each imports only from those before it. A module and its own children may import each other.

use std::collections::{BTreeMap, BTreeSet};

use crate::source::{Source, code, crates, handed_on, paths, sources, without_tests};

/// Which sibling imports which, by the folder that holds them; with a file that does.
type Arrows = BTreeMap<Vec<String>, BTreeMap<(String, String), String>>;

/// The arrows between siblings, at every level of a crate.
fn arrows(all: &[Source]) -> Arrows {
    let known: BTreeSet<&[String]> = all.iter().map(|source| source.modules.as_slice()).collect();
    let handed: BTreeMap<&[String], BTreeMap<String, Vec<String>>> = all
        .iter()
        .map(|source| {
            let names = handed_on(&code(&source.text), &source.modules).into_iter();
            (source.modules.as_slice(), names.collect())
        })
        .collect();
    let mut found = Arrows::new();
    for source in all {
        let text = code(&without_tests(&source.text));
        for path in paths(&text, &source.modules) {
            let path = resolved(path, &known, &handed);
            let shared = source.modules.iter().zip(&path).take_while(|(a, b)| a == b).count();
            let (Some(from), Some(to)) = (source.modules.get(shared), path.get(shared)) else { continue };
            if known.contains(&path[..=shared]) {
                let folder = found.entry(path[..shared].to_vec()).or_default();
                folder.entry((from.clone(), to.clone())).or_insert_with(|| source.path.display().to_string());
            }
        }
    }
    found
}

/// The path with names that modules only hand on replaced by what they stand for.
fn resolved(
    mut path: Vec<String>,
    known: &BTreeSet<&[String]>,
    handed: &BTreeMap<&[String], BTreeMap<String, Vec<String>>>,
) -> Vec<String> {
    // Names may be handed on several times.
    for _ in 0..8 {
        let depth = (0..=path.len()).rev().find(|&n| known.contains(&path[..n])).unwrap_or(0);
        let stands_for = path.get(depth).and_then(|name| handed.get(&path[..depth])?.get(name));
        match stands_for {
            Some(target) => path = target.iter().cloned().chain(path[depth + 1..].iter().cloned()).collect(),
            None => return path,
        }
    }
    path
}

/// The siblings of a folder that import each other in a circle: what is left when all that import nothing of the
/// others, and all that none of the others imports, are taken away.
fn circle(arrows: &BTreeMap<(String, String), String>) -> Vec<String> {
    let mut left: Vec<(&(String, String), &String)> = arrows.iter().filter(|((a, b), _)| a != b).collect();
    loop {
        let from: BTreeSet<&String> = left.iter().map(|((from, _), _)| from).collect();
        let to: BTreeSet<&String> = left.iter().map(|((_, to), _)| to).collect();
        let before = left.len();
        left.retain(|((a, b), _)| from.contains(b) && to.contains(a));
        if left.len() == before {
            return left.iter().map(|((from, to), file)| format!("{from} -> {to} in {file}")).collect();
        }
    }
}

#[test]
fn siblings_do_not_import_each_other_in_a_circle() {
    let (mut objections, mut count) = (Vec::new(), 0);
    for root in crates() {
        for (folder, arrows) in arrows(&sources(&root)) {
            count += arrows.len();
            let circle = circle(&arrows);
            if !circle.is_empty() {
                objections.push(format!(
                    "{} {}:\n  {}",
                    root.display(),
                    folder.join("::"),
                    circle.join("\n  ")
                ));
            }
        }
    }
    assert!(objections.is_empty(), "{}", objections.join("\n"));
    assert!(count > 200, "only {count} arrows were read");
}

#[test]
fn circles_are_seen_through_what_is_handed_on() {
    let source = |modules: &[&str], text: &str| Source {
        path: modules.join("/").into(),
        modules: modules.iter().map(|&name| name.to_owned()).collect(),
        text: text.to_owned(),
    };
    let crate_of = |last: &str| {
        vec![
            source(&[], "mod a; mod b;"),
            source(&["a"], "mod deep; pub use deep::{Deep, more::Other as _};"),
            source(&["a", "deep"], "fn f() { crate::b::g(super::h()) }"),
            source(&["b"], last),
            source(&["c"], "use crate::{a::Deep, b};\n#[cfg(test)]\nmod tests {\n    use crate::d::X;\n}\n"),
            source(&["d"], "use crate::c::x; // use crate::nothing;"),
        ]
    };
    let found = |last: &str| circle(&arrows(&crate_of(last))[&Vec::new()]);
    assert_eq!(found("use std::fmt;"), Vec::<String>::new());
    assert_eq!(found("use super::a::Deep;"), ["a -> b in a/deep", "b -> a in b"]);
    let through_all = ["a -> b in a/deep", "b -> c in b", "c -> a in c", "c -> b in c"];
    assert_eq!(found("fn f() { crate::c::g() }"), through_all);
}
