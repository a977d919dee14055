//! What pairs of frames share: the rig that took them all, and the frame between two of them.

use serde::{Deserialize, Serialize};

use super::config::Config;
use crate::estimate::LastMotion;
use crate::geometry::{RigErrors, StereoRig};

/// What a pair needs of those before it to know its uncertainty.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Shared {
    /// How far rows of left and right disagree.
    rows: RowHistory,
    /// The last motion, and its later frame.
    last: Option<(usize, LastMotion)>,
}

/// How far rows of left and right have disagreed, in all pairs so far.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct RowHistory {
    square_px2: f64,
    pairs: usize,
}

impl RowHistory {
    /// With one more pair.
    pub(super) fn with(mut self, disagreement_px: Option<f64>) -> Self {
        if let Some(rows) = disagreement_px {
            self.square_px2 += rows * rows;
            self.pairs += 1;
        }
        self
    }

    /// Root mean square, in pixels; 0 where nothing was seen.
    pub(super) fn disagreement_px(&self) -> f64 {
        (self.square_px2 / self.pairs.max(1) as f64).sqrt()
    }
}

impl Shared {
    /// Account for a pair: how far its rows disagree, and its motion with its later frame, if there is one.
    pub(super) fn remember(&mut self, rows_px: Option<f64>, last: Option<(usize, LastMotion)>) {
        self.rows = self.rows.with(rows_px);
        self.last = last;
    }

    /// The last motion, if `frame` was its later one.
    pub(super) fn last_until(&self, frame: usize) -> Option<&LastMotion> {
        self.last.as_ref().filter(|(later, _)| *later == frame).map(|(_, last)| last)
    }

    /// Standard deviations of the rig's errors, with what one more pair shows of its rows.
    pub(super) fn rig_sigma(&self, rows_px: Option<f64>, config: &Config, rig: &StereoRig) -> RigErrors {
        let rows = self.rows.with(rows_px).disagreement_px();
        config.rig_errors.sigma(rows, &config.tolerance, rig)
    }
}
