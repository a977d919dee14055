//! The file of `--config`: settings as TOML, in the names of this version.

use std::path::Path;

use egomotion::pipeline::{Config, former_key_advice};
use egomotion_io::{IoError, read};
use toml::de::{DeTable, DeValue};

/// The settings of a file; what is left out keeps its default.
///
/// # Errors
/// The file cannot be read, or holds something else; a key of an earlier version is named with what to do about it.
pub fn read(path: &Path) -> Result<Config, IoError> {
    let text = read::text(path)?;
    if let Some(former) = first_former(&text) {
        let reason = format_args!("there is no key {} any more", former.key);
        return Err(IoError::new(path, reason, former.advice).at_line(read::line_at(&text, former.offset)));
    }
    read::toml_text(&text, path)
}

/// A key of an earlier version.
struct FormerKey {
    /// The key with the tables that it stands in, as `table.key`.
    key: String,
    /// Its place in the text, in bytes.
    offset: usize,
    /// What to do about it.
    advice: &'static str,
}

/// The former key that stands first in a text; `None` also where the text is no TOML.
fn first_former(text: &str) -> Option<FormerKey> {
    let table = DeTable::parse(text).ok()?;
    let mut found = Vec::new();
    collect_former(table.get_ref(), &[], &mut found);
    found.into_iter().min_by_key(|key| key.offset)
}

fn collect_former(table: &DeTable<'_>, path: &[&str], found: &mut Vec<FormerKey>) {
    for (key, value) in table {
        let path = [path, &[key.get_ref().as_ref()]].concat();
        if let Some(advice) = former_key_advice(&path) {
            found.push(FormerKey { key: path.join("."), offset: key.span().start, advice });
        } else if let DeValue::Table(inner) = value.get_ref() {
            collect_former(inner, &path, found);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_former_key_is_found_wherever_it_is_written() {
        for (text, offset) in [
            ("window.width_m = 2.0", Some(0)),
            ("seed = 1\n[window]\nwidth_m = 2.0", Some(10)),
            ("window = {}", Some(0)),
        ] {
            let found = first_former(text).unwrap();
            assert_eq!(
                (found.key.as_str(), found.advice, Some(found.offset)),
                ("window", "write vehicle instead", offset)
            );
        }
        // The same word elsewhere is another key; what is no TOML is refused as such.
        for text in ["[tracks]\nwindow = 3", "method = \"window\"", "[vehicle]", "window"] {
            assert!(first_former(text).is_none(), "{text}");
        }
    }
}
