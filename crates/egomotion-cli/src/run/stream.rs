//! `egomotion run -`: frames from standard input, one JSON line out for each as soon as it is known.

use std::io::{Read, Write as _};
use std::path::Path;
use std::sync::Mutex;

use anyhow::{Result, bail};
use egomotion::geometry::{Grid, Image};
use egomotion::observe::{RectificationMap, Rectifier};
use egomotion::pipeline::{Config, Frame, StereoFrame, Unanswered};
use egomotion_io::IoError;
use egomotion_io::calibration::{self, CameraPair};
use egomotion_io::recording::{FrameInput, SourceFrame, halves, unseen};
use egomotion_io::stream::{ImageStream, StreamFormat};
use serde_json::{Value, json};

use crate::args::RunArgs;
use crate::results::{About, ResultFolder, motion_row};
use crate::session::{Row, Session, progress, stop_signal};
use crate::summary::Summary;
use crate::{Ending, Usage, terminal};
use egomotion_report::run::Eyes;

/// What errors call the stream, and the folder of its results.
const NAME: (&str, &str) = ("standard input", "egomotion-out/stdin");

/// Run the frames that are piped in.
pub fn run(args: &RunArgs, config: &Config) -> Result<Ending> {
    if args.resume {
        return Err(
            Usage("frames on standard input cannot be had again: --resume needs a recording".into()).into()
        );
    }
    let Some(file) = &args.calibration else {
        return Err(Usage("frames on standard input need --calibration FILE".into()).into());
    };
    let kind = args.raw.map_or(StreamFormat::Png, |(width, height)| StreamFormat::Raw { width, height });
    let images = ImageStream::new(std::io::stdin(), kind, Path::new(NAME.0));
    let mut pairs = Pairs { images, side_by_side: args.side_by_side };
    let Some(first) = pairs.next()? else {
        bail!("{}: holds no frame; pipe left and right images in", NAME.0)
    };
    let pair = calibration::read(file)?.pair(CameraPair::Grey, first.0.size(), file)?;
    let rectifier = pair.rectification.as_ref().map(Rectifier::new);
    let out = args.out.clone().unwrap_or_else(|| NAME.1.into());
    let folder = ResultFolder::create(&out)?;
    let maps = args.map_files();
    maps.folders(&out)?;
    // Progress would stand between the lines of whoever looks at both.
    let masks = unseen(rectifier.as_ref());
    let session =
        Session { rig: pair.rig, config, frames: 0, masks, tracks: false, progress: progress(0, true) };
    let stop = stop_signal("frame");
    let source = Mutex::new((Some(first), pairs));
    let fetch = |k: usize| {
        let (first, pairs) = &mut *source.lock().ok()?;
        let found = match first.take() {
            Some(first) => Ok(Some(first)),
            None => pairs.next(),
        };
        let images = found.transpose()?;
        let time_s = k as f64 / args.rate;
        let frame = images.map_err(|error: IoError| Unanswered::BadImage(error.to_string())).and_then(
            |(left, right)| -> Result<Frame, Unanswered> {
                let left = rectified(rectifier.as_ref().map(Rectifier::left), left)?;
                let right = rectified(rectifier.as_ref().map(Rectifier::right), right)?;
                Ok(StereoFrame { time_s, left, right }.into())
            },
        );
        Some(SourceFrame {
            index: k,
            time_s,
            input: frame.map(|frame| FrameInput::Images(Box::new(frame))),
            truth: None,
            decode_ms: 0.0,
            bytes: 0,
        })
    };
    let outcome = session.run(None, &stop, fetch, |row| {
        let mut stdout = terminal::stdout();
        writeln!(stdout, "{}", line(row))?;
        stdout.flush()?;
        let (Some(dense), Some(index)) = (&row.motion.dense, row.reference_index) else { return Ok(()) };
        maps.write(&out, index, dense, &pair.rig)
    })?;
    folder.write_motion(config, &outcome, args.parquet)?;
    let summary = Summary::new(NAME.0.into(), pair.rig, config, &outcome);
    folder.write_json("summary.json", &summary)?;
    let about = About {
        title: "How the camera moved: frames from standard input",
        source: NAME.0,
        command: terminal::command_line(),
        config,
        rig: &pair.rig,
        eyes: Eyes::Stereo,
        notes: summary.warnings.clone(),
    };
    folder.write_report(&about, &outcome)?;
    Ok(if outcome.complete { Ending::Done } else { Ending::Interrupted })
}

fn rectified(map: Option<&RectificationMap>, raw: Image) -> Result<Image, Unanswered> {
    let Some(map) = map else { return Ok(raw) };
    let mut out = Grid::filled(0, 0, 0.0);
    if map.warp(&raw, &mut out) {
        return Ok(out);
    }
    let ((w, h), (wc, hc)) = (raw.size(), map.raw_size());
    Err(Unanswered::BadImage(format!("{}: {w}x{h} pixels, but the camera's images have {wc}x{hc}", NAME.0)))
}

/// Left and right images in turn, or side by side in one.
struct Pairs<R> {
    images: ImageStream<R>,
    side_by_side: bool,
}

impl<R: Read> Pairs<R> {
    fn next(&mut self) -> Result<Option<(Image, Image)>, IoError> {
        let Some(first) = self.images.next_image()? else { return Ok(None) };
        if !self.side_by_side {
            return Ok(self.images.next_image()?.map(|right| (first, right)));
        }
        Ok(Some(halves(&first)))
    }
}

/// One frame's answer.
fn line(row: &Row) -> Value {
    let row = motion_row(row);
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
        "impact_s": row.impact_s.map(|s| s.map(finite)),
    })
}
