//! `egomotion study`: the paper's laboratory. Any [`egomotion::study::Study`] becomes files and one page.

mod args;
mod figure;
mod journal;
mod laboratory;
mod page;
mod real;
mod table;
#[cfg(test)]
mod tests;

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use anyhow::Result;

use crate::run::set_threads;
use crate::{Ending, terminal};

pub use args::StudyCommand;

use args::LaboratoryArgs;
use laboratory::{Laboratory, Options};

/// Run what was typed.
pub fn study(command: &StudyCommand) -> Result<Ending> {
    match command {
        StudyCommand::Real(args) => real::run(args),
    }
}

/// Run one study into its folder.
fn alone<S: egomotion::study::Study>(args: &LaboratoryArgs, study: &S) -> Result<Ending> {
    let mut laboratory = open(args, Some(study.name()), None)?;
    laboratory.run(study)?;
    laboratory.close()
}

/// The laboratory of one study, or of all with a headline of their page.
fn open(args: &LaboratoryArgs, study: Option<&str>, title: Option<&str>) -> Result<Laboratory> {
    set_threads(args.threads)?;
    let options = Options {
        resume: args.resume,
        quiet: args.quiet,
        title: title.map(str::to_owned),
        command: terminal::command_line().replace(" --resume", ""),
    };
    Laboratory::open(&args.folder(study), options, stop_signal())
}

/// Set when the user asks to stop; a second time ends the program at once, and what is done is kept.
fn stop_signal() -> Arc<AtomicBool> {
    let stop = Arc::new(AtomicBool::new(false));
    let asked = Arc::clone(&stop);
    let handler = move || {
        if asked.swap(true, Ordering::Relaxed) {
            std::process::exit(130);
        }
        terminal::tell("stopping after this part; a second Ctrl-C stops at once");
    };
    // Only a second laboratory of a process finds a handler there already.
    let _ = ctrlc::set_handler(handler);
    stop
}
