//! One sequence: which frames, read how, and what is written of it.

use std::path::Path;
use std::sync::atomic::AtomicBool;

use anyhow::{Result, anyhow, bail};
use egomotion::geometry::{Grid, StereoRig};
use egomotion::pipeline::{Config, Observe, Unanswered};
use egomotion_io::source::{FrameFiles, Sequence};
use egomotion_io::{image, tracks};

use crate::args::{RunArgs, SensorArg};
use crate::judge::{self, MapVerdict};
use crate::report::Eyes;
use crate::results::{About, ResultFolder};
use crate::session::{Session, progress};
use crate::summary::Summary;
use crate::{Usage, feed, terminal};

/// A finished sequence.
pub struct DoneSequence {
    pub summary: Summary,
    pub first_failure: Option<String>,
}

/// Run one sequence into a folder.
pub fn run_sequence(
    args: &RunArgs,
    config: &Config,
    sequence: &Sequence,
    out: &Path,
    stop: &AtomicBool,
) -> Result<DoneSequence> {
    let frames = select(args, sequence)?;
    let rig = sequence.rig.ok_or_else(|| {
        anyhow!("{}: no calibration; give one with --calibration FILE", args.source.display())
    })?;
    let tracks = args.tracks.as_deref().or(sequence.tracks.as_deref()).map(tracks::read).transpose()?;
    // Tracks are sparse, whatever was asked for.
    let config = &match &tracks {
        Some(_) => Config { observe: Observe::Sparse, ..config.clone() },
        None => tolerated(args, config, sequence),
    };
    config.check().map_err(|e| anyhow::Error::new(Usage(e.to_string())))?;
    if tracks.is_some() && (args.map_files().any() || args.disparity.is_some() || args.flow.is_some()) {
        return Err(Usage("--maps, --disparity and --flow need images, not tracks".into()).into());
    }
    check_sensor(args, sequence)?;
    let reader = feed::Reader {
        disparity: args.disparity.as_deref(),
        flow: args.flow.as_deref(),
        tracks: tracks.as_ref(),
        ..feed::Reader::new(sequence, uses_depth(args, sequence))
    };
    let mask = args.mask.as_deref().map(|path| read_mask(path, &rig)).transpose()?;
    let mask = joined(mask, reader.unseen());
    let folder = ResultFolder::create(out)?;
    let maps = args.map_files();
    maps.folders(out)?;
    let bar = progress(frames.len(), args.quiet);
    bar.set_message(sequence.name.clone());
    let session =
        Session { rig, config, frames: frames.len(), mask, tracks: tracks.is_some(), progress: bar };
    let mut truth_maps: Option<MapVerdict> = None;
    let mut first_failure = None;
    let outcome = session.run(
        stop,
        |k| frames.get(k).map(|&(files, time_s)| reader.read(files, time_s, k + 1 == frames.len())),
        |row| {
            if let Err(why) = &row.motion.motion
                && *why != Unanswered::First
            {
                first_failure.get_or_insert_with(|| why.to_string());
            }
            let (Some(dense), Some(index)) = (&row.motion.dense, row.reference_index) else { return Ok(()) };
            if let Some(truth) = sequence.truth_maps.as_ref().filter(|t| t.index == index && !args.reverse) {
                truth_maps = judge::scene_maps(&rig, dense, truth)?;
            }
            maps.write(out, index, dense, &rig)
        },
    )?;
    folder.write_motion(config, &outcome)?;
    let mut summary = Summary::new(args.source.display().to_string(), rig, config, &outcome);
    summary.truth_maps = truth_maps;
    for warning in &summary.warnings {
        terminal::tell(format_args!("{}: warning: {warning}", sequence.name));
    }
    folder.write_json("summary.json", &summary)?;
    let about = About {
        title: &format!("How the camera moved: {}", sequence.name),
        source: &summary.source,
        command: terminal::command_line(),
        config,
        rig: &rig,
        eyes: match (&tracks, uses_depth(args, sequence)) {
            (Some(_), _) => Eyes::Tracks,
            (None, true) => Eyes::Depth,
            (None, false) => Eyes::Stereo,
        },
        notes: notes(&summary),
    };
    folder.write_report(&about, &outcome)?;
    Ok(DoneSequence { summary, first_failure })
}

/// The choices of a run, with the tolerance of what the source was taken with unless they have one.
fn tolerated(args: &RunArgs, config: &Config, sequence: &Sequence) -> Config {
    let config = config.clone();
    match sequence.depth_sensor.filter(|_| uses_depth(args, sequence)) {
        Some(sensor) => sensor.noise.tolerated(config),
        None if config.tolerance.is_exact() => Config { tolerance: sequence.tolerance, ..config },
        None => config,
    }
}

/// The sensor that is asked for must be there.
fn check_sensor(args: &RunArgs, sequence: &Sequence) -> Result<()> {
    let (has, wanted) = match args.sensor {
        Some(SensorArg::Depth) => (sequence.depth_sensor.is_some(), "depth images"),
        Some(SensorArg::Stereo) => (has_right(sequence), "right images"),
        None => return Ok(()),
    };
    if has { Ok(()) } else { Err(Usage(format!("{}: has no {wanted}", args.source.display())).into()) }
}

/// Whether depth images take the place of right ones: where there are no others, or as the user says.
fn uses_depth(args: &RunArgs, sequence: &Sequence) -> bool {
    match args.sensor {
        Some(sensor) => sensor == SensorArg::Depth,
        None => !has_right(sequence),
    }
}

fn has_right(sequence: &Sequence) -> bool {
    sequence.side_by_side || sequence.frames.iter().any(|frame| frame.right.is_some())
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

/// The frames to use with their times, which increase also when playing backwards.
fn select<'a>(args: &RunArgs, sequence: &'a Sequence) -> Result<Vec<(&'a FrameFiles, f64)>> {
    let all = &sequence.frames;
    let name = args.source.display();
    if all.len() == 1 {
        bail!("{name}: has one frame only; motion needs at least two");
    }
    if args.start >= all.len() {
        return Err(Usage(format!("--start {} is past the last of {} frames", args.start, all.len())).into());
    }
    let chosen = all[args.start..].iter().step_by(args.stride).take(args.frames.unwrap_or(usize::MAX));
    let mut frames: Vec<(&FrameFiles, f64)> = chosen.map(|frame| (frame, frame.time_s)).collect();
    if frames.len() < 2 {
        return Err(Usage(format!("{} frame is selected; motion needs at least two", frames.len())).into());
    }
    if args.reverse {
        frames.reverse();
        let last = frames[0].1;
        frames.iter_mut().for_each(|(_, time)| *time = last - *time);
    }
    Ok(frames)
}

fn read_mask(path: &Path, rig: &StereoRig) -> Result<Grid<bool>> {
    let mask = image::read(path)?;
    let ((w, h), (we, he)) = (mask.size(), (rig.width_px, rig.height_px));
    if (w, h) != (we, he) {
        bail!(
            "{}: the mask is {w}x{h} pixels, the images {we}x{he}; give one of the images' size",
            path.display()
        );
    }
    Ok(Grid::from_fn(w, h, |u, v| mask.at(u, v) > 0.0))
}

/// Pixels that either mask excludes.
fn joined(mask: Option<Grid<bool>>, unseen: Option<&Grid<bool>>) -> Option<Grid<bool>> {
    let (Some(mut mask), Some(unseen)) = (mask.clone(), unseen) else { return mask.or(unseen.cloned()) };
    mask.values_mut().iter_mut().zip(unseen.values()).for_each(|(masked, unseen)| *masked |= unseen);
    Some(mask)
}
