//! The file of `--config`: settings as TOML, in the names of this version.

use std::path::Path;

use egomotion::pipeline::{Config, renamed_key};
use egomotion_io::{IoError, read};
use toml::de::{DeTable, DeValue};

/// The settings of a file; what is left out keeps its default.
///
/// # Errors
/// The file cannot be read, or holds something else; a key that was renamed is named with what to write instead.
pub fn read(path: &Path) -> Result<Config, IoError> {
    let text = read::text(path)?;
    if let Some(renamed) = first_renamed(&text) {
        let reason = format_args!("there is no key {} any more", renamed.key);
        let remedy = format_args!("write {} instead", renamed.instead);
        return Err(IoError::new(path, reason, remedy).at_line(read::line_at(&text, renamed.offset)));
    }
    read::toml_text(&text, path)
}

/// A key of an earlier version.
struct RenamedKey {
    /// The key with the tables that it stands in, as `table.key`.
    key: String,
    /// Its place in the text, in bytes.
    offset: usize,
    /// What to write in its place.
    instead: &'static str,
}

/// The renamed key that stands first in a text; `None` also where the text is no TOML.
fn first_renamed(text: &str) -> Option<RenamedKey> {
    let table = DeTable::parse(text).ok()?;
    let mut found = Vec::new();
    collect_renamed(table.get_ref(), &[], &mut found);
    found.into_iter().min_by_key(|key| key.offset)
}

fn collect_renamed(table: &DeTable<'_>, path: &[&str], found: &mut Vec<RenamedKey>) {
    for (key, value) in table {
        let path = [path, &[key.get_ref().as_ref()]].concat();
        if let Some(instead) = renamed_key(&path) {
            found.push(RenamedKey { key: path.join("."), offset: key.span().start, instead });
        } else if let DeValue::Table(inner) = value.get_ref() {
            collect_renamed(inner, &path, found);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_renamed_key_is_found_wherever_it_is_written() {
        for (text, offset) in [
            ("window.width_m = 2.0", Some(0)),
            ("seed = 1\n[window]\nwidth_m = 2.0", Some(10)),
            ("window = {}", Some(0)),
        ] {
            let found = first_renamed(text).unwrap();
            assert_eq!(
                (found.key.as_str(), found.instead, Some(found.offset)),
                ("window", "vehicle", offset)
            );
        }
        // The same word elsewhere is another key; what is no TOML is refused as such.
        for text in ["[tracks]\nwindow = 3", "method = \"window\"", "[vehicle]", "window"] {
            assert!(first_renamed(text).is_none(), "{text}");
        }
    }
}
