//! A set of independent scenes: each into a folder of its own, and an index.

use std::sync::atomic::AtomicBool;

use anyhow::{Result, bail};
use egomotion_io::source::{Sequence, Source};

use super::plan::{RecordingInput, RunPlan};
use super::print::{print_complete_before, print_summary};
use super::resume::{RunIdentity, open_journal};
use super::sequence::SequenceRun;
use crate::exit::{Ending, UsageError};
use crate::journal::{Journal, Parts};
use crate::results::{ResultFolder, SceneEntry, SceneIndex, has_answers, write_index};
use crate::terminal::{self, print_json};

/// Run every scene that is not done yet.
pub fn run(plan: &RunPlan, input: &RecordingInput, source: &Source, stop: &AtomicBool) -> Result<Ending> {
    let folder = ResultFolder::create(&plan.out)?;
    let frames = source.sequences.len();
    let identity =
        RunIdentity { options: &plan.options, config: &plan.config, rig: None, cameras: None, frames };
    let Some((mut journal, known)) = open_journal(&plan.out, &identity.header()?, plan.resume)? else {
        print_complete_before(&plan.out, plan.json)?;
        return Ok(Ending::Done);
    };
    if plan.resume {
        folder.sweep()?;
    }
    let done = run_scenes(plan, input, source, stop, &mut journal, known)?;
    let index = SceneIndex {
        version: env!("CARGO_PKG_VERSION"),
        source: input.path.display().to_string(),
        options: plan.options.clone(),
        config: plan.config.clone(),
        complete: done.complete,
        scenes: done.entries,
    };
    folder.write_json("summary.json", &index)?;
    write_index(&folder, &terminal::command_line(), &index)?;
    if plan.json {
        print_json(&index)?;
    }
    if !index.complete {
        terminal::tell(format_args!(
            "stopped after {} of {frames} scenes; the same command with --resume goes on",
            done.count
        ));
        return Ok(Ending::Interrupted);
    }
    journal.remove()?;
    if !index.scenes.iter().any(|scene| has_answers(&scene.counts)) {
        bail!("{}: no scene gave a motion; see the status in each motion.csv", input.path.display());
    }
    Ok(Ending::Done)
}

/// Scenes that are done, and those that failed.
struct DoneScenes {
    entries: Vec<SceneEntry>,
    /// Number of scenes that are done.
    count: usize,
    /// Whether nobody stopped it.
    complete: bool,
}

fn run_scenes(
    plan: &RunPlan,
    input: &RecordingInput,
    source: &Source,
    stop: &AtomicBool,
    journal: &mut Journal,
    mut known: Parts<SceneEntry>,
) -> Result<DoneScenes> {
    let mut done = DoneScenes { entries: Vec::new(), count: 0, complete: true };
    for scene in &source.sequences {
        if let Some(entry) = known.remove(&scene.name) {
            done.entries.extend(entry);
            done.count += 1;
            continue;
        }
        // What is known of later scenes is listed too.
        if !done.complete {
            continue;
        }
        match run_scene(plan, input, scene, stop) {
            Ok((entry, complete)) => {
                done.complete = complete;
                if complete {
                    done.count += 1;
                    journal.add(&scene.name, std::slice::from_ref(&entry))?;
                }
                done.entries.push(entry);
            }
            Err(error) if error.is::<UsageError>() => return Err(error),
            // One scene that cannot be run does not end the others.
            Err(error) => {
                terminal::tell(format_args!("scene {}: {error:#}", scene.name));
                done.entries.push(SceneEntry::failed(&scene.name, &error));
            }
        }
    }
    Ok(done)
}

/// What came out of a scene, and whether it was run to its end.
fn run_scene(
    plan: &RunPlan,
    input: &RecordingInput,
    scene: &Sequence,
    stop: &AtomicBool,
) -> Result<(SceneEntry, bool)> {
    let out = plan.out.join(&scene.name);
    let summary = SequenceRun { plan, input, sequence: scene, out: &out, stop }.unlogged()?.summary;
    if !plan.json {
        print_summary(&summary, &out)?;
    }
    let complete = summary.complete;
    Ok((SceneEntry::done(&scene.name, summary), complete))
}
