//! What the settings of a study may be.

use std::fmt::{Debug, Display};
use std::ops::RangeInclusive;

use thiserror::Error;

use egomotion::sim::Sequence;

/// A setting that a study cannot be run with.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error("{name} is {value}; give {wanted}")]
pub struct OutOfRange {
    /// The setting.
    pub name: &'static str,
    /// What it is.
    pub value: String,
    /// What it may be.
    pub wanted: String,
}

/// Draws, poses, pairs: a study of more would never end.
pub(crate) const COUNTS: RangeInclusive<usize> = 1..=100_000_000;
/// Pixels of an image in one direction.
const PIXELS: RangeInclusive<usize> = 16..=8192;

/// Nothing if the value lies in the range; NaN lies in none.
pub(crate) fn within<T: PartialOrd + Display + Debug>(
    name: &'static str,
    value: T,
    range: &RangeInclusive<T>,
) -> Result<(), OutOfRange> {
    if range.contains(&value) {
        return Ok(());
    }
    let wanted = format!("{} to {}", range.start(), range.end());
    Err(OutOfRange { name, value: format!("{value:?}"), wanted })
}

/// Nothing if the image has a size that can be rendered.
pub(crate) fn size(width_px: usize, height_px: usize) -> Result<(), OutOfRange> {
    within("the width in pixels", width_px, &PIXELS)?;
    within("the height in pixels", height_px, &PIXELS)
}

/// Nothing if all are names of rendered sequences.
pub(crate) fn sequences<'a>(names: impl IntoIterator<Item = &'a String>) -> Result<(), OutOfRange> {
    let unknown = names.into_iter().find(|name| !Sequence::names().any(|known| known == name.as_str()));
    let wanted = || format!("one of {}", Sequence::names().collect::<Vec<_>>().join(", "));
    unknown.map_or(Ok(()), |name| Err(OutOfRange { name: "sequence", value: name.clone(), wanted: wanted() }))
}
