//! One sequence: which frames, read how, and what is written of it.

use std::path::Path;
use std::sync::atomic::AtomicBool;

use anyhow::Result;
use egomotion::geometry::RigCamera;
use egomotion::pipeline::{Config, Unanswered};
use egomotion_io::recording::Recording;
use egomotion_io::source::Sequence;
use egomotion_report::run::InputKind;

use super::plan::{RecordingInput, RunPlan, checked};
use super::resume::{RunIdentity, open_log};
use crate::exit::{UsageError, choice_error};
use crate::results::verdict::{MapVerdict, scene_maps};
use crate::results::{Cameras, ResultFolder, RunDescription, Summary, Viewpoint, write_motion, write_report};
use crate::session::{FrameResult, Outcome, RunLog, Session};
use crate::terminal::{self, frames_bar};

/// One sequence that is to be run into a folder.
pub struct SequenceRun<'a> {
    pub plan: &'a RunPlan,
    pub input: &'a RecordingInput,
    pub sequence: &'a Sequence,
    pub out: &'a Path,
    pub stop: &'a AtomicBool,
}

/// A finished sequence.
pub struct DoneSequence {
    pub summary: Summary,
    pub first_failure: Option<String>,
}

/// A sequence whose frames are chosen, with the settings that suit it.
struct Opened {
    recording: Recording,
    config: Config,
    folder: ResultFolder,
}

impl SequenceRun<'_> {
    /// Run with a log of the frames that are done, so that the run can be resumed; `None` where it was complete before.
    pub fn logged(&self) -> Result<Option<DoneSequence>> {
        let opened = self.open()?;
        let identity = RunIdentity {
            options: &self.plan.options,
            config: &opened.config,
            rig: Some(&opened.recording.rig),
            cameras: Cameras::of(self.sequence),
            frames: opened.recording.len(),
        };
        let log = open_log(self.out, &identity.header()?, self.plan.resume, &opened.recording)?;
        log.map(|log| self.run(&opened, Some(log))).transpose()
    }

    /// Run without a log.
    pub fn unlogged(&self) -> Result<DoneSequence> {
        self.run(&self.open()?, None)
    }

    fn open(&self) -> Result<Opened> {
        let recording = Recording::open(&self.input.path, self.sequence, &self.input.selection);
        let recording = recording.map_err(choice_error)?;
        let config = recording.config(&self.plan.config);
        checked(&config)?;
        if recording.is_of_tracks() && self.plan.maps.any() {
            return Err(UsageError("--maps need images, not tracks".into()).into());
        }
        if recording.is_of_depth() && self.plan.camera != RigCamera::Left {
            return Err(UsageError(
                "a depth camera has no other beside it: --frame can be left alone".into(),
            )
            .into());
        }
        Ok(Opened { recording, config, folder: ResultFolder::create(self.out)? })
    }

    fn run(&self, opened: &Opened, log: Option<RunLog>) -> Result<DoneSequence> {
        let (mut outcome, truth_maps) = self.estimate(opened, log)?;
        let log = outcome.log.take();
        let mut summary = Summary::new(
            self.input.path.display().to_string(),
            self.viewpoint(opened),
            &opened.config,
            &outcome,
        );
        summary.truth_maps = truth_maps;
        (summary.options, summary.cameras) = (Some(self.plan.options.clone()), Cameras::of(self.sequence));
        self.write(opened, &summary, &outcome)?;
        match log {
            Some(log) if outcome.complete => log.remove()?,
            Some(_) => terminal::tell(format_args!(
                "stopped after {} of {} frames; the same command with --resume goes on",
                summary.frames,
                opened.recording.len()
            )),
            None => {}
        }
        Ok(DoneSequence { summary, first_failure: first_failure(&outcome.frames) })
    }

    /// The camera whose φ is written.
    fn viewpoint<'a>(&self, opened: &'a Opened) -> Viewpoint<'a> {
        Viewpoint { rig: &opened.recording.rig, camera: self.plan.camera }
    }

    /// Every frame through the pipeline; maps are written as they come, and judged where the source knows their truth.
    fn estimate(&self, opened: &Opened, log: Option<RunLog>) -> Result<(Outcome, Option<MapVerdict>)> {
        let Opened { recording, config, folder } = opened;
        let (rig, maps) = (recording.rig, &self.plan.maps);
        maps.folders(self.out)?;
        if self.plan.resume {
            folder.sweep()?;
            maps.sweep(self.out)?;
        }
        let progress = frames_bar(recording.len(), self.plan.quiet);
        progress.set_message(self.sequence.name.clone());
        let session = Session {
            rig,
            config,
            frames: recording.len(),
            masks: recording.masks.clone(),
            tracks: recording.is_of_tracks(),
            progress,
        };
        let forwards = !self.input.selection.reverse;
        let mut verdict: Option<MapVerdict> = None;
        let fetch = |k| recording.read_frame(k);
        let outcome = session.run(log, self.stop, fetch, |frame| {
            let (Some(dense), Some(index)) = (&frame.motion.dense, frame.reference_index) else {
                return Ok(());
            };
            if let Some(truth) = self.sequence.truth_files.as_ref().filter(|t| t.index == index && forwards) {
                verdict = scene_maps(&rig, dense, truth)?;
            }
            maps.write(self.out, index, dense, &rig)
        })?;
        Ok((outcome, verdict))
    }

    /// The files of the whole sequence.
    fn write(&self, opened: &Opened, summary: &Summary, outcome: &Outcome) -> Result<()> {
        let (folder, name) = (&opened.folder, &self.sequence.name);
        write_motion(folder, &opened.config, outcome, self.viewpoint(opened), self.plan.parquet)?;
        for warning in &summary.warnings {
            terminal::tell(format_args!("{name}: warning: {warning}"));
        }
        folder.write_json("summary.json", summary)?;
        let description = RunDescription {
            title: &format!("How the camera moved: {name}"),
            source: &summary.source,
            command: terminal::command_line(),
            config: &summary.config,
            rig: &summary.rig,
            input: input_kind(&opened.recording),
            biased: summary.biased.is_some(),
            notes: notes(summary),
        };
        write_report(folder, &description, outcome)
    }
}

fn input_kind(recording: &Recording) -> InputKind {
    match (recording.is_of_tracks(), recording.is_of_depth()) {
        (true, _) => InputKind::Tracks,
        (false, true) => InputKind::Depth,
        (false, false) => InputKind::Stereo,
    }
}

/// Why the first frame without an answer has none.
fn first_failure(frames: &[FrameResult]) -> Option<String> {
    let failures = frames.iter().filter_map(|frame| frame.motion.motion.as_ref().err());
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
    notes.extend(summary.camera_note());
    notes.extend(summary.warnings.iter().cloned());
    notes
}
