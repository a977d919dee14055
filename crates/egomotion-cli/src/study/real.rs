//! `egomotion study real`: section 7.2 on rendered sequences, or on a recording, with true poses or without.

use std::path::PathBuf;

use anyhow::{Context, Result, bail};
use egomotion::geometry::{RigidMotion, StereoRig, Twist};
use egomotion::pipeline::Unanswered;
use egomotion::sim::StereoImages;
use egomotion_io::recording::Reader;
use egomotion_io::source::{FrameFiles, Source};
use egomotion_study::real::{
    DrawId, MatchingSettings, RealError, RealRecord, ShownFrames, Triple, publish_recording,
};
use egomotion_study::{LabStudy, Publication, Study};
use serde::Serialize;

use crate::args::study::RealArgs;
use crate::exit::UsageError;

/// Pixels between two observations of φ in a recording, whose images are larger than the rendered ones: with fewer a
/// study takes longer, with more the estimate rests on fewer equations.
const RECORDING_SAMPLE_STEP_PX: usize = 4;

/// The study of a recording; `None` where none was typed.
pub fn recording(args: &RealArgs) -> Result<Option<RecordingStudy>> {
    args.source.clone().map(|source| RecordingStudy::open(args, source)).transpose()
}

/// The study of rendered sequences.
pub fn rendered(args: &RealArgs) -> LabStudy {
    let own = LabStudy::default();
    LabStudy {
        sequences: args.sequences.clone().unwrap_or(own.sequences),
        width_px: args.size.0,
        height_px: args.size.1,
        step: args.step,
        poses: own.poses,
        seeds: args.laboratory.draws.map_or(own.seeds, |n| u32::try_from(n).unwrap_or(u32::MAX)),
        first_seed: args.laboratory.seed,
        levels: args.round,
        sample_step_px: args.sample.unwrap_or(own.sample_step_px),
    }
}

/// The frames of a recording, three at a time.
#[derive(Debug, Serialize)]
pub struct RecordingStudy {
    source: PathBuf,
    name: String,
    rig: StereoRig,
    how: MatchingSettings,
    stride: usize,
    /// Numbers of the frames.
    indices: Vec<usize>,
    #[serde(skip)]
    frames: Vec<FrameFiles>,
    #[serde(skip)]
    reader: Reader,
}

impl RecordingStudy {
    fn open(args: &RealArgs, path: PathBuf) -> Result<Self> {
        let source = Source::open_with(&path, args.calibration.as_deref())?;
        let name = path.display();
        if source.layout.is_scene_set() {
            bail!("{name}: has scenes of two frames; give a sequence of stereo pairs");
        }
        let sequence =
            source.sequences.into_iter().next().with_context(|| format!("{name}: has no frames"))?;
        let reader = Reader::new(&sequence, false);
        let Some(rig) = sequence.rig else {
            bail!("{name}: has no calibration; give one with --calibration FILE");
        };
        let chosen = sequence.frames.into_iter().skip(args.start).step_by(args.stride).take(args.frames);
        let frames: Vec<FrameFiles> = chosen.collect();
        if frames.len() < 3 {
            let words = format!("{} frames are selected; a draw needs three", frames.len());
            return Err(UsageError(words).into());
        }
        Ok(Self {
            source: path,
            name: sequence.name,
            rig,
            how: MatchingSettings {
                levels: args.round,
                sample_step_px: args.sample.unwrap_or(RECORDING_SAMPLE_STEP_PX),
                seed: args.laboratory.seed,
            },
            stride: args.stride,
            indices: frames.iter().map(|frame| frame.index).collect(),
            frames,
            reader,
        })
    }

    fn read(&self, files: &FrameFiles) -> Result<StereoImages, RecordingError> {
        let missing = || RecordingError::MissingRight(files.left.clone());
        let right = files.right.as_ref().ok_or_else(missing)?;
        let (left, right) = self.reader.images(files, right)?;
        Ok(StereoImages { left, right })
    }

    /// The frames around the `k`-th one that has a neighbour on either side.
    fn triple(&self, k: usize) -> Option<&[FrameFiles; 3]> {
        self.frames.get(k..k + 3)?.try_into().ok()
    }

    fn images(&self, [a, b, c]: &[FrameFiles; 3]) -> Result<[StereoImages; 3], RecordingError> {
        Ok([self.read(a)?, self.read(b)?, self.read(c)?])
    }
}

/// Why a part of a recording gives no records.
#[derive(Debug, thiserror::Error)]
pub enum RecordingError {
    #[error(transparent)]
    Read(#[from] Unanswered),
    #[error("{0}: the right image is missing")]
    MissingRight(PathBuf),
    #[error(transparent)]
    Measure(#[from] RealError),
}

impl Study for RecordingStudy {
    type Record = RealRecord;
    type Error = RecordingError;

    fn name(&self) -> &'static str {
        "recording"
    }

    fn parts(&self) -> Vec<String> {
        let middle = self.frames.windows(3).map(|triple| format!("frame {}", triple[1].index));
        middle.collect()
    }

    fn run(&self, part: usize) -> Result<Vec<RealRecord>, RecordingError> {
        let Some(files) = self.triple(part) else { return Ok(Vec::new()) };
        let [before, now, after] = files;
        let motion =
            |from: &FrameFiles, to: &FrameFiles| Some(scene_motion(from.truth.as_ref()?, to.truth.as_ref()?));
        let triple = Triple {
            frames: self.images(files)?,
            motion: motion(before, now).zip(motion(now, after)).map(Into::into),
            draw: DrawId { sequence: self.name.clone(), pose: now.index as i64, seed: self.how.seed },
        };
        Ok(triple.records(&self.rig, &self.how)?)
    }

    fn publish(&self, records: &[RealRecord]) -> Publication {
        let shown = self.triple(self.frames.len() / 2 - 1).and_then(|files| self.images(files).ok());
        let shown = shown.as_ref().map(|frames| ShownFrames { frames, rig: &self.rig, settings: &self.how });
        publish_recording(&self.name, records, shown)
    }
}

/// φ of the scene between two true camera poses.
fn scene_motion(before: &RigidMotion, after: &RigidMotion) -> Twist {
    after.inverse().after(before).log()
}
