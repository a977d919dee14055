//! `egomotion run`: a real sequence in, motion out.

use std::collections::BTreeMap;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

use anyhow::{Context, Result, anyhow, bail};
use egomotion::geometry::{Grid, StereoRig};
use egomotion::pipeline::{Config, Observe, Unanswered};
use egomotion_io::image;
use egomotion_io::source::{FrameFiles, Sequence, Source};
use egomotion_io::tracks;

use crate::args::{RunArgs, SensorArg};
use crate::feed;
use crate::judge::{self, MapVerdict};
use crate::results::{About, ResultFolder};
use crate::session::{Session, progress, stop_signal};
use crate::summary::{Index, SceneEntry, Summary};
use crate::{Ending, Usage, terminal, toml_file};

/// Run a source, be it one sequence or a set of scenes.
pub fn run(args: &RunArgs) -> Result<Ending> {
    let config = resolve_config(args)?;
    set_threads(args.threads)?;
    let source = Source::open_with(&args.source, args.calibration.as_deref())?;
    let out = args.out.clone().unwrap_or_else(|| default_out(&args.source));
    let stop = stop_signal();
    if !source.layout.is_scene_set() {
        let done = run_sequence(args, &config, &source.sequences[0], &out, &stop)?;
        print_result(args, &done.summary, &out)?;
        answered(&source.path, &done)?;
        return Ok(ending(done.summary.complete));
    }
    let mut scenes = Vec::new();
    let mut complete = true;
    let folder = ResultFolder::create(&out, false)?;
    for scene in &source.sequences {
        let folder = out.join(&scene.name);
        let entry = match run_sequence(args, &config, scene, &folder, &stop) {
            Ok(done) => {
                if !args.json {
                    print_result(args, &done.summary, &folder)?;
                }
                complete &= done.summary.complete;
                SceneEntry::done(&scene.name, done.summary)
            }
            Err(error) if error.is::<Usage>() => return Err(error),
            // One scene that cannot be run does not end the others.
            Err(error) => {
                terminal::tell(format_args!("scene {}: {error:#}", scene.name));
                SceneEntry::failed(&scene.name, &error)
            }
        };
        scenes.push(entry);
        if !complete {
            break;
        }
    }
    let index = Index {
        version: env!("CARGO_PKG_VERSION"),
        source: args.source.display().to_string(),
        complete,
        scenes,
    };
    folder.write_json("summary.json", &index)?;
    if args.json {
        writeln!(terminal::stdout(), "{}", serde_json::to_string_pretty(&index)?)?;
    }
    if complete && !index.scenes.iter().any(|scene| has_answers(&scene.counts)) {
        bail!("{}: no scene gave a motion; see the status in each motion.csv", args.source.display());
    }
    Ok(ending(complete))
}

fn ending(complete: bool) -> Ending {
    if complete { Ending::Done } else { Ending::Interrupted }
}

/// Defaults, then the file, then the options.
fn resolve_config(args: &RunArgs) -> Result<Config> {
    let mut config = match &args.config {
        None => Config::default(),
        Some(path) => toml_file::read(path)?,
    };
    if let Some(method) = args.method {
        config.method = method.into();
    }
    if let Some(approach) = args.approach {
        config.approach = approach.into();
    }
    if let Some(estimator) = args.estimator {
        config.estimator = estimator.into();
    }
    if let Some(observe) = args.observe {
        config.observe = observe.into();
    }
    if let Some(seed) = args.seed {
        config.seed = seed;
    }
    config.check().map_err(|e| anyhow::Error::new(Usage(e.to_string())))?;
    if args.maps && config.observe == Observe::Sparse {
        let reason = "--maps needs the maps of every pixel: use observe dense (the default), not sparse";
        return Err(Usage(reason.into()).into());
    }
    Ok(config)
}

/// Use this many worker threads in the whole process.
pub fn set_threads(threads: Option<usize>) -> Result<()> {
    if let Some(threads) = threads {
        rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build_global()
            .context("cannot start the threads")?;
    }
    Ok(())
}

fn default_out(source: &Path) -> PathBuf {
    let full = source.canonicalize().unwrap_or_else(|_| source.to_owned());
    Path::new("egomotion-out").join(full.file_name().unwrap_or_else(|| "run".as_ref()))
}

/// A finished sequence.
struct DoneSequence {
    summary: Summary,
    first_failure: Option<String>,
}

fn run_sequence(
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
    let depth = sequence.depth_sensor.filter(|_| uses_depth(args, sequence));
    let tracks = args.tracks.as_deref().or(sequence.tracks.as_deref()).map(tracks::read).transpose()?;
    // Tracks are sparse, whatever was asked for.
    let config = &match &tracks {
        Some(_) => Config { observe: Observe::Sparse, ..config.clone() },
        None => config.clone(),
    };
    config.check().map_err(|e| anyhow::Error::new(Usage(e.to_string())))?;
    if tracks.is_some() && (args.maps || args.disparity.is_some() || args.flow.is_some()) {
        return Err(Usage("--maps, --disparity and --flow need images, not tracks".into()).into());
    }
    let reader = feed::Reader {
        rig,
        depth,
        disparity: args.disparity.as_deref(),
        flow: args.flow.as_deref(),
        tracks: tracks.as_ref(),
    };
    check_sensor(args, sequence)?;
    let mask = args.mask.as_deref().map(|path| read_mask(path, &rig)).transpose()?;
    let folder = ResultFolder::create(out, args.maps)?;
    let bar = progress(frames.len(), args.quiet);
    bar.set_message(sequence.name.clone());
    let session = Session {
        rig,
        config,
        frames: frames.len(),
        mask,
        tracks: tracks.is_some(),
        maps: args.maps,
        progress: bar,
    };
    let mut truth_maps: Option<MapVerdict> = None;
    let mut first_failure = None;
    let outcome = session.run(
        stop,
        &folder,
        |k| reader.read(frames[k].0, frames[k].1, k + 1 == frames.len()),
        |row| {
            if let Err(why) = &row.motion.motion
                && *why != Unanswered::First
            {
                first_failure.get_or_insert_with(|| why.to_string());
            }
            if let (Some(truth), Some(dense), Some(r)) =
                (&sequence.truth_maps, &row.motion.dense, row.motion.reference)
                && frames[r].0.index == truth.index
                && !args.reverse
            {
                truth_maps = judge::scene_maps(&rig, dense, truth)?;
            }
            Ok(())
        },
    )?;
    folder.write_motion(config, &outcome)?;
    let mut summary = Summary::new(args.source.display().to_string(), rig, config, &outcome);
    summary.truth_maps = truth_maps;
    folder.write_json("summary.json", &summary)?;
    let about = About {
        title: &sequence.name,
        source: &summary.source,
        command: terminal::command_line(),
        config,
        rig: &rig,
        notes: notes(&summary),
    };
    folder.write_report(&about, &outcome)?;
    Ok(DoneSequence { summary, first_failure })
}

/// The sensor that is asked for must be there.
fn check_sensor(args: &RunArgs, sequence: &Sequence) -> Result<()> {
    let (has, wanted) = match args.sensor {
        Some(SensorArg::Depth) => (sequence.depth_sensor.is_some(), "depth images"),
        Some(SensorArg::Stereo) => (sequence.frames.iter().any(|f| f.right.is_some()), "right images"),
        None => return Ok(()),
    };
    if has { Ok(()) } else { Err(Usage(format!("{}: has no {wanted}", args.source.display())).into()) }
}

/// Whether depth images take the place of right ones: where there are no others, or as the user says.
fn uses_depth(args: &RunArgs, sequence: &Sequence) -> bool {
    let has_right = sequence.frames.iter().any(|frame| frame.right.is_some());
    match args.sensor {
        Some(sensor) => sensor == SensorArg::Depth,
        None => !has_right,
    }
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
    if let Some(rows) = summary.row_disagreement_px.filter(|&rows| rows > WORRYING_ROWS_PX) {
        notes.push(format!(
            "Matches of left and right lie on different rows, by {rows:.2} px: the pair is not well rectified, \
             and depths are less certain than their noise tells."
        ));
    }
    notes
}

/// Rows that disagree by more than this show in every depth.
const WORRYING_ROWS_PX: f64 = 0.25;

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

/// Whether any row gives a motion, or part of one.
fn has_answers(counts: &BTreeMap<&'static str, usize>) -> bool {
    counts.contains_key("ok") || counts.contains_key("partial")
}

fn answered(source: &Path, done: &DoneSequence) -> Result<()> {
    if has_answers(&done.summary.counts) || !done.summary.complete {
        return Ok(());
    }
    let why = done.first_failure.as_deref().unwrap_or("no frame could be compared with an earlier one");
    bail!("{}: no motion could be estimated; the first reason: {why}", source.display())
}

fn print_result(args: &RunArgs, summary: &Summary, out: &Path) -> Result<()> {
    let mut stdout = terminal::stdout();
    if args.json {
        writeln!(stdout, "{}", serde_json::to_string_pretty(summary)?)?;
        return Ok(());
    }
    let answered =
        summary.counts.get("ok").copied().unwrap_or(0) + summary.counts.get("partial").copied().unwrap_or(0);
    writeln!(
        stdout,
        "{}: {} frames, {answered} of {} motions answered, {:.1} ms a frame",
        out.display(),
        summary.frames,
        summary.frames.saturating_sub(1),
        summary.frame_ms
    )?;
    if let Some(truth) = &summary.truth {
        writeln!(
            stdout,
            "  against the source's poses, frame to frame: {:.2} mm, {:.4}° (root mean square)",
            1e3 * truth.t_rmse_m,
            truth.r_rmse_deg
        )?;
    }
    if let Some(maps) = &summary.truth_maps {
        writeln!(
            stdout,
            "  against the source's maps: VZ median error {:.3} m, {:.1} % within 2σ, {:.1} % answered; disparity {:.1} % off by more than 3 px or missing",
            maps.vz_median_abs_error_m,
            100.0 * maps.vz_within_2_sigma,
            100.0 * maps.answered,
            100.0 * maps.disparity_bad_3px
        )?;
    }
    Ok(())
}
