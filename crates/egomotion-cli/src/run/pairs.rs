//! Stereo pairs of one time: disparity with its σ, and no motion.

use std::collections::BTreeMap;
use std::io::Write as _;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

use anyhow::{Result, anyhow, bail};
use egomotion::geometry::{Field, StereoRig};
use egomotion::metrics::quantile;
use egomotion::observe::{DisparityMap, DisparityMatcher};
use egomotion::pipeline::Config;
use egomotion_io::motion_table::MotionRow;
use egomotion_io::recording::Reader;
use egomotion_io::source::{Sequence, Source};
use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::args::{MapFormat, RunArgs};
use crate::maps::MapFiles;
use crate::results::ResultFolder;
use crate::run::complete_before;
use crate::run::resume::{self, Settings};
use crate::summary::Word;
use crate::{Ending, terminal};

/// `status` of a pair.
const NO_MOTION: &str = "no_motion";

/// `summary.json` of a pair.
#[derive(Serialize, Deserialize)]
struct PairSummary {
    version: Word,
    source: String,
    status: Word,
    frames: usize,
    complete: bool,
    /// Without it disparity stays in pixels.
    rig: Option<StereoRig>,
    options: Value,
    config: Config,
    seed: u64,
    counts: BTreeMap<Word, usize>,
    stages_ms: BTreeMap<Word, f64>,
    frame_ms: f64,
    wall_s: f64,
    /// Against the source's own truth.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    disparity: Option<DisparityVerdict>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    error: Option<String>,
}

/// Disparity against the true one, over the pixels that have a truth.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
struct DisparityVerdict {
    /// Share of them with an answer.
    answered: f64,
    /// Share off by more than 1 px, or without an answer.
    bad_1px: f64,
    /// The same with 3 px.
    bad_3px: f64,
    median_abs_error_px: f64,
    /// Share of the answers within 2σ of the truth.
    within_2_sigma: f64,
    pixels: usize,
}

/// An index over the pairs of a set.
#[derive(Serialize)]
struct Index {
    version: &'static str,
    source: String,
    options: Value,
    config: Config,
    complete: bool,
    scenes: BTreeMap<String, PairSummary>,
}

/// Match every pair of a source.
pub fn run(
    args: &RunArgs,
    config: &Config,
    source: &Source,
    out: &Path,
    stop: &AtomicBool,
) -> Result<Ending> {
    let mut scenes = BTreeMap::new();
    let count = source.sequences.len();
    let single = count == 1;
    let folder = ResultFolder::create(out)?;
    let rig = source.sequences.first().filter(|_| single).and_then(|pair| pair.rig.as_ref());
    let settings = Settings { options: args, config, rig, cameras: None, frames: count };
    let Some((mut journal, mut known)) = resume::open(out, &settings.head()?, args.resume)? else {
        return complete_before(args, out);
    };
    let mut complete = true;
    for pair in &source.sequences {
        if let Some(summary) = known.remove(&pair.name).and_then(|mut summary| summary.pop()) {
            scenes.insert(pair.name.clone(), summary);
            continue;
        }
        if stop.load(Ordering::Relaxed) {
            // What is known of later pairs is listed too.
            complete = false;
            continue;
        }
        let place = if single { out.to_owned() } else { out.join(&pair.name) };
        let summary = match matched(args, config, pair, &place) {
            Ok(summary) => {
                journal.add(&pair.name, std::slice::from_ref(&summary))?;
                summary
            }
            // One pair that cannot be read does not end the others.
            Err(error) if !single => {
                terminal::tell(format_args!("{}: {error:#}", pair.name));
                failed(args, config, pair, &error)?
            }
            Err(error) => return Err(error),
        };
        print(args, &summary, &place, pair)?;
        scenes.insert(pair.name.clone(), summary);
    }
    if scenes.values().all(|summary| summary.error.is_some()) && complete {
        bail!("{}: no pair could be matched", source.path.display());
    }
    if single {
        for summary in scenes.values() {
            print_json(args, summary)?;
        }
    } else {
        let source = source.path.display().to_string();
        let (options, config) = (serde_json::to_value(args)?, config.clone());
        let index = Index { version: env!("CARGO_PKG_VERSION"), source, options, config, complete, scenes };
        folder.write_json("summary.json", &index)?;
        print_json(args, &index)?;
    }
    if complete {
        journal.remove()?;
        return Ok(Ending::Done);
    }
    terminal::tell("stopped before the last pair; the same command with --resume goes on");
    Ok(Ending::Interrupted)
}

/// A pair's disparity into its folder.
fn matched(args: &RunArgs, config: &Config, pair: &Sequence, out: &Path) -> Result<PairSummary> {
    let start = Instant::now();
    let files = pair.frames.first().ok_or_else(|| anyhow!("{}: no pair", pair.name))?;
    let (left, right) = Reader::pair(pair, files)?;
    let decode_ms = 1e3 * start.elapsed().as_secs_f64();
    let begun = Instant::now();
    let map = DisparityMatcher::new(config.disparity.clone()).compute(&left, &right)?;
    let disparity_ms = 1e3 * begun.elapsed().as_secs_f64();
    let truth = pair.truth_maps.as_ref().and_then(|truth| truth.disparity.as_ref());
    let verdict = truth.map(|truth| truth.read()).transpose()?.and_then(|truth| verdict(&map, &truth));
    let folder = ResultFolder::create(out)?;
    let formats =
        if args.maps_as.is_empty() { vec![MapFormat::Pfm, MapFormat::Colour] } else { args.maps_as.clone() };
    MapFiles { formats, cloud: None }.write_disparity(out, files.index, &map)?;
    let row = MotionRow {
        frame: files.index,
        time_s: files.time_s,
        dt_s: None,
        motion: None,
        impact_s: None,
        status: NO_MOTION.into(),
    };
    folder.write_rows(&[row], args.parquet)?;
    let summary = PairSummary {
        stages_ms: [("decode".into(), decode_ms), ("disparity".into(), disparity_ms)].into(),
        frame_ms: decode_ms + disparity_ms,
        wall_s: start.elapsed().as_secs_f64(),
        disparity: verdict,
        ..empty(args, config, pair)?
    };
    folder.write_json("summary.json", &summary)?;
    Ok(summary)
}

fn empty(args: &RunArgs, config: &Config, pair: &Sequence) -> Result<PairSummary> {
    Ok(PairSummary {
        version: env!("CARGO_PKG_VERSION").into(),
        source: args.source.display().to_string(),
        status: NO_MOTION.into(),
        frames: 1,
        complete: true,
        rig: pair.rig,
        options: serde_json::to_value(args)?,
        config: config.clone(),
        seed: config.seed,
        counts: [(NO_MOTION.into(), 1)].into(),
        stages_ms: BTreeMap::new(),
        frame_ms: 0.0,
        wall_s: 0.0,
        disparity: None,
        error: None,
    })
}

/// What stands in the index for a pair that failed.
fn failed(args: &RunArgs, config: &Config, pair: &Sequence, error: &anyhow::Error) -> Result<PairSummary> {
    let (status, error) = (Word::from("bad_image"), Some(format!("{error:#}")));
    Ok(PairSummary { counts: [(status.clone(), 1)].into(), status, error, ..empty(args, config, pair)? })
}

/// `None` where the sizes differ or nothing has both a truth and an answer.
fn verdict(map: &DisparityMap, truth: &Field) -> Option<DisparityVerdict> {
    if truth.size() != map.shift.size() {
        return None;
    }
    let (mut errors, mut within, mut pixels) = (Vec::new(), 0, 0);
    let (width, height) = truth.size();
    for (u, v) in (0..height).flat_map(|v| (0..width).map(move |u| (u, v))) {
        let Some(truth) = truth.get(u, v) else { continue };
        pixels += 1;
        let (Some(found), Some(sigma)) = (map.shift.get(u, v), map.sigma.get(u, v)) else { continue };
        let error = f64::from((found - truth).abs());
        within += usize::from(error <= 2.0 * f64::from(sigma));
        errors.push(error);
    }
    let share = |count: usize| count as f64 / pixels.max(1) as f64;
    let good = |limit: f64| errors.iter().filter(|&&error| error <= limit).count();
    Some(DisparityVerdict {
        answered: share(errors.len()),
        bad_1px: 1.0 - share(good(1.0)),
        bad_3px: 1.0 - share(good(3.0)),
        median_abs_error_px: quantile(&errors, 0.5)?,
        within_2_sigma: within as f64 / errors.len() as f64,
        pixels,
    })
}

fn print(args: &RunArgs, summary: &PairSummary, out: &Path, pair: &Sequence) -> Result<()> {
    if args.json || summary.error.is_some() {
        return Ok(());
    }
    let mut stdout = terminal::stdout();
    let unit = match pair.rig {
        Some(_) => "",
        None => " in pixels, for want of a calibration",
    };
    writeln!(
        stdout,
        "{}: a pair of one time: disparity{unit}, no motion; {:.1} ms",
        out.display(),
        summary.frame_ms
    )?;
    if let Some(verdict) = &summary.disparity {
        writeln!(
            stdout,
            "  against the true disparity: {:.1} % off by more than 1 px or missing, {:.1} % by 3 px; median {:.3} px; {:.1} % within 2σ",
            100.0 * verdict.bad_1px,
            100.0 * verdict.bad_3px,
            verdict.median_abs_error_px,
            100.0 * verdict.within_2_sigma
        )?;
    }
    Ok(())
}

fn print_json(args: &RunArgs, value: &impl Serialize) -> Result<()> {
    if args.json {
        writeln!(terminal::stdout(), "{}", serde_json::to_string_pretty(value)?)?;
    }
    Ok(())
}
