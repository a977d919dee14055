//! Why an estimator has no answer.

use serde::{Deserialize, Serialize};
use thiserror::Error;

/// Why a system of equations has no answer.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error, Serialize, Deserialize)]
pub enum Unsolvable {
    /// Fewer equations than unknowns.
    #[error("{rows} equations for {needed} unknowns")]
    FewRows {
        /// Equations at hand.
        rows: usize,
        /// Equations needed.
        needed: usize,
    },
    /// No direction of motion is determined.
    #[error("no direction of motion is observable")]
    Unobservable,
    /// A number overflowed or was not a number.
    #[error("the equations contain numbers that are not finite")]
    NotFinite,
    /// The iteration did not settle.
    #[error("the estimator did not converge")]
    NotConverged,
}
