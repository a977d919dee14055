//! Sources read as text: files, the modules they are, and the paths that they name.

use std::fs;
use std::path::{Path, PathBuf};

/// A source file of a crate.
pub struct Source {
    /// The file.
    pub path: PathBuf,
    /// Names of its modules from the crate's root: `observe/flow/mod.rs` is observe, flow; the root is empty.
    pub modules: Vec<String>,
    /// What is written in it.
    pub text: String,
}

/// All sources below a folder `src`, in the order of their paths.
pub fn sources(root: &Path) -> Vec<Source> {
    let mut files = Vec::new();
    collect(root, &mut files);
    files.sort();
    let source = |path: PathBuf| Source {
        modules: modules(path.strip_prefix(root).unwrap()),
        text: fs::read_to_string(&path).unwrap(),
        path,
    };
    files.into_iter().map(source).collect()
}

/// The folders `src` of all crates of the workspace, and of the Python package.
pub fn crates() -> Vec<PathBuf> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..").canonicalize().unwrap();
    let packages = fs::read_dir(root.join("crates")).unwrap().map(|entry| entry.unwrap().path());
    let all: Vec<PathBuf> = packages
        .chain([root.join("python")])
        .map(|package| package.join("src"))
        .filter(|s| s.is_dir())
        .collect();
    assert!(all.len() >= 6, "{all:?}");
    all
}

fn collect(folder: &Path, into: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            collect(&path, into);
        } else if path.extension().is_some_and(|e| e == "rs") {
            into.push(path);
        }
    }
}

/// Names of a file's modules from the root.
pub fn modules(relative: &Path) -> Vec<String> {
    let mut names: Vec<String> =
        relative.with_extension("").iter().map(|part| part.to_string_lossy().into_owned()).collect();
    names.pop_if(|last| last == "mod");
    if names.len() == 1 && (names[0] == "lib" || names[0] == "main") {
        names.clear();
    }
    names
}

fn is_word(c: char) -> bool {
    c.is_alphanumeric() || c == '_'
}

/// The source without its comments.
pub fn code(source: &str) -> String {
    source.lines().map(|line| line.split("//").next().unwrap_or("")).collect::<Vec<_>>().join("\n")
}

/// The source without its unit tests, which may look at anything.
pub fn without_tests(source: &str) -> String {
    let mut kept = Vec::new();
    let mut lines = source.lines().peekable();
    while let Some(line) = lines.next() {
        let is_tests =
            line == "#[cfg(test)]" && lines.peek().is_some_and(|l| l.contains("mod ") && l.ends_with('{'));
        if is_tests {
            lines.find(|line| *line == "}");
        } else {
            kept.push(line);
        }
    }
    kept.join("\n")
}

/// The paths of a tree such as `a::{b, c::d}`, at the start of a text.
fn tree(text: &str) -> Vec<Vec<String>> {
    let text = text.trim_start();
    if let Some(group) = text.strip_prefix('{') {
        return branches(group).into_iter().flat_map(tree).collect();
    }
    let end = text.find(|c| !is_word(c)).unwrap_or(text.len());
    if end == 0 {
        return vec![Vec::new()];
    }
    let (name, rest) = text.split_at(end);
    match rest.strip_prefix("::") {
        Some(rest) => {
            let longer = |mut path: Vec<String>| {
                path.insert(0, name.to_owned());
                path
            };
            tree(rest).into_iter().map(longer).collect()
        }
        None => vec![vec![name.to_owned()]],
    }
}

/// The parts of a group between its commas, up to its closing brace.
fn branches(group: &str) -> Vec<&str> {
    let (mut depth, mut start, mut parts) = (0, 0, Vec::new());
    for (i, c) in group.char_indices() {
        match c {
            '{' => depth += 1,
            '}' if depth == 0 => {
                parts.push(&group[start..i]);
                return parts.into_iter().filter(|part| !part.trim().is_empty()).collect();
            }
            '}' => depth -= 1,
            ',' if depth == 0 => {
                parts.push(&group[start..i]);
                start = i + 1;
            }
            _ => {}
        }
    }
    parts
}

/// All paths of a code that begin with `crate`, `super` or `self`, from the crate's root; `modules` are the code's own.
pub fn paths(code: &str, modules: &[String]) -> Vec<Vec<String>> {
    let mut found = Vec::new();
    for prefix in ["crate::", "super::", "self::"] {
        for (i, _) in code.match_indices(prefix) {
            let before = &code[..i];
            if before.ends_with(is_word) || before.ends_with("::") || before.ends_with('$') {
                continue;
            }
            for mut path in tree(&code[i..]) {
                let climbs = path.iter().take_while(|name| *name == "super").count();
                let kept = if prefix == "crate::" { 0 } else { modules.len().saturating_sub(climbs) };
                path.drain(..climbs.max(1));
                found.push(modules[..kept].iter().cloned().chain(path).collect());
            }
        }
    }
    found
}

/// What a module hands on under its own name: each name, and the path that it stands for.
pub fn handed_on(code: &str, modules: &[String]) -> Vec<(String, Vec<String>)> {
    let mut found = Vec::new();
    for (i, _) in code.match_indices("use ") {
        if code[..i].ends_with(is_word) {
            continue;
        }
        for path in tree(&code[i + 4..]) {
            let is_relative =
                path.first().is_some_and(|name| !["crate", "super", "self"].contains(&name.as_str()));
            if let (true, Some(name)) = (is_relative && path.len() > 1, path.last()) {
                found.push((name.clone(), modules.iter().cloned().chain(path.clone()).collect()));
            }
        }
    }
    found
}
