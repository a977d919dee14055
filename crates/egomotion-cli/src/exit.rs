//! How a command ends, and its exit code.

use std::process::ExitCode;

use anyhow::Result;
use egomotion_io::OptionsError;

use crate::terminal;

/// How a command ended, when it did not fail.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Ending {
    /// All done.
    Done,
    /// Stopped by the user; what was done is written.
    Interrupted,
}

impl Ending {
    /// The ending of work that is `complete`, or was stopped before.
    pub fn of(complete: bool) -> Self {
        if complete { Self::Done } else { Self::Interrupted }
    }
}

/// A combination of options that has no meaning: exit code 2.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub struct UsageError(pub String);

/// The error of a choice that the libraries refuse: wrong usage, or a file that cannot be used.
pub fn choice_error(error: OptionsError) -> anyhow::Error {
    match error {
        OptionsError::Invalid(words) => UsageError(words).into(),
        OptionsError::File(error) => error.into(),
    }
}

/// The process's exit code; an error is told on standard error.
pub fn exit_code(ending: Result<Ending>) -> ExitCode {
    match ending {
        Ok(Ending::Done) => ExitCode::SUCCESS,
        Ok(Ending::Interrupted) => ExitCode::from(130),
        Err(error) => {
            terminal::tell(format_args!("{error:#}"));
            ExitCode::from(if error.is::<UsageError>() { 2 } else { 1 })
        }
    }
}
