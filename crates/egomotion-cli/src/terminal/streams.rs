//! Standard output for results, standard error for messages.
//!
//! Nobody listening (`egomotion … | head`) is no failure: the run goes on and its files are written.

use std::io::{ErrorKind, Result, Stderr, Stdout, Write};

use serde::Serialize;

/// A stream whose reader may go away.
pub struct Stream<W>(W);

/// Standard output, where results go.
pub fn stdout() -> Stream<Stdout> {
    Stream(std::io::stdout())
}

/// Standard error, where messages go.
fn stderr() -> Stream<Stderr> {
    Stream(std::io::stderr())
}

/// One line on standard error. Where that fails there is no place left to say so: `eprintln!` would panic.
pub fn tell(message: impl std::fmt::Display) {
    let _ = writeln!(stderr(), "egomotion: {message}");
}

/// The command that makes these results again: as it was typed, from the start.
pub fn command_line() -> String {
    let quoted = |word: std::ffi::OsString| {
        let word = word.to_string_lossy().into_owned();
        if word.contains(char::is_whitespace) { format!("'{word}'") } else { word }
    };
    std::env::args_os().map(quoted).collect::<Vec<_>>().join(" ").replace(" --resume", "")
}

/// A value as JSON on standard output.
pub fn print_json(value: &impl Serialize) -> anyhow::Result<()> {
    Ok(writeln!(stdout(), "{}", serde_json::to_string_pretty(value)?)?)
}

impl<W: Write> Write for Stream<W> {
    fn write(&mut self, bytes: &[u8]) -> Result<usize> {
        match self.0.write(bytes) {
            Err(error) if error.kind() == ErrorKind::BrokenPipe => Ok(bytes.len()),
            other => other,
        }
    }

    fn flush(&mut self) -> Result<()> {
        match self.0.flush() {
            Err(error) if error.kind() == ErrorKind::BrokenPipe => Ok(()),
            other => other,
        }
    }
}
