//! The parts of a study or a run that are done, kept on the disk so that what was stopped can go on.
//!
//! One JSON object a line: first what was begun, then each part as it is done, flushed before the next begins.
//! The records of a part are a string in RON, whose numbers may be NaN or infinite and come back as they were.

use std::collections::BTreeMap;
use std::fs::{self, File, OpenOptions};
use std::io::{self, ErrorKind, Write};
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use egomotion_io::IoError;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use serde_json::Value;

/// What to do where there is nothing to go on with.
pub const START_ANEW: &str = "run without --resume to start anew";

/// The first line: what was begun.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct JournalHeader {
    /// Version of this program.
    pub version: String,
    /// What it was to do: a run, or a study by its name.
    pub work: String,
    /// All that the results depend on.
    pub settings: Value,
}

impl JournalHeader {
    /// Work of this program.
    pub fn new(work: impl Into<String>, settings: Value) -> Self {
        Self { version: env!("CARGO_PKG_VERSION").into(), work: work.into(), settings }
    }

    /// Refuse what was begun otherwise; `path` is where that is told.
    pub fn check(&self, begun: &Self, path: &Path) -> Result<()> {
        if (&begun.work, &begun.version) != (&self.work, &self.version) {
            bail!(
                "{}: was begun as {} of egomotion {}, this is {} of {}; {START_ANEW}",
                path.display(),
                begun.work,
                begun.version,
                self.work,
                self.version
            );
        }
        let differences = differences(&begun.settings, &self.settings);
        if !differences.is_empty() {
            bail!(
                "{}: was begun with other settings: {}; give the same settings, or {START_ANEW}",
                path.display(),
                differences.join(", ")
            );
        }
        Ok(())
    }
}

/// A line after the first: one part that is done.
#[derive(Serialize, Deserialize)]
struct DonePart {
    part: String,
    records: String,
}

/// The open file; parts are added at its end.
#[derive(Debug)]
pub struct Journal {
    path: PathBuf,
    file: File,
}

/// Records of a part by its name.
pub type Parts<R> = BTreeMap<String, Vec<R>>;

impl Journal {
    /// Begin anew.
    pub fn begin(path: &Path, header: &JournalHeader) -> Result<Self> {
        let file = File::create(path).map_err(|e| IoError::system(path, "write", &e))?;
        let mut journal = Self { path: path.to_owned(), file };
        journal.line(header)?;
        Ok(journal)
    }

    /// Go on with what is there, if it was begun by the same program with the same settings; without a file
    /// begin anew. A last line that was not written to its end is dropped.
    pub fn resume<R: DeserializeOwned>(path: &Path, header: &JournalHeader) -> Result<(Self, Parts<R>)> {
        let content = match fs::read(path) {
            Err(error) if error.kind() == ErrorKind::NotFound => Vec::new(),
            other => other.map_err(|e| IoError::system(path, "read", &e))?,
        };
        let mut lines: Vec<&[u8]> = content.split_inclusive(|&b| b == b'\n').collect();
        lines.pop_if(|last| !last.ends_with(b"\n"));
        let Some((first, rest)) = lines.split_first() else {
            return Ok((Self::begin(path, header)?, Parts::new()));
        };
        let Ok(begun) = serde_json::from_slice(first) else {
            return Err(IoError::new(path, "does not tell what was begun", START_ANEW).at_line(1).into());
        };
        header.check(&begun, path)?;
        let (mut parts, mut kept) = (Parts::new(), first.len());
        for (k, line) in rest.iter().enumerate() {
            match part(line) {
                Ok((name, records)) => parts.insert(name, records),
                // What a crash left behind the last part that is whole.
                Err(_) if k + 1 == rest.len() => break,
                Err(error) => {
                    return Err(IoError::new(path, error, START_ANEW).at_line(k + 2).into());
                }
            };
            kept += line.len();
        }
        let open = || -> io::Result<File> {
            let file = OpenOptions::new().append(true).open(path)?;
            file.set_len(kept as u64)?;
            Ok(file)
        };
        let file = open().map_err(|e| IoError::system(path, "write", &e))?;
        Ok((Self { path: path.to_owned(), file }, parts))
    }

    /// Add a part.
    pub fn add<R: Serialize>(&mut self, name: &str, records: &[R]) -> Result<()> {
        self.line(&DonePart { part: name.to_owned(), records: in_ron(name, records)? })
    }

    /// Add a part, and give its records back as they will be read when the work is resumed.
    pub fn exchange<R: Serialize + DeserializeOwned>(&mut self, name: &str, records: &[R]) -> Result<Vec<R>> {
        let records = in_ron(name, records)?;
        let again =
            ron::from_str(&records).with_context(|| format!("the records of {name} cannot be read back"))?;
        self.line(&DonePart { part: name.to_owned(), records })?;
        Ok(again)
    }

    /// All is done: nothing is left to go on with.
    pub fn remove(self) -> Result<()> {
        Ok(fs::remove_file(&self.path).map_err(|e| IoError::system(&self.path, "remove", &e))?)
    }

    fn line(&mut self, value: &impl Serialize) -> Result<()> {
        let mut line = serde_json::to_vec(value).context("the settings cannot be put into JSON")?;
        line.push(b'\n');
        let written = self.file.write_all(&line).and_then(|()| self.file.sync_data());
        Ok(written.map_err(|e| IoError::system(&self.path, "write", &e))?)
    }
}

fn in_ron<R: Serialize>(name: &str, records: &[R]) -> Result<String> {
    ron::to_string(records).with_context(|| format!("the records of {name} cannot be kept"))
}

fn part<R: DeserializeOwned>(line: &[u8]) -> Result<(String, Vec<R>)> {
    let done: DonePart = serde_json::from_slice(line)?;
    Ok((done.part, ron::from_str(&done.records)?))
}

/// Each setting that differs, as `step was 1 and is 2`.
fn differences(before: &Value, now: &Value) -> Vec<String> {
    let (before, now) = (settings(before), settings(now));
    let mut names: Vec<&String> = before.keys().chain(now.keys()).collect();
    names.sort();
    names.dedup();
    let of =
        |all: &BTreeMap<String, String>, name: &String| all.get(name).cloned().unwrap_or("absent".into());
    let changed = names.into_iter().filter(|name| before.get(*name) != now.get(*name));
    changed.map(|name| format!("{name} was {} and is {}", of(&before, name), of(&now, name))).collect()
}

/// Every single setting by its dotted name.
fn settings(value: &Value) -> BTreeMap<String, String> {
    fn collect(name: String, value: &Value, all: &mut BTreeMap<String, String>) {
        let below = |key: &str| if name.is_empty() { key.to_owned() } else { format!("{name}.{key}") };
        match value {
            Value::Object(map) => map.iter().for_each(|(key, value)| collect(below(key), value, all)),
            Value::Array(list) if list.iter().any(|v| v.is_object() || v.is_array()) => {
                list.iter().enumerate().for_each(|(k, value)| collect(below(&k.to_string()), value, all));
            }
            Value::Null => drop(all.insert(name, "none".into())),
            Value::String(text) => drop(all.insert(name, text.clone())),
            other => drop(all.insert(name, other.to_string())),
        }
    }
    let mut all = BTreeMap::new();
    collect(String::new(), value, &mut all);
    all
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
    enum Kind {
        Plain,
        With(f32),
    }

    #[derive(Debug, Clone, Serialize, Deserialize)]
    struct Record {
        name: String,
        kind: Kind,
        values: Vec<f64>,
        maybe: Option<f64>,
        count: u64,
        pair: (i32, [f32; 2]),
    }

    fn bits(r: &Record) -> (Vec<u64>, Option<u64>, [u32; 2], &str, u64) {
        let values = r.values.iter().map(|v| v.to_bits()).collect();
        (values, r.maybe.map(f64::to_bits), r.pair.1.map(f32::to_bits), &r.name, r.count)
    }

    #[test]
    fn every_number_comes_back_as_it_was() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.parts.jsonl");
        let header = JournalHeader::new("a", json!({"seed": 1}));
        // Patterns of bits from a linear congruential generator: every exponent, both signs.
        let mut state = 2003_u64;
        let mut next = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            f64::from_bits(state)
        };
        let mut values: Vec<f64> =
            std::iter::repeat_with(&mut next).filter(|v| !v.is_nan()).take(3000).collect();
        values.extend([
            f64::NAN,
            f64::INFINITY,
            f64::NEG_INFINITY,
            -0.0,
            0.1,
            1e16,
            f64::MIN_POSITIVE,
            5e-324,
            3.0,
        ]);
        let record = |maybe| Record {
            name: "ΔZ \"quoted\"\n\\ line".into(),
            kind: Kind::With(0.1),
            values: values.clone(),
            maybe,
            count: u64::MAX,
            pair: (-3, [f32::NAN, 1.1e-38]),
        };
        let records =
            [record(None), record(Some(f64::NAN)), Record { kind: Kind::Plain, ..record(Some(2.0)) }];
        let mut journal = Journal::begin(&path, &header).unwrap();
        let taken = journal.exchange("one", &records).unwrap();
        let (_, parts) = Journal::resume::<Record>(&path, &header).unwrap();
        for found in [&taken, &parts["one"]] {
            assert_eq!(
                found.iter().map(bits).collect::<Vec<_>>(),
                records.iter().map(bits).collect::<Vec<_>>()
            );
            assert_eq!(found[2].kind, Kind::Plain);
        }
    }

    #[test]
    fn settings_that_differ_are_named() {
        let before = json!({"step": 1.0, "noise": {"disparity_px": 0.125, "round": null}, "poses": [1, 2]});
        let now =
            json!({"step": 1.0, "noise": {"disparity_px": 0.25, "round": 16.0}, "poses": [1, 3], "seed": 7});
        assert_eq!(
            differences(&before, &now),
            [
                "noise.disparity_px was 0.125 and is 0.25",
                "noise.round was none and is 16.0",
                "poses was [1,2] and is [1,3]",
                "seed was absent and is 7",
            ]
        );
        assert!(differences(&now, &now).is_empty());
    }
}
