//! `--resume`: what was begun in a folder, and whether this is the same run.

use std::fs;
use std::path::Path;

use anyhow::{Context, Result, bail};
use egomotion::geometry::StereoRig;
use egomotion::pipeline::Config;
use egomotion_io::IoError;
use egomotion_io::recording::Recording;
use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::Value;

use crate::journal::{Journal, JournalHeader, Parts, START_ANEW};
use crate::results::Cameras;
use crate::session::RunLog;

/// The journal in a folder of results.
const JOURNAL: &str = "run.parts.jsonl";
/// The file that tells of a run that is complete.
const SUMMARY: &str = "summary.json";

/// What makes two runs the same: all that results depend on, besides the files of the frames.
///
/// `summary.json` holds it too.
#[derive(Debug, Serialize)]
pub struct RunIdentity<'a> {
    pub options: &'a Value,
    pub config: &'a Config,
    /// Nothing of a set, whose scenes have their own.
    pub rig: Option<&'a StereoRig>,
    pub cameras: Option<Cameras>,
    /// Number of frames, or of scenes.
    pub frames: usize,
}

impl RunIdentity<'_> {
    /// As it is once it was written and read: numbers of single precision have few digits.
    pub fn header(&self) -> Result<JournalHeader> {
        let text = serde_json::to_string(self).context("the settings cannot be put into JSON")?;
        Ok(JournalHeader::new("run", serde_json::from_str(&text)?))
    }
}

/// Refuse to go on where nothing was begun.
pub fn expect_run(out: &Path) -> Result<()> {
    if [JOURNAL, SUMMARY].iter().any(|name| out.join(name).exists()) {
        return Ok(());
    }
    bail!("{}: holds no run to go on with; {START_ANEW}", out.display())
}

/// The journal to write to, with the parts that are in it; `None` where nothing is left to do.
///
/// # Errors
/// What was begun is not this run, or cannot be read.
pub fn open_journal<R: DeserializeOwned>(
    out: &Path,
    header: &JournalHeader,
    resume: bool,
) -> Result<Option<(Journal, Parts<R>)>> {
    let path = out.join(JOURNAL);
    if !resume {
        return Ok(Some((Journal::begin(&path, header)?, Parts::new())));
    }
    if path.exists() {
        return Ok(Some(Journal::resume(&path, header)?));
    }
    let path = out.join(SUMMARY);
    let text = fs::read_to_string(&path).map_err(|e| IoError::system(&path, "read", &e))?;
    let summary: Value = serde_json::from_str(&text)
        .with_context(|| format!("{}: is not the summary of a run; {START_ANEW}", path.display()))?;
    if summary["complete"] != true {
        bail!("{}: that run was stopped, and its {JOURNAL} is gone; {START_ANEW}", path.display());
    }
    header.check(&header_of_summary(&summary, header), &path)?;
    Ok(None)
}

/// What a summary tells of the run's beginning.
fn header_of_summary(summary: &Value, header: &JournalHeader) -> JournalHeader {
    let frames = match &summary["scenes"] {
        Value::Array(scenes) => scenes.len().into(),
        Value::Object(scenes) => scenes.len().into(),
        _ => summary["frames"].clone(),
    };
    let mut settings = header.settings.clone();
    for (name, value) in settings.as_object_mut().into_iter().flatten() {
        *value = if name == "frames" { frames.clone() } else { summary[name.as_str()].clone() };
    }
    let version = summary["version"].as_str().unwrap_or_default().to_owned();
    JournalHeader { version, ..JournalHeader::new("run", settings) }
}

/// The log of a sequence whose frames are still those that were done; `None` where nothing is left to do.
///
/// # Errors
/// As [`open_journal`]; and the recording was changed since.
pub fn open_log(
    out: &Path,
    header: &JournalHeader,
    resume: bool,
    recording: &Recording,
) -> Result<Option<RunLog>> {
    let Some((journal, parts)) = open_journal(out, header, resume)? else { return Ok(None) };
    let log = RunLog::new(journal, parts);
    for (k, (done, (files, time_s))) in log.past().zip(&recording.frames).enumerate() {
        let (row, bytes) = (&done.row, recording.bytes(k));
        let change = if row.index != files.index {
            format!("it was number {}", row.index)
        } else if row.motion.time_s != *time_s {
            format!("its time was {:?} s and is {time_s:?} s", row.motion.time_s)
        } else if done.bytes != bytes {
            format!("its files had {} bytes and have {bytes}", done.bytes)
        } else if done.pose != files.truth {
            "it has another true pose".to_owned()
        } else {
            continue;
        };
        bail!("{}: frame {} was changed since: {change}; {START_ANEW}", files.left.display(), files.index);
    }
    Ok(Some(log))
}
