//! The error of every reader and writer: where, why, and what to do.

use std::fmt::Display;
use std::io::{self, ErrorKind};
use std::path::{Path, PathBuf};

use thiserror::Error;

/// What went wrong with which file. Its message is one line: file, reason, what to do.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error("{}", self.message())]
pub struct IoError {
    /// The file or folder concerned.
    pub path: PathBuf,
    /// Line of a text file, from 1.
    pub line: Option<usize>,
    /// What is wrong.
    pub reason: String,
    /// What to do about it.
    pub advice: String,
}

impl IoError {
    /// An error at a file or folder.
    pub fn new(path: &Path, reason: impl Display, advice: impl Display) -> Self {
        Self { path: path.to_owned(), line: None, reason: reason.to_string(), advice: advice.to_string() }
    }

    /// The same at a line of a text file, counted from 1.
    pub fn at_line(self, line: usize) -> Self {
        Self { line: Some(line), ..self }
    }

    /// What the operating system said while `doing` something with the file.
    pub fn system(path: &Path, doing: &str, error: &io::Error) -> Self {
        let advice = match error.kind() {
            ErrorKind::NotFound => "check the path",
            ErrorKind::PermissionDenied | ErrorKind::ReadOnlyFilesystem => "check the permissions",
            ErrorKind::StorageFull | ErrorKind::QuotaExceeded => "free some space and run again",
            ErrorKind::IsADirectory | ErrorKind::NotADirectory | ErrorKind::AlreadyExists => {
                "a file and a folder are mixed up; choose another name"
            }
            _ => "check the disk and the file",
        };
        Self::new(path, format_args!("cannot {doing}: {error}"), advice)
    }

    fn message(&self) -> String {
        let line = self.line.map(|n| format!(":{n}")).unwrap_or_default();
        let message = format!("{}{line}: {}; {}", self.path.display(), self.reason, self.advice);
        // A name or a quoted piece of a broken file may hold anything; the message stays one line.
        message.chars().map(|c| if c.is_control() { ' ' } else { c }).collect()
    }
}

/// Why options cannot be carried out.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum OptionsError {
    /// The options have no meaning, or do not fit together or to what they are about; in words.
    #[error("{0}")]
    Invalid(String),
    /// A file that is needed cannot be used.
    #[error(transparent)]
    File(#[from] IoError),
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_message_is_one_line_with_file_line_reason_and_advice() {
        let error = IoError::new(Path::new("a\nb.txt"), "bad \"x\ry\"", "mend it").at_line(3);
        assert_eq!(error.to_string(), "a b.txt:3: bad \"x y\"; mend it");
    }
}
