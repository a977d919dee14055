//! Any study: run, stopped, resumed, refused.

use std::fmt;
use std::fs;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use egomotion_report::study::page;
use egomotion_study::{Axis, Cell, Content, Figure, Line, Panel, Point, Publication, Series, Study, Table};
use serde::{Deserialize, Serialize};
use tempfile::TempDir;

use super::laboratory::{Laboratory, LaboratoryOptions};
use crate::exit::Ending;

/// A study of some parts, each with numbers that are hard to keep.
#[derive(Debug, Clone, Serialize)]
struct Pendulum {
    length_m: f64,
    seed: u64,
    /// The part during which the user asks to stop.
    #[serde(skip)]
    stopped_in: Option<usize>,
    /// The part that fails.
    #[serde(skip)]
    fails_in: Option<usize>,
    #[serde(skip)]
    stop: Arc<AtomicBool>,
}

#[derive(Debug, Clone, Serialize, Deserialize)]
struct Swing {
    part: usize,
    period_s: f64,
    damping: f64,
}

#[derive(Debug)]
struct Broken;

impl fmt::Display for Broken {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("the thread broke")
    }
}

impl std::error::Error for Broken {}

const PARTS: usize = 6;

impl Pendulum {
    fn new() -> Self {
        Self { length_m: 0.1, seed: 7, stopped_in: None, fails_in: None, stop: Arc::default() }
    }
}

impl Study for Pendulum {
    type Record = Swing;
    type Error = Broken;

    fn name(&self) -> &'static str {
        "pendulum"
    }

    fn parts(&self) -> Vec<String> {
        (0..PARTS).map(|k| format!("swing {k}")).collect()
    }

    fn run(&self, part: usize) -> Result<Vec<Swing>, Broken> {
        if self.stopped_in == Some(part) {
            self.stop.store(true, Ordering::Relaxed);
        }
        if self.fails_in == Some(part) {
            return Err(Broken);
        }
        let damping = [f64::NAN, 1.0 / 3.0, f64::INFINITY, -0.0, 1e-300, 0.1][part % 6];
        let period_s = (self.length_m * (part + 1) as f64).sqrt() + self.seed as f64;
        Ok(vec![Swing { part, period_s, damping }, Swing { part, period_s: 0.1 + 0.2, damping: 2.0 }])
    }

    fn publish(&self, records: &[Swing]) -> Publication {
        let mut table =
            Table::new("swings", "Swings", "", &[("part", "Part"), ("period_s", "T (s)"), ("damping", "D")]);
        let row = |r: &Swing| vec![r.part.into(), r.period_s.into(), Cell::Number(r.damping)];
        table.rows = records.iter().map(row).collect();
        let point = |r: &Swing| Point { x: r.part as f64, y: r.damping, standard_error: Some(r.period_s) };
        let series =
            Series { name: "D".into(), line: Line::Solid, points: records.iter().map(point).collect() };
        let content = Content::Plot { x: Axis::linear("part"), y: Axis::log("D"), series: vec![series] };
        let figure = Figure {
            id: "figure-1".into(),
            title: "Damping".into(),
            caption: "<How> it dies away.".into(),
            columns: 1,
            panels: vec![Panel { title: "(a)".into(), content }],
        };
        Publication { title: "A pendulum".into(), data: vec![], tables: vec![table], figures: vec![figure] }
    }
}

fn run(study: &Pendulum, out: &Path, resume: bool) -> anyhow::Result<Ending> {
    study.stop.store(false, Ordering::Relaxed);
    let options = LaboratoryOptions {
        resume,
        command: "egomotion study pendulum".into(),
        ..LaboratoryOptions::default()
    };
    let mut laboratory = Laboratory::open(out, options, Arc::clone(&study.stop))?;
    laboratory.run(study)?;
    laboratory.close()
}

fn refusal(study: &Pendulum, out: &Path, resume: bool) -> String {
    let error = run(study, out, resume).expect_err("it is refused");
    let text = format!("{error:#}");
    assert!(!text.contains('\n'), "{text}");
    text
}

/// Every file of a folder but the journal.
fn results(out: &Path) -> Vec<(String, Vec<u8>)> {
    let mut all: Vec<(String, Vec<u8>)> = fs::read_dir(out)
        .unwrap()
        .map(|entry| entry.unwrap())
        .map(|e| (e.file_name().into_string().unwrap(), fs::read(e.path()).unwrap()))
        .filter(|(name, _)| !name.ends_with(".jsonl"))
        .collect();
    all.sort();
    all
}

fn journal(out: &Path) -> std::path::PathBuf {
    out.join("pendulum.parts.jsonl")
}

/// The files of a run that nothing disturbed.
fn undisturbed() -> Vec<(String, Vec<u8>)> {
    let folder = TempDir::new().unwrap();
    assert!(matches!(run(&Pendulum::new(), folder.path(), false), Ok(Ending::Done)));
    results(folder.path())
}

#[test]
fn a_study_becomes_files_and_a_page() {
    let all = undisturbed();
    let names: Vec<&str> = all.iter().map(|(name, _)| name.as_str()).collect();
    assert_eq!(names, ["figure-1.svg", "page.html", "swings.csv"]);
    let table = String::from_utf8(all[2].1.clone()).unwrap();
    assert!(
        table.starts_with("part,period_s,damping\n0,7.316227766016838,NaN\n0,0.30000000000000004,2.0\n"),
        "{table}"
    );
    assert_eq!(table.lines().count(), 1 + 2 * PARTS);
    let page = String::from_utf8(all[1].1.clone()).unwrap();
    for part in [
        "A pendulum",
        "&lt;How&gt;",
        "href=\"figure-1.svg\"",
        "href=\"swings.csv\"",
        "length_m",
        "study pendulum",
    ] {
        assert!(page.contains(part), "{part}");
    }
    // Nothing is loaded from anywhere.
    assert!(!page.contains("http:") && !page.contains("https:") && !page.contains("<script"));
}

#[test]
fn a_stopped_study_resumes_to_the_same_bytes() {
    for part in 0..PARTS - 1 {
        let folder = TempDir::new().unwrap();
        let stopped = Pendulum { stopped_in: Some(part), ..Pendulum::new() };
        assert!(matches!(run(&stopped, folder.path(), false), Ok(Ending::Interrupted)));
        let table = fs::read_to_string(folder.path().join("swings.csv")).unwrap();
        assert_eq!(table.lines().count(), 1 + 2 * (part + 1), "the running part is finished and written");
        let page = fs::read_to_string(folder.path().join(page::NAME)).unwrap();
        assert!(page.contains("of 6 parts are done"), "{part}");
        // Nothing is done twice: a part that would fail is done already.
        let rest = Pendulum { fails_in: Some(part), ..Pendulum::new() };
        assert!(matches!(run(&rest, folder.path(), true), Ok(Ending::Done)));
        assert!(results(folder.path()) == undisturbed());
    }
    // Asked to stop in the last part, all is done.
    let folder = TempDir::new().unwrap();
    let last = Pendulum { stopped_in: Some(PARTS - 1), ..Pendulum::new() };
    assert!(matches!(run(&last, folder.path(), false), Ok(Ending::Done)));
}

#[test]
fn a_failed_part_leaves_the_others() {
    let folder = TempDir::new().unwrap();
    let failing = Pendulum { fails_in: Some(3), ..Pendulum::new() };
    assert_eq!(refusal(&failing, folder.path(), false), "study pendulum, swing 3: the thread broke");
    assert_eq!(fs::read_to_string(folder.path().join("swings.csv")).unwrap().lines().count(), 7);
    assert!(matches!(run(&Pendulum::new(), folder.path(), true), Ok(Ending::Done)));
    assert!(results(folder.path()) == undisturbed());
}

#[test]
fn a_line_that_was_not_written_to_its_end_is_dropped() {
    let whole = TempDir::new().unwrap();
    run(&Pendulum::new(), whole.path(), false).unwrap();
    let content = fs::read(journal(whole.path())).unwrap();
    let expected = results(whole.path());
    // Killed after any number of bytes.
    for len in (0..content.len()).step_by(37).chain([content.len() - 1, content.len()]) {
        let folder = TempDir::new().unwrap();
        fs::write(journal(folder.path()), &content[..len]).unwrap();
        assert!(matches!(run(&Pendulum::new(), folder.path(), true), Ok(Ending::Done)), "{len}");
        assert!(results(folder.path()) == expected, "{len}");
        assert_eq!(fs::read(journal(folder.path())).unwrap(), content, "{len}");
    }
    // A broken line in the middle is no accident of writing.
    let lines: Vec<&[u8]> = content.split_inclusive(|&b| b == b'\n').collect();
    let broken = [lines[0], b"{\"part\":\n", lines[2]].concat();
    fs::write(journal(whole.path()), &broken).unwrap();
    let error = refusal(&Pendulum::new(), whole.path(), true);
    assert!(error.contains("pendulum.parts.jsonl:2: ") && error.contains("without --resume"), "{error}");
    assert_eq!(fs::read(journal(whole.path())).unwrap(), broken);
}

#[test]
fn a_study_resumed_otherwise_is_refused() {
    let folder = TempDir::new().unwrap();
    run(&Pendulum { stopped_in: Some(1), ..Pendulum::new() }, folder.path(), false).unwrap();
    let before = results(folder.path());
    let longer = Pendulum { length_m: 0.2, ..Pendulum::new() };
    let error = refusal(&longer, folder.path(), true);
    assert!(error.contains("other settings: length_m was 0.1 and is 0.2; give the same"), "{error}");
    assert!(results(folder.path()) == before);
    let content = fs::read_to_string(journal(folder.path())).unwrap();
    let version = format!("\"version\":\"{}\"", env!("CARGO_PKG_VERSION"));
    fs::write(journal(folder.path()), content.replace(&version, "\"version\":\"0.0.0\"")).unwrap();
    assert!(refusal(&Pendulum::new(), folder.path(), true).contains("of egomotion 0.0.0, this is"));
    fs::write(journal(folder.path()), "a diary\n").unwrap();
    assert!(refusal(&Pendulum::new(), folder.path(), true).contains("does not tell what was begun"));
    // Anew it starts whatever is there.
    assert!(matches!(run(&longer, folder.path(), false), Ok(Ending::Done)));
}

#[test]
fn a_place_that_cannot_be_written_is_named() {
    let folder = TempDir::new().unwrap();
    let file = folder.path().join("file");
    fs::write(&file, "mine").unwrap();
    assert!(refusal(&Pendulum::new(), &file, false).contains("file: cannot make the folder"));
    for name in ["figure-1.svg", "swings.csv", "page.html", "pendulum.parts.jsonl"] {
        let folder = TempDir::new().unwrap();
        fs::create_dir(folder.path().join(name)).unwrap();
        let error = refusal(&Pendulum::new(), folder.path(), false);
        assert!(error.contains(&format!("{name}: cannot write")), "{error}");
    }
}

#[cfg(target_os = "linux")]
#[test]
fn a_full_disk_is_named() {
    let folder = TempDir::new().unwrap();
    std::os::unix::fs::symlink("/dev/full", journal(folder.path())).unwrap();
    let error = refusal(&Pendulum::new(), folder.path(), false);
    assert!(
        error.contains("pendulum.parts.jsonl: cannot write") && error.contains("free some space"),
        "{error}"
    );
}

#[test]
fn studies_share_a_folder_and_a_page() {
    let folder = TempDir::new().unwrap();
    let study = Pendulum::new();
    let options = LaboratoryOptions { title: Some("All".into()), ..LaboratoryOptions::default() };
    let mut laboratory = Laboratory::open(folder.path(), options, Arc::clone(&study.stop)).unwrap();
    laboratory.run(&study).unwrap();
    laboratory.run(&Pendulum { stopped_in: Some(2), ..study.clone() }).unwrap();
    // Once stopped, what comes later is not begun.
    laboratory.run(&Pendulum { fails_in: Some(0), ..study }).unwrap();
    assert!(matches!(laboratory.close(), Ok(Ending::Interrupted)));
    let names: Vec<String> = results(folder.path()).into_iter().map(|(name, _)| name).collect();
    assert_eq!(
        names,
        ["figure-1.svg", "page.html", "pendulum-figure-1.svg", "pendulum-swings.csv", "swings.csv"]
    );
    let page = fs::read_to_string(folder.path().join(page::NAME)).unwrap();
    assert!(page.contains("<h1>All</h1>") && page.contains("3 of 6 parts are done"));
    for name in names.iter().filter(|name| *name != page::NAME) {
        assert!(
            page.contains(&format!("href=\"{name}\"")) && page.contains(&format!("id=\"{name}\"")),
            "{name}"
        );
    }
}
