//! `--resume`: what was begun in a folder, and whether this is the same.

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

use crate::args::RunArgs;
use crate::journal::{ANEW, Head, Journal, Parts};
use crate::session::Log;
use crate::summary::Cameras;

/// The journal in a folder of results.
const JOURNAL: &str = "run.parts.jsonl";
/// What tells of a run that is complete.
const SUMMARY: &str = "summary.json";

/// All that results depend on, besides the files of the frames; `summary.json` holds it too.
#[derive(Debug, Serialize)]
pub struct Settings<'a> {
    pub options: &'a RunArgs,
    pub config: &'a Config,
    /// Nothing of a set, whose scenes have their own.
    pub rig: Option<&'a StereoRig>,
    pub cameras: Option<Cameras>,
    /// Number of frames, or of scenes.
    pub frames: usize,
}

impl Settings<'_> {
    /// As they are once they were written and read: numbers of single precision have few digits.
    pub fn head(&self) -> Result<Head> {
        let text = serde_json::to_string(self).context("the settings cannot be put into JSON")?;
        Ok(Head::new("run", serde_json::from_str(&text)?))
    }
}

/// Refuse to go on where nothing was begun.
pub fn expect_run(out: &Path) -> Result<()> {
    if [JOURNAL, SUMMARY].iter().any(|name| out.join(name).exists()) {
        return Ok(());
    }
    bail!("{}: holds no run to go on with; {ANEW}", out.display())
}

/// The journal to write to, with the parts that are in it; `None` where nothing is left to do.
///
/// # Errors
/// What was begun is not this run, or cannot be read.
pub fn open<R: DeserializeOwned>(
    out: &Path,
    head: &Head,
    resume: bool,
) -> Result<Option<(Journal, Parts<R>)>> {
    let path = out.join(JOURNAL);
    if !resume {
        return Ok(Some((Journal::begin(&path, head)?, Parts::new())));
    }
    if path.exists() {
        return Ok(Some(Journal::resume(&path, head)?));
    }
    let path = out.join(SUMMARY);
    let text = fs::read_to_string(&path).map_err(|e| IoError::system(&path, "read", &e))?;
    let summary: Value = serde_json::from_str(&text)
        .with_context(|| format!("{}: is not the summary of a run; {ANEW}", path.display()))?;
    if summary["complete"] != true {
        bail!("{}: that run was stopped, and its {JOURNAL} is gone; {ANEW}", path.display());
    }
    head.check(&told(&summary, head), &path)?;
    Ok(None)
}

/// What a summary tells of the run's beginning.
fn told(summary: &Value, head: &Head) -> Head {
    let frames = match &summary["scenes"] {
        Value::Array(scenes) => scenes.len().into(),
        Value::Object(scenes) => scenes.len().into(),
        _ => summary["frames"].clone(),
    };
    let mut settings = head.settings.clone();
    for (name, value) in settings.as_object_mut().into_iter().flatten() {
        *value = if name == "frames" { frames.clone() } else { summary[name.as_str()].clone() };
    }
    let version = summary["version"].as_str().unwrap_or_default().to_owned();
    Head { version, ..Head::new("run", settings) }
}

/// The journal of a sequence whose frames are still those that were done; `None` where nothing is left to do.
///
/// # Errors
/// As [`open`]; and the recording was changed since.
pub fn log(out: &Path, head: &Head, resume: bool, recording: &Recording) -> Result<Option<Log>> {
    let Some((journal, parts)) = open(out, head, resume)? else { return Ok(None) };
    let log = Log::new(journal, parts);
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
        bail!("{}: frame {} was changed since: {change}; {ANEW}", files.left.display(), files.index);
    }
    Ok(Some(log))
}
