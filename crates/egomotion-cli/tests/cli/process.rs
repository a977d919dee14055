//! The command as a process.

use std::ffi::OsStr;
use std::path::Path;
use std::process::Output;

use assert_cmd::cargo::cargo_bin_cmd;
use serde_json::Value;

/// How a call ended.
pub struct Ended {
    pub code: i32,
    pub stdout: String,
    pub stderr: String,
}

impl Ended {
    /// Every call in every test comes by here: none may panic or die of a signal.
    pub fn of(output: Output) -> Self {
        let text = |bytes: Vec<u8>| String::from_utf8(bytes).expect("the command prints UTF-8");
        let (stdout, stderr) = (text(output.stdout), text(output.stderr));
        assert!(!stderr.contains("panicked"), "{stderr}");
        let code = output.status.code().unwrap_or_else(|| panic!("ended by {}: {stderr}", output.status));
        Self { code, stdout, stderr }
    }

    /// The whole of standard output as JSON.
    pub fn json(&self) -> Value {
        serde_json::from_str(&self.stdout).unwrap_or_else(|e| panic!("{e}: {}", self.stdout))
    }
}

/// Call the command in the current folder.
pub fn egomotion<S: AsRef<OsStr>>(args: impl IntoIterator<Item = S>) -> Ended {
    Ended::of(cargo_bin_cmd!("egomotion").args(args).output().unwrap())
}

/// `run SOURCE --out OUT` with options separated by blanks; it must succeed.
pub fn run(source: &Path, out: &Path, options: &str) -> Ended {
    let ended = try_run(source, out, options);
    assert_eq!(ended.code, 0, "{options}: {}", ended.stderr);
    ended
}

/// `run SOURCE --out OUT` with options separated by blanks.
pub fn try_run(source: &Path, out: &Path, options: &str) -> Ended {
    let mut command = cargo_bin_cmd!("egomotion");
    command.arg("run").arg(source).arg("--out").arg(out).args(options.split_whitespace());
    Ended::of(command.output().unwrap())
}

/// A refusal: the exit code, and a last line that holds every one of `parts` and nothing on standard output.
pub fn assert_refused(ended: &Ended, code: i32, parts: &[&str]) {
    assert_eq!(ended.code, code, "{}", ended.stderr);
    assert_eq!(ended.stdout, "");
    let line = ended.stderr.lines().last().unwrap_or_default();
    assert!(line.starts_with("egomotion: "), "{}", ended.stderr);
    for part in parts {
        assert!(line.contains(part), "{part:?} is not in {line:?}");
    }
}

/// Names in a folder, sorted.
pub fn names(folder: &Path) -> Vec<String> {
    let entries = folder.read_dir().unwrap_or_else(|e| panic!("{}: {e}", folder.display()));
    let mut names: Vec<_> = entries.map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}

/// `summary.json` of a folder of results.
pub fn summary(out: &Path) -> Value {
    serde_json::from_slice(&std::fs::read(out.join("summary.json")).unwrap()).unwrap()
}
