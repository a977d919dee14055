//! `egomotion completions` and `egomotion man`: what a shell and a reader of manuals want.

use std::io::Write as _;

use anyhow::Result;
use clap::CommandFactory;

use crate::args::{Cli, CompletionsArgs, ManArgs};
use crate::exit::Ending;
use crate::results::ResultFolder;
use crate::terminal;

/// Print a shell's completion script.
pub fn completions(args: &CompletionsArgs) -> Result<Ending> {
    let mut script = Vec::new();
    clap_complete::generate(args.shell, &mut Cli::command(), "egomotion", &mut script);
    terminal::stdout().write_all(&script)?;
    Ok(Ending::Done)
}

/// Print the manual page, or write one for each command into a folder.
pub fn man(args: &ManArgs) -> Result<Ending> {
    let mut command = Cli::command();
    command.build();
    let Some(folder) = &args.out else {
        terminal::stdout().write_all(&page(command)?)?;
        return Ok(Ending::Done);
    };
    let folder = ResultFolder::create(folder)?;
    for inner in command.get_subcommands().filter(|inner| inner.get_name() != "help") {
        let name = format!("egomotion-{}", inner.get_name());
        // Clap keeps names for the life of the process; there are a dozen.
        let inner = inner.clone().name(&*name.clone().leak());
        folder.write(&format!("{name}.1"), &page(inner)?)?;
    }
    folder.write("egomotion.1", &page(command)?)?;
    Ok(Ending::Done)
}

fn page(command: clap::Command) -> Result<Vec<u8>> {
    let mut page = Vec::new();
    clap_mangen::Man::new(command).render(&mut page)?;
    Ok(page)
}
