//! The command `egomotion`.
#![deny(clippy::disallowed_methods)]
#![warn(clippy::too_many_lines)]
#![cfg_attr(not(test), deny(clippy::unwrap_used, clippy::expect_used, clippy::panic))]

mod args;
mod config;
mod demo;
mod evaluate;
mod info;
mod journal;
mod judge;
mod maps;
mod memory;
mod moving;
mod pairs;
mod results;
mod run;
mod session;
mod shell;
mod simulate;
mod study;
mod summary;
mod terminal;

use std::process::ExitCode;

use clap::Parser;
use egomotion_io::OptionsError;

use args::{Cli, Command};

/// How a command ended, when it did not fail.
pub enum Ending {
    /// All done.
    Done,
    /// Stopped by the user; what was done is written.
    Interrupted,
}

/// A combination of options that has no meaning: exit code 2.
#[derive(Debug)]
pub struct Usage(pub String);

impl std::fmt::Display for Usage {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.0)
    }
}

impl std::error::Error for Usage {}

/// A choice that has no meaning is one of options.
pub fn refusal(error: OptionsError) -> anyhow::Error {
    match error {
        OptionsError::Invalid(words) => Usage(words).into(),
        OptionsError::File(error) => error.into(),
    }
}

fn main() -> ExitCode {
    memory::keep();
    let cli = Cli::parse();
    let ending = match &cli.command {
        Command::Demo(args) => demo::demo(args),
        Command::Run(args) => run::run(args),
        Command::Simulate(args) => simulate::simulate(args),
        Command::Evaluate(args) => evaluate::evaluate(args),
        Command::Info(args) => info::info(args),
        Command::Study { command } => study::study(command),
        Command::Config => config::config(),
        Command::Completions(args) => shell::completions(args),
        Command::Man(args) => shell::man(args),
    };
    match ending {
        Ok(Ending::Done) => ExitCode::SUCCESS,
        Ok(Ending::Interrupted) => ExitCode::from(130),
        Err(error) => {
            terminal::tell(format_args!("{error:#}"));
            ExitCode::from(if error.is::<Usage>() { 2 } else { 1 })
        }
    }
}
