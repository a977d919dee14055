//! `egomotion run -`: frames from standard input, one JSON line out for each as soon as it is known.

use std::io::{Read, Stdin, Write as _};
use std::path::Path;
use std::sync::Mutex;

use anyhow::{Result, bail};
use egomotion::geometry::{Grid, Image};
use egomotion::observe::{RectificationMap, Rectifier};
use egomotion::pipeline::{Frame, StereoFrame, Unanswered};
use egomotion_io::IoError;
use egomotion_io::calibration::{self, CameraPair};
use egomotion_io::recording::{FrameInput, SourceFrame, halves, unseen};
use egomotion_io::stream::ImageStream;
use egomotion_report::run::InputKind;
use serde_json::{Value, json};

use super::plan::{RunPlan, StreamInput};
use crate::exit::Ending;
use crate::results::{
    ResultFolder, RunDescription, Summary, Viewpoint, motion_row, write_motion, write_report,
};
use crate::session::{FrameResult, Outcome, Session};
use crate::terminal::{self, frames_bar, stop_signal};

/// What errors and results call the stream.
const NAME: &str = "standard input";

/// Run the frames that are piped in.
pub fn run(plan: &RunPlan, input: &StreamInput) -> Result<Ending> {
    let images = ImageStream::new(std::io::stdin(), input.kind, Path::new(NAME));
    let mut pairs = ImagePairs { images, side_by_side: input.side_by_side };
    let Some(first) = pairs.next()? else { bail!("{NAME}: holds no frame; pipe left and right images in") };
    let file = &input.calibration;
    let pair = calibration::read(file)?.pair(CameraPair::Grey, first.0.size(), file)?;
    let rectifier = pair.rectification.as_ref().map(Rectifier::new);
    let folder = ResultFolder::create(&plan.out)?;
    plan.maps.folders(&plan.out)?;
    let session = Session {
        rig: pair.rig,
        config: &plan.config,
        frames: 0,
        masks: unseen(rectifier.as_ref()),
        tracks: false,
        // Progress would stand between the lines of whoever looks at both.
        progress: frames_bar(0, true),
    };
    let frames = PipedFrames {
        unread: Mutex::new(Unread { first: Some(first), pairs }),
        rectifier,
        rate_hz: input.rate_hz,
    };
    let viewpoint = Viewpoint { rig: &pair.rig, camera: plan.camera };
    let outcome = session.run(
        None,
        &stop_signal("frame"),
        |k| frames.fetch(k),
        |frame| {
            let mut stdout = terminal::stdout();
            writeln!(stdout, "{}", line(frame, viewpoint))?;
            stdout.flush()?;
            let (Some(dense), Some(index)) = (&frame.motion.dense, frame.reference_index) else {
                return Ok(());
            };
            plan.maps.write(&plan.out, index, dense, &pair.rig)
        },
    )?;
    write_results(plan, &session, &folder, &outcome)?;
    Ok(Ending::of(outcome.complete))
}

fn write_results(
    plan: &RunPlan,
    session: &Session<'_>,
    folder: &ResultFolder,
    outcome: &Outcome,
) -> Result<()> {
    let (config, rig) = (&plan.config, &session.rig);
    let viewpoint = Viewpoint { rig, camera: plan.camera };
    write_motion(folder, config, outcome, viewpoint, plan.parquet)?;
    let summary = Summary::new(NAME.into(), viewpoint, config, outcome);
    folder.write_json("summary.json", &summary)?;
    let description = RunDescription {
        title: "How the camera moved: frames from standard input",
        source: NAME,
        command: terminal::command_line(),
        config,
        rig,
        input: InputKind::Stereo,
        biased: summary.biased.is_some(),
        notes: summary.camera_note().into_iter().chain(summary.warnings.clone()).collect(),
    };
    write_report(folder, &description, outcome)
}

/// Frames as they are piped in, one after the other.
struct PipedFrames {
    unread: Mutex<Unread>,
    rectifier: Option<Rectifier>,
    rate_hz: f64,
}

/// Images that no frame has taken yet.
struct Unread {
    /// The first pair, which was read before the others to know its size.
    first: Option<(Image, Image)>,
    pairs: ImagePairs<Stdin>,
}

impl PipedFrames {
    /// The k-th frame, rectified; `None` at the end of the stream.
    fn fetch(&self, k: usize) -> Option<SourceFrame> {
        let images = self.next_images().transpose()?;
        let time_s = k as f64 / self.rate_hz;
        let frame = images
            .map_err(|error| Unanswered::BadImage(error.to_string()))
            .and_then(|(left, right)| self.frame(time_s, left, right));
        Some(SourceFrame {
            index: k,
            time_s,
            input: frame.map(|frame| FrameInput::Images(Box::new(frame))),
            truth: None,
            decode_ms: 0.0,
            bytes: 0,
        })
    }

    fn next_images(&self) -> Result<Option<(Image, Image)>, IoError> {
        // A poisoned lock means that the reading thread has failed: the stream ends.
        let Ok(mut unread) = self.unread.lock() else { return Ok(None) };
        match unread.first.take() {
            Some(first) => Ok(Some(first)),
            None => unread.pairs.next(),
        }
    }

    fn frame(&self, time_s: f64, left: Image, right: Image) -> Result<Frame, Unanswered> {
        let left = rectified(self.rectifier.as_ref().map(Rectifier::left), left)?;
        let right = rectified(self.rectifier.as_ref().map(Rectifier::right), right)?;
        Ok(StereoFrame { time_s, left, right }.into())
    }
}

fn rectified(map: Option<&RectificationMap>, raw: Image) -> Result<Image, Unanswered> {
    let Some(map) = map else { return Ok(raw) };
    let mut out = Grid::filled(0, 0, 0.0);
    if map.warp(&raw, &mut out) {
        return Ok(out);
    }
    let ((w, h), (wc, hc)) = (raw.size(), map.raw_size());
    Err(Unanswered::BadImage(format!("{NAME}: {w}x{h} pixels, but the camera's images have {wc}x{hc}")))
}

/// Left and right images in turn, or side by side in one.
struct ImagePairs<R> {
    images: ImageStream<R>,
    side_by_side: bool,
}

impl<R: Read> ImagePairs<R> {
    fn next(&mut self) -> Result<Option<(Image, Image)>, IoError> {
        let Some(first) = self.images.next_image()? else { return Ok(None) };
        if !self.side_by_side {
            return Ok(self.images.next_image()?.map(|right| (first, right)));
        }
        Ok(Some(halves(&first)))
    }
}

/// One frame's answer.
fn line(frame: &FrameResult, viewpoint: Viewpoint<'_>) -> Value {
    let row = motion_row(frame, viewpoint);
    let finite = |v: f64| v.is_finite().then_some(v);
    let motion = row.motion.as_ref();
    let phi = motion.map(|m| (0..6).map(|i| m.observed[i].then(|| m.phi.mean[i])).collect::<Vec<_>>());
    let cov = motion.map(|m| {
        (0..6).map(|i| (0..6).map(|j| finite(m.phi.cov[(i, j)])).collect::<Vec<_>>()).collect::<Vec<_>>()
    });
    json!({
        "frame": row.frame,
        "time_s": row.time_s,
        "dt_s": row.dt_s,
        "status": row.status,
        "phi": phi,
        "cov": cov,
        "observed": motion.map(|m| m.observed),
        "warning": frame.motion.contradiction.map(|found| found.to_string()),
        "impact_s": row.impact_s.map(|s| s.map(finite)),
    })
}
