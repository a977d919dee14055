//! Speeds along the x axes of Figures 12 to 14, and the draws that belong to each.

use std::collections::BTreeSet;

use super::RealResults;
use crate::Axis;
use crate::real::contender::ImageContender;
use crate::real::quantity::Quantity;
use crate::real::statistics::PooledStatistics;

/// An axis of speed, and what is measured along it.
pub(super) struct SpeedAxis {
    /// What moves along it, for the titles of panels: `translating`.
    pub(super) title: &'static str,
    pub(super) axis: Axis,
    pub(super) places: Vec<SpeedPlace>,
}

/// A speed, and the draws at that speed.
pub(super) struct SpeedPlace {
    pub(super) speed: f64,
    draws: Draws,
}

/// Which draws.
enum Draws {
    /// Those of the sequence of that name.
    Sequence(String),
    /// Those at the frames of these numbers.
    Frames(BTreeSet<i64>),
}

impl SpeedPlace {
    /// All draws of a sequence.
    pub(super) fn of_sequence(speed: f64, sequence: String) -> Self {
        Self { speed, draws: Draws::Sequence(sequence) }
    }

    /// The draws at some frames of a recording.
    pub(super) fn of_frames(speed: f64, frames: BTreeSet<i64>) -> Self {
        Self { speed, draws: Draws::Frames(frames) }
    }

    /// The name of the sequence, where it is one.
    pub(super) fn sequence(&self) -> Option<&str> {
        match &self.draws {
            Draws::Sequence(name) => Some(name),
            Draws::Frames(_) => None,
        }
    }

    /// The statistics of its draws.
    pub(super) fn statistics(
        &self,
        results: &RealResults<'_>,
        contender: ImageContender,
        quantity: Quantity,
    ) -> Option<PooledStatistics> {
        results.among(
            |record| match &self.draws {
                Draws::Sequence(name) => record.sequence == *name,
                Draws::Frames(frames) => frames.contains(&record.pose),
            },
            Some(contender),
            quantity,
        )
    }
}
