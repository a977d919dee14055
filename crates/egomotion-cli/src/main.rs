//! The command `egomotion`.
//!
//! One way: [`args`] is what can be typed, each command makes its plan of it, and what follows takes the plan:
//! [`run`] with its [`session`], the files of [`results`], the parts of a [`study`].
#![deny(clippy::disallowed_methods)]
#![warn(clippy::too_many_lines)]
#![cfg_attr(not(test), deny(clippy::unwrap_used, clippy::expect_used, clippy::panic))]

mod args;
mod config;
mod demo;
mod evaluate;
mod exit;
mod info;
mod journal;
mod process;
mod results;
mod run;
mod session;
mod shell;
mod simulate;
mod study;
mod terminal;

use std::process::ExitCode;

use clap::Parser;

use args::{Cli, Command};

fn main() -> ExitCode {
    process::keep_freed_memory();
    let cli = Cli::parse();
    exit::exit_code(match &cli.command {
        Command::Demo(args) => demo::demo(args),
        Command::Run(args) => run::run(args),
        Command::Simulate(args) => simulate::simulate(args),
        Command::Evaluate(args) => evaluate::evaluate(args),
        Command::Info(args) => info::info(args),
        Command::Study { command } => study::study(command),
        Command::Config => config::config(),
        Command::Completions(args) => shell::completions(args),
        Command::Man(args) => shell::man(args),
    })
}
