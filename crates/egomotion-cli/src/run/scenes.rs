//! A set of independent scenes: each into a folder of its own, and an index.

use std::io::Write as _;
use std::path::Path;
use std::sync::atomic::AtomicBool;

use anyhow::{Result, bail};
use egomotion::pipeline::Config;
use egomotion_io::source::Source;

use super::resume::{self, Settings};
use super::sequence::run_sequence;
use super::{complete_before, ending, has_answers, print_result};
use crate::args::RunArgs;
use crate::results::ResultFolder;
use crate::summary::{Index, SceneEntry};
use crate::{Ending, Usage, terminal};

/// Run every scene that is not done yet.
pub fn run(
    args: &RunArgs,
    config: &Config,
    source: &Source,
    out: &Path,
    stop: &AtomicBool,
) -> Result<Ending> {
    let folder = ResultFolder::create(out)?;
    let count = source.sequences.len();
    let settings = Settings { options: args, config, rig: None, cameras: None, frames: count };
    let Some((mut journal, mut known)) = resume::open(out, &settings.head()?, args.resume)? else {
        return complete_before(args, out);
    };
    let mut scenes: Vec<SceneEntry> = Vec::new();
    let (mut complete, mut done) = (true, 0);
    if args.resume {
        folder.sweep()?;
    }
    for scene in &source.sequences {
        if let Some(entry) = known.remove(&scene.name) {
            scenes.extend(entry);
            done += 1;
            continue;
        }
        // What is known of later scenes is listed too.
        if !complete {
            continue;
        }
        let folder = out.join(&scene.name);
        match run_sequence(args, config, scene, &folder, stop, false) {
            Ok(Some(ran)) => {
                if !args.json {
                    print_result(args, &ran.summary, &folder)?;
                }
                complete = ran.summary.complete;
                let entry = SceneEntry::done(&scene.name, ran.summary);
                if complete {
                    done += 1;
                    journal.add(&scene.name, std::slice::from_ref(&entry))?;
                }
                scenes.push(entry);
            }
            Ok(None) => {}
            Err(error) if error.is::<Usage>() => return Err(error),
            // One scene that cannot be run does not end the others.
            Err(error) => {
                terminal::tell(format_args!("scene {}: {error:#}", scene.name));
                scenes.push(SceneEntry::failed(&scene.name, &error));
            }
        }
    }
    let index = Index {
        version: env!("CARGO_PKG_VERSION"),
        source: args.source.display().to_string(),
        options: serde_json::to_value(args)?,
        config: config.clone(),
        complete,
        scenes,
    };
    folder.write_json("summary.json", &index)?;
    folder.write_index(&terminal::command_line().replace(" --resume", ""), &index)?;
    if args.json {
        writeln!(terminal::stdout(), "{}", serde_json::to_string_pretty(&index)?)?;
    }
    if !complete {
        terminal::tell(format_args!(
            "stopped after {done} of {count} scenes; the same command with --resume goes on"
        ));
        return Ok(ending(false));
    }
    journal.remove()?;
    if !index.scenes.iter().any(|scene| has_answers(&scene.counts)) {
        bail!("{}: no scene gave a motion; see the status in each motion.csv", args.source.display());
    }
    Ok(ending(true))
}
