//! `egomotion run`: a recording in, motion out.
//!
//! The options become a [`plan`]; what is read decides who carries it out: [`sequence`] one sequence, [`scenes`] a set
//! of independent ones, [`pairs`] stereo pairs without a second time, [`stream`] frames that are piped in.

mod config_file;
mod pairs;
mod plan;
mod print;
mod resume;
mod scenes;
mod sequence;
mod stream;

use anyhow::{Result, bail};
use egomotion_io::source::{DatasetLayout, Source};

use crate::args::RunArgs;
use crate::exit::Ending;
use crate::process::set_threads;
use crate::results::has_answers;
use crate::terminal::{print_json, stop_signal};
use plan::{Input, RecordingInput, RunPlan};
use sequence::{DoneSequence, SequenceRun};

/// Run a source, be it one sequence, a set of scenes or of pairs, or a stream.
pub fn run(args: &RunArgs) -> Result<Ending> {
    let plan = RunPlan::new(args)?;
    set_threads(plan.threads)?;
    match &plan.input {
        Input::Stream(stream) => stream::run(&plan, stream),
        Input::Recording(recording) => run_recording(&plan, recording),
    }
}

fn run_recording(plan: &RunPlan, input: &RecordingInput) -> Result<Ending> {
    let source = Source::open_with(&input.path, input.calibration.as_deref())?;
    let stop = stop_signal("frame");
    if source.layout == DatasetLayout::StereoPairs {
        return pairs::run(plan, input, &source, &stop);
    }
    if source.layout.is_scene_set() {
        return scenes::run(plan, input, &source, &stop);
    }
    let run = SequenceRun { plan, input, sequence: &source.sequences[0], out: &plan.out, stop: &stop };
    let Some(done) = run.logged()? else {
        print::print_complete_before(&plan.out, plan.json)?;
        return Ok(Ending::Done);
    };
    if plan.json {
        print_json(&done.summary)?;
    } else {
        print::print_summary(&done.summary, &plan.out)?;
    }
    expect_answers(&source, &done)?;
    Ok(Ending::of(done.summary.complete))
}

/// A complete run without a single motion is a failure.
fn expect_answers(source: &Source, done: &DoneSequence) -> Result<()> {
    if has_answers(&done.summary.counts) || !done.summary.complete {
        return Ok(());
    }
    let why = done.first_failure.as_deref().unwrap_or("no frame could be compared with an earlier one");
    bail!("{}: no motion could be estimated; the first reason: {why}", source.path.display())
}
