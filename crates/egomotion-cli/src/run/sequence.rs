//! One sequence: which frames, read how, and what is written of it.

use std::path::Path;
use std::sync::atomic::AtomicBool;

use anyhow::Result;
use egomotion::pipeline::{Config, Unanswered};
use egomotion_io::recording::Recording;
use egomotion_io::source::Sequence;

use super::resume::{self, Settings};
use crate::args::RunArgs;
use crate::judge::{self, MapVerdict};
use crate::results::{About, ResultFolder};
use crate::session::{Outcome, Row, Session, progress};
use crate::summary::{Cameras, Summary};
use crate::{Usage, refusal, terminal};
use egomotion_report::run::Eyes;

/// A finished sequence.
pub struct DoneSequence {
    pub summary: Summary,
    pub first_failure: Option<String>,
}

/// Run one sequence into a folder; if it stands `alone`, so that it can be resumed. `None` where it was complete
/// before.
pub fn run_sequence(
    args: &RunArgs,
    config: &Config,
    sequence: &Sequence,
    out: &Path,
    stop: &AtomicBool,
    alone: bool,
) -> Result<Option<DoneSequence>> {
    let recording = Recording::open(&args.source, sequence, &args.recording_options()).map_err(refusal)?;
    let (rig, frames) = (recording.rig, recording.len());
    let config = &suited(args, config, &recording)?;
    let folder = ResultFolder::create(out)?;
    let cameras = Cameras::of(sequence);
    let settings = Settings { options: args, config, rig: Some(&rig), cameras: cameras.clone(), frames };
    let mut log = None;
    if alone {
        log = resume::log(out, &settings.head()?, args.resume, &recording)?;
        if log.is_none() {
            return Ok(None);
        }
    }
    let maps = args.map_files();
    maps.folders(out)?;
    if args.resume {
        folder.sweep()?;
        maps.sweep(out)?;
    }
    let bar = progress(frames, args.quiet);
    bar.set_message(sequence.name.clone());
    let session = Session {
        rig,
        config,
        frames,
        masks: recording.masks.clone(),
        tracks: recording.is_of_tracks(),
        progress: bar,
    };
    let mut truth_maps: Option<MapVerdict> = None;
    let outcome = session.run(
        log,
        stop,
        |k| recording.read_frame(k),
        |row| {
            let (Some(dense), Some(index)) = (&row.motion.dense, row.reference_index) else { return Ok(()) };
            if let Some(truth) = sequence.truth_files.as_ref().filter(|t| t.index == index && !args.reverse) {
                truth_maps = judge::scene_maps(&rig, dense, truth)?;
            }
            maps.write(out, index, dense, &rig)
        },
    )?;
    let mut summary = Summary::new(args.source.display().to_string(), rig, config, &outcome);
    summary.truth_maps = truth_maps;
    (summary.options, summary.cameras) = (Some(serde_json::to_value(args)?), cameras);
    let eyes = match (recording.is_of_tracks(), recording.is_of_depth()) {
        (true, _) => Eyes::Tracks,
        (false, true) => Eyes::Depth,
        (false, false) => Eyes::Stereo,
    };
    folder.write_motion(config, &outcome, args.parquet)?;
    write_about(&folder, &sequence.name, eyes, &summary, &outcome)?;
    let first_failure = first_failure(&outcome.rows);
    match outcome.log {
        Some(log) if outcome.complete => log.remove()?,
        Some(_) => terminal::tell(format_args!(
            "stopped after {} of {} frames; the same command with --resume goes on",
            summary.frames, frames
        )),
        None => {}
    }
    Ok(Some(DoneSequence { summary, first_failure }))
}

/// The settings as they apply to a recording, where they fit together.
fn suited(args: &RunArgs, config: &Config, recording: &Recording) -> Result<Config> {
    let config = recording.config(config);
    config.check().map_err(|e| anyhow::Error::new(Usage(e.to_string())))?;
    if recording.is_of_tracks() && args.map_files().any() {
        return Err(Usage("--maps need images, not tracks".into()).into());
    }
    Ok(config)
}

/// Summary and report.
fn write_about(
    folder: &ResultFolder,
    name: &str,
    eyes: Eyes,
    summary: &Summary,
    outcome: &Outcome,
) -> Result<()> {
    for warning in &summary.warnings {
        terminal::tell(format_args!("{name}: warning: {warning}"));
    }
    folder.write_json("summary.json", summary)?;
    let about = About {
        title: &format!("How the camera moved: {name}"),
        source: &summary.source,
        command: terminal::command_line().replace(" --resume", ""),
        config: &summary.config,
        rig: &summary.rig,
        eyes,
        notes: notes(summary),
    };
    folder.write_report(&about, outcome)
}

/// Why the first frame without an answer has none.
fn first_failure(rows: &[Row]) -> Option<String> {
    let failures = rows.iter().filter_map(|row| row.motion.motion.as_ref().err());
    failures.filter(|why| **why != Unanswered::First).map(ToString::to_string).next()
}

/// What the report should say besides.
fn notes(summary: &Summary) -> Vec<String> {
    let mut notes = Vec::new();
    if summary.truth.is_some() {
        notes.push(
            "The poses that come with a recording have errors of their own, which count against the bands."
                .into(),
        );
    }
    notes.extend(summary.warnings.iter().cloned());
    notes
}
