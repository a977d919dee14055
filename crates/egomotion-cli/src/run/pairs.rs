//! Stereo pairs of one time: disparity with its σ, and no motion.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

use anyhow::{Result, anyhow, bail};
use egomotion::observe::DisparityMatcher;
use egomotion_io::motion_table::MotionRow;
use egomotion_io::recording::Reader;
use egomotion_io::source::{Sequence, Source};

use super::plan::{RecordingInput, RunPlan};
use super::print::{print_complete_before, print_pair};
use super::resume::{RunIdentity, open_journal};
use crate::exit::Ending;
use crate::journal::{Journal, Parts};
use crate::results::maps::write_disparity;
use crate::results::verdict::DisparityVerdict;
use crate::results::{NO_MOTION, PairIndex, PairSummary, ResultFolder, write_rows};
use crate::terminal::{self, print_json};

/// Match every pair of a source.
pub fn run(plan: &RunPlan, input: &RecordingInput, source: &Source, stop: &AtomicBool) -> Result<Ending> {
    let frames = source.sequences.len();
    let only = source.sequences.first().filter(|_| frames == 1);
    let folder = ResultFolder::create(&plan.out)?;
    let rig = only.and_then(|pair| pair.rig.as_ref());
    let identity = RunIdentity { options: &plan.options, config: &plan.config, rig, cameras: None, frames };
    let Some((mut journal, known)) = open_journal(&plan.out, &identity.header()?, plan.resume)? else {
        print_complete_before(&plan.out, plan.json)?;
        return Ok(Ending::Done);
    };
    let (scenes, complete) = match_pairs(plan, input, source, stop, &mut journal, known)?;
    if complete && scenes.values().all(|summary| summary.error.is_some()) {
        bail!("{}: no pair could be matched", source.path.display());
    }
    if only.is_some() {
        for summary in scenes.values().filter(|_| plan.json) {
            print_json(summary)?;
        }
    } else {
        write_pair_index(plan, source, &folder, scenes, complete)?;
    }
    if complete {
        journal.remove()?;
        return Ok(Ending::Done);
    }
    terminal::tell("stopped before the last pair; the same command with --resume goes on");
    Ok(Ending::Interrupted)
}

/// The summaries of all pairs by name, and whether nobody stopped it.
fn match_pairs(
    plan: &RunPlan,
    input: &RecordingInput,
    source: &Source,
    stop: &AtomicBool,
    journal: &mut Journal,
    mut known: Parts<PairSummary>,
) -> Result<(BTreeMap<String, PairSummary>, bool)> {
    let single = source.sequences.len() == 1;
    let (mut summaries, mut complete) = (BTreeMap::new(), true);
    for pair in &source.sequences {
        if let Some(summary) = known.remove(&pair.name).and_then(|mut summary| summary.pop()) {
            summaries.insert(pair.name.clone(), summary);
            continue;
        }
        if stop.load(Ordering::Relaxed) {
            // What is known of later pairs is listed too.
            complete = false;
            continue;
        }
        let out = if single { plan.out.clone() } else { plan.out.join(&pair.name) };
        let summary = match match_pair(plan, input, pair, &out) {
            Ok(summary) => {
                journal.add(&pair.name, std::slice::from_ref(&summary))?;
                if !plan.json {
                    print_pair(&summary, &out)?;
                }
                summary
            }
            // One pair that cannot be read does not end the others.
            Err(error) if !single => {
                terminal::tell(format_args!("{}: {error:#}", pair.name));
                failed(plan, input, pair, &error)
            }
            Err(error) => return Err(error),
        };
        summaries.insert(pair.name.clone(), summary);
    }
    Ok((summaries, complete))
}

fn write_pair_index(
    plan: &RunPlan,
    source: &Source,
    folder: &ResultFolder,
    scenes: BTreeMap<String, PairSummary>,
    complete: bool,
) -> Result<()> {
    let index = PairIndex {
        version: env!("CARGO_PKG_VERSION"),
        source: source.path.display().to_string(),
        options: plan.options.clone(),
        config: plan.config.clone(),
        complete,
        scenes,
    };
    folder.write_json("summary.json", &index)?;
    if plan.json { print_json(&index) } else { Ok(()) }
}

/// A pair's disparity into its folder.
fn match_pair(plan: &RunPlan, input: &RecordingInput, pair: &Sequence, out: &Path) -> Result<PairSummary> {
    let start = Instant::now();
    let files = pair.frames.first().ok_or_else(|| anyhow!("{}: no pair", pair.name))?;
    let (left, right) = Reader::pair(pair, files)?;
    let decode_ms = 1e3 * start.elapsed().as_secs_f64();
    let begun = Instant::now();
    let map = DisparityMatcher::new(plan.config.disparity.clone()).compute(&left, &right)?;
    let disparity_ms = 1e3 * begun.elapsed().as_secs_f64();
    let truth = pair.truth_files.as_ref().and_then(|truth| truth.disparity.as_ref());
    let truth = truth.map(|truth| truth.read()).transpose()?;
    let verdict = truth.and_then(|truth| DisparityVerdict::of(&map, &truth));
    let folder = ResultFolder::create(out)?;
    write_disparity(&plan.pair_formats, out, files.index, &map)?;
    let row = MotionRow {
        frame: files.index,
        time_s: files.time_s,
        dt_s: None,
        motion: None,
        impact_s: None,
        status: NO_MOTION.into(),
    };
    write_rows(&folder, &[row], plan.parquet)?;
    let summary = PairSummary {
        stages_ms: [("decode".into(), decode_ms), ("disparity".into(), disparity_ms)].into(),
        frame_ms: decode_ms + disparity_ms,
        wall_s: start.elapsed().as_secs_f64(),
        disparity: verdict,
        ..without_times(plan, input, pair)
    };
    folder.write_json("summary.json", &summary)?;
    Ok(summary)
}

/// What is known of a pair before it is matched.
fn without_times(plan: &RunPlan, input: &RecordingInput, pair: &Sequence) -> PairSummary {
    PairSummary {
        version: env!("CARGO_PKG_VERSION").into(),
        source: input.path.display().to_string(),
        status: NO_MOTION.into(),
        frames: 1,
        complete: true,
        rig: pair.rig,
        options: plan.options.clone(),
        config: plan.config.clone(),
        seed: plan.config.seed,
        counts: [(NO_MOTION.into(), 1)].into(),
        stages_ms: BTreeMap::new(),
        frame_ms: 0.0,
        wall_s: 0.0,
        disparity: None,
        error: None,
    }
}

/// What stands in the index for a pair that failed.
fn failed(plan: &RunPlan, input: &RecordingInput, pair: &Sequence, error: &anyhow::Error) -> PairSummary {
    let status = String::from("bad_image");
    PairSummary {
        counts: [(status.clone(), 1)].into(),
        status,
        error: Some(format!("{error:#}")),
        ..without_times(plan, input, pair)
    }
}
