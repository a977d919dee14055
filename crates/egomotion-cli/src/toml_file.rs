//! Settings and scenes read from TOML files; what is wrong is one line with the file and its line.

use std::path::Path;

use anyhow::{Context, Result, anyhow};
use serde::de::DeserializeOwned;

/// The value that a file holds.
pub fn read<T: DeserializeOwned>(path: &Path) -> Result<T> {
    let text =
        std::fs::read_to_string(path).with_context(|| format!("{}: cannot be read", path.display()))?;
    toml::from_str(&text).map_err(|e| {
        let breaks = |end: usize| text.bytes().take(end).filter(|&b| b == b'\n').count();
        let line = e.span().map_or(String::new(), |s| format!(":{}", breaks(s.start) + 1));
        anyhow!("{}{line}: {}", path.display(), e.message().replace('\n', " "))
    })
}
