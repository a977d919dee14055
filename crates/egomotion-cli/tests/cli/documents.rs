//! The documents: every link leads to a file, every source that the table of equations names is there.

use std::fs;
use std::path::{Path, PathBuf};

/// The root of the repository.
pub fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

#[test]
fn every_link_leads_to_a_file() {
    let mut documents: Vec<PathBuf> = Vec::new();
    for folder in ["", "docs", "python"] {
        let inside = root().join(folder).read_dir().unwrap().map(|entry| entry.unwrap().path());
        documents.extend(inside.filter(|path| path.extension().is_some_and(|extension| extension == "md")));
    }
    assert!(documents.len() > 20, "{documents:?}");
    let mut broken = Vec::new();
    for document in documents {
        let text = fs::read_to_string(&document).unwrap();
        for link in text.split("](").skip(1).filter_map(|rest| rest.split(')').next()) {
            let (file, anchor) = link.split_once('#').unwrap_or((link, ""));
            if file.contains("://") {
                continue;
            }
            let there =
                if file.is_empty() { document.clone() } else { document.parent().unwrap().join(file) };
            let has = |anchor: &str| {
                anchors(&fs::read_to_string(&there).unwrap_or_default()).contains(&anchor.into())
            };
            if !there.exists() || !(anchor.is_empty() || has(anchor)) {
                broken.push(format!("{}: {link}", document.display()));
            }
        }
    }
    assert!(broken.is_empty(), "these lead nowhere:\n{}", broken.join("\n"));
}

#[test]
fn every_source_of_an_equation_is_there() {
    let text = fs::read_to_string(root().join("docs/equations.md")).unwrap();
    let places =
        ["crates/egomotion/src", "crates/egomotion", "crates/egomotion-study", ""].map(|at| root().join(at));
    let spans =
        text.split('`').skip(1).step_by(2).filter(|span| span.ends_with(".rs") || span.ends_with('/'));
    let missing: Vec<&str> =
        spans.filter(|span| !places.iter().any(|place| place.join(span).exists())).collect();
    assert!(missing.is_empty(), "equations.md names what is not there: {missing:?}");
}

#[test]
fn every_equation_of_the_paper_has_a_row() {
    let text = fs::read_to_string(root().join("docs/equations.md")).unwrap();
    let names: Vec<&str> =
        text.lines().filter_map(|line| line.strip_prefix("| ")?.split(" |").next()).collect();
    let named =
        |number: u32| names.iter().any(|name| name.split(", ").any(|one| one == format!("({number})")));
    let missing: Vec<u32> = (1..=59).filter(|&number| !named(number)).collect();
    assert!(missing.is_empty(), "no row of equations.md has these: {missing:?}");
}

/// The anchors of a document's headings, as GitHub makes them.
fn anchors(text: &str) -> Vec<String> {
    let headings =
        text.lines().filter(|line| line.starts_with('#')).map(|line| line.trim_start_matches('#').trim());
    let kept = |c: &char| c.is_alphanumeric() || [' ', '-', '_'].contains(c);
    headings
        .map(|heading| heading.to_lowercase().chars().filter(kept).collect::<String>().replace(' ', "-"))
        .collect()
}
