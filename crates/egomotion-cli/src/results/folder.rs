//! A folder that results go to; each file appears whole or not at all.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use egomotion_io::write;
use serde::Serialize;

/// A folder that results go to.
pub struct ResultFolder {
    path: PathBuf,
}

impl ResultFolder {
    /// Make the folder.
    pub fn create(path: &Path) -> Result<Self> {
        write::folder(path)?;
        // Find out now, not after an hour, that nothing can be written here.
        let probe = path.join(".egomotion-writable");
        write::bytes(&probe, b"")?;
        let _ = std::fs::remove_file(&probe);
        Ok(Self { path: path.to_owned() })
    }

    /// Where it is.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Remove what a killed run left half written.
    pub fn sweep(&self) -> Result<()> {
        Ok(write::sweep(&self.path)?)
    }

    /// Write one file.
    pub fn write(&self, name: &str, content: &[u8]) -> Result<()> {
        Ok(write::bytes(&self.path.join(name), content)?)
    }

    /// Write a value as JSON.
    pub fn write_json(&self, name: &str, value: &impl Serialize) -> Result<()> {
        let mut text = serde_json::to_string_pretty(value).context("cannot put the summary into JSON")?;
        text.push('\n');
        self.write(name, text.as_bytes())
    }
}
