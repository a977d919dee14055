//! Studies as a process: files, the same numbers whatever happens on the way, and refusals.
#![cfg(unix)]

use std::collections::BTreeSet;
use std::ffi::OsStr;
use std::fs;
use std::path::Path;

use crate::background::{Background, whole_lines};
use crate::process::{Ended, assert_refused, egomotion, names};

/// The journal of the study.
const JOURNAL: &str = "table.parts.jsonl";

/// Three parts.
const OPTIONS: &str = "study table --sequence C --features 200 --draws 21 --seed 5";

fn call(options: &str, out: &Path) -> Ended {
    let out = out.to_str().unwrap();
    egomotion(options.split_whitespace().chain(["--out", out]))
}

fn done(options: &str, out: &Path) {
    let ended = call(options, out);
    assert_eq!(ended.code, 0, "{options}: {}", ended.stderr);
}

#[test]
fn one_setting_has_a_row_for_every_contender_and_quantity() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("table");
    done("study table --sequence A --features 100 --draws 2 --round inf", &out);
    let mut file = csv::Reader::from_path(out.join("table.csv")).unwrap();
    let header = "sequence,baseline,sweep,value,approach,method,estimator,quantity,erm_signed,erm_abs,eam,std,standard_error,n";
    assert_eq!(file.headers().unwrap().iter().collect::<Vec<_>>().join(","), header);
    let rows: Vec<csv::StringRecord> = file.records().map(Result::unwrap).collect();
    let column = |k: usize| rows.iter().map(|row| row[k].to_owned()).collect::<BTreeSet<_>>();
    let is = |k: usize, words: &str| assert_eq!(column(k), words.split(' ').map(str::to_owned).collect());
    is(0, "A");
    is(1, "custom");
    is(2, "table");
    is(4, "differential discrete");
    is(5, "dcce dv joint linear22 rigid ml");
    is(6, "ls lmeds irls eiv ml");
    is(7, "vz vz_phi tx ty tz wx wy wz");
    is(13, "2");
    // tX of sequence A is zero: a mean error, no relative one.
    let tx = rows.iter().find(|row| &row[7] == "tx").unwrap();
    assert!(tx[8].is_empty() && tx[9].is_empty() && tx[10].parse::<f64>().unwrap() > 0.0, "{tx:?}");
    // Every row is of a contender; (22) and the rotation are discrete, each pixel's VZ needs no estimator, and so few
    // features do not determine all six by DCCE without its bias.
    assert_eq!(rows.len(), (9 + 2 + 15 + 1) * 7 + 4);
    assert!(names(&out).contains(&"page.html".to_owned()));
}

#[test]
fn a_study_that_was_stopped_and_resumed_differs_in_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let [whole, stopped] = ["whole", "stopped"].map(|name| folder.path().join(name));
    done(&format!("{OPTIONS} --threads 1"), &whole);
    // What a study leaves that was stopped after its first part.
    let lines = whole_lines(&whole.join(JOURNAL));
    assert_eq!(lines.len(), 1 + 3);
    fs::create_dir(&stopped).unwrap();
    fs::write(stopped.join(JOURNAL), lines[..2].concat()).unwrap();

    let other = call(&format!("{OPTIONS} --resume --std 0.25"), &stopped);
    assert_refused(&other, 1, &["std_disp_px", "--resume"]);
    done(&format!("{OPTIONS} --resume"), &stopped);
    for file in ["table.csv", "table-bound.csv"] {
        assert_eq!(fs::read(whole.join(file)).unwrap(), fs::read(stopped.join(file)).unwrap(), "{file}");
    }
}

#[test]
fn an_interrupted_study_writes_the_parts_that_are_done() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    // More draws than any machine makes until the signal.
    let options = "study table --sequence C --features 100 --draws 1000000 --out";
    let mut running = Background::begin(options.split_whitespace().map(OsStr::new).chain([out.as_os_str()]));
    running.wait_for_parts(&out.join(JOURNAL), 1);
    running.interrupt();
    let ended = running.ended();
    assert_eq!(ended.code, 130, "{}", ended.stderr);
    assert!(ended.stderr.contains("stopping after this part"), "{}", ended.stderr);
    assert!(ended.stderr.contains("the same command with --resume goes on"), "{}", ended.stderr);
    assert!(fs::read_to_string(out.join("page.html")).unwrap().contains("The same command with --resume"));
    assert!(out.join("table.csv").exists());
}

#[test]
fn what_has_no_meaning_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    for options in [
        "study table --sequence Q",
        "study table --sequence C --step -1",
        "study sensitivity --sequence Z",
        "study real --sequences lab-K",
        "study sensitivities",
        "study",
    ] {
        let ended = call(options, folder.path());
        assert_eq!((ended.code, ended.stdout.as_str()), (2, ""), "{options}: {}", ended.stderr);
    }
    let far = call("study table --sequence C --step 1e6 --draws 1", &folder.path().join("far"));
    assert_refused(&far, 1, &["STEP 1000000", "leave the room"]);
    let file = folder.path().join("file");
    fs::write(&file, "in the way").unwrap();
    assert_refused(&call("study table --sequence A --draws 1", &file), 1, &["file"]);
    let none = folder.path().join("none");
    assert_refused(
        &call(&format!("study real {}", none.display()), &folder.path().join("real")),
        1,
        &["none"],
    );
}
