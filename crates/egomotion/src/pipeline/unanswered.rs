//! Why there is no answer for a frame.

use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::estimate::Unsolvable;

/// Why there is no answer for a frame.
#[derive(Debug, Clone, PartialEq, Eq, Error, Serialize, Deserialize)]
pub enum Unanswered {
    /// There is no earlier frame to compare with.
    #[error("no earlier frame")]
    First,
    /// The images cannot be used.
    #[error("{0}")]
    BadImage(String),
    /// The right image is missing.
    #[error("the right image is missing")]
    MissingRight,
    /// The depth image is missing.
    #[error("the depth image is missing")]
    MissingDepth,
    /// The given disparity map is missing.
    #[error("the disparity map is missing")]
    MissingDisparity,
    /// The given flow map is missing.
    #[error("the flow map is missing")]
    MissingFlow,
    /// The frame is a copy of the one before: a sensor's noise never repeats itself.
    #[error("it repeats the frame before")]
    RepeatedFrame,
    /// The time stamp does not lie after that of the frame before.
    #[error("the time stamp does not increase")]
    BadTime,
    /// The images gave no solvable equations.
    #[error(transparent)]
    Unsolvable(#[from] Unsolvable),
}

impl Unanswered {
    /// One word for tables.
    pub fn code(&self) -> &'static str {
        match self {
            Self::First => "first",
            Self::BadImage(_) => "bad_image",
            Self::MissingRight => "missing_right",
            Self::MissingDepth => "missing_depth",
            Self::MissingDisparity => "missing_disparity",
            Self::MissingFlow => "missing_flow",
            Self::RepeatedFrame => "repeated_frame",
            Self::BadTime => "bad_time",
            Self::Unsolvable(Unsolvable::FewRows { .. }) => "few_rows",
            Self::Unsolvable(Unsolvable::Unobservable) => "unobservable",
            Self::Unsolvable(Unsolvable::NotFinite) => "not_finite",
            Self::Unsolvable(Unsolvable::NotConverged) => "not_converged",
        }
    }
}
