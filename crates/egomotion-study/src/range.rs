//! The values that the settings of a study may have.

use std::fmt::{Debug, Display};
use std::ops::RangeInclusive;

use thiserror::Error;

use egomotion::sim::Sequence;

/// A setting that a study cannot be run with.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error("{name} is {value}; give {wanted}")]
pub struct OutOfRange {
    /// Name of the setting.
    pub name: &'static str,
    /// Its value.
    pub value: String,
    /// The values that it may have.
    pub wanted: String,
}

/// Numbers of draws, places or pairs that a study takes; one of more would never end.
pub(crate) const COUNTS: RangeInclusive<usize> = 1..=100_000_000;
/// Widths and heights of an image that a study takes, in pixels: room for a stencil, and no more than memory holds.
const PIXELS: RangeInclusive<usize> = 16..=8192;

/// Check that the value lies in the range; NaN lies in none.
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

/// Check that the image has a size that can be rendered.
pub(crate) fn size(width_px: usize, height_px: usize) -> Result<(), OutOfRange> {
    within("the width in pixels", width_px, &PIXELS)?;
    within("the height in pixels", height_px, &PIXELS)
}

/// Check that all are names of rendered sequences.
pub(crate) fn sequences<'a>(names: impl IntoIterator<Item = &'a String>) -> Result<(), OutOfRange> {
    let unknown = names.into_iter().find(|name| !Sequence::names().any(|known| known == name.as_str()));
    let wanted = || format!("one of {}", Sequence::names().collect::<Vec<_>>().join(", "));
    unknown.map_or(Ok(()), |name| Err(OutOfRange { name: "sequence", value: name.clone(), wanted: wanted() }))
}
