//! The sequences that studies run on, each as long as one motion takes.

use std::fmt::{Display, Formatter};

use thiserror::Error;

use egomotion::sim::Sequence;

/// The three sequences of the paper's synthetic world (7.1): A goes ahead, B turns, C does both.
pub(crate) const PAPER_SEQUENCES: [&str; 3] = ["A", "B", "C"];
/// STEP of the paper's sweep over velocity (7.1): factors of a sequence's motion.
pub(crate) const PAPER_STEPS: [f64; 6] = [1.0, 2.0, 4.0, 8.0, 16.0, 32.0];

/// There is no sequence of that name, or none with images of that size.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub struct NoSequence {
    /// The name that was asked for.
    pub name: String,
    /// Width and height that were asked for, in pixels; `None` if the sequence's own were.
    pub size_px: Option<(usize, usize)>,
}

impl Display for NoSequence {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        match self.size_px {
            None => write!(f, "there is no sequence {}", self.name),
            Some((width, height)) => write!(f, "no sequence {} of {width}x{height} pixels", self.name),
        }
    }
}

/// Two frames of a rendered sequence, one motion apart, at the sequence's own image size.
pub(crate) fn two_frames(name: &str) -> Option<Sequence> {
    Sequence::named(name, None, Some(2), 1.0)
}

/// Two frames of a rendered sequence at that image size, or at the sequence's own.
pub(crate) fn required(name: &str, size_px: Option<(usize, usize)>) -> Result<Sequence, NoSequence> {
    let found = Sequence::named(name, size_px, Some(2), 1.0);
    found.ok_or_else(|| NoSequence { name: name.to_owned(), size_px })
}

/// (sequence, first pair) of each part of a study of so many pairs of each sequence.
pub(crate) fn pair_parts(sequences: &[String], pairs: usize, pairs_per_part: usize) -> Vec<(&str, usize)> {
    let starts = || (0..pairs).step_by(pairs_per_part);
    sequences.iter().flat_map(|name| starts().map(move |start| (name.as_str(), start))).collect()
}

/// Names of those parts.
pub(crate) fn pair_part_names(parts: Vec<(&str, usize)>) -> Vec<String> {
    parts.into_iter().map(|(name, start)| format!("{name} from pair {start}")).collect()
}

/// The names as a study's settings hold them.
pub(crate) fn owned<'a>(names: impl IntoIterator<Item = &'a str>) -> Vec<String> {
    names.into_iter().map(str::to_owned).collect()
}
