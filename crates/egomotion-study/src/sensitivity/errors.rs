//! The errors of one quantity by one contender, gathered over draws.

use serde::{Deserialize, Serialize};

use super::tally::ErrorTally;

/// Errors of one quantity by one contender, over some draws of one setting.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct QuantityErrors {
    /// `differential` or `discrete`.
    pub approach: String,
    /// `dcce`, `dv`, `joint`, `linear22`, `rigid`, `ml`, or `bound`.
    pub method: String,
    /// `ls`, `lmeds`, `irls`, `eiv`, `ml`, or `bound`.
    pub estimator: String,
    /// `vz` (each pixel alone), `vz_phi` (through φ), `tx` … `wz`.
    pub quantity: String,
    /// The errors. For `bound` they are those of an unbiased Gaussian estimator at the Cramér–Rao bound.
    pub tally: ErrorTally,
}

impl QuantityErrors {
    /// The errors under the names of approach, method and estimator.
    pub(super) fn new([approach, method, estimator]: [&str; 3], quantity: &str, tally: ErrorTally) -> Self {
        Self {
            approach: approach.to_owned(),
            method: method.to_owned(),
            estimator: estimator.to_owned(),
            quantity: quantity.to_owned(),
            tally,
        }
    }

    /// Names of approach, method and estimator.
    pub fn contender(&self) -> [&str; 3] {
        [&self.approach, &self.method, &self.estimator]
    }

    fn is_of_the_same(&self, other: &Self) -> bool {
        self.contender() == other.contender() && self.quantity == other.quantity
    }
}

/// Errors of the same contender and quantity added up, in the order in which they first come.
pub(super) fn merged(errors: impl Iterator<Item = QuantityErrors>) -> Vec<QuantityErrors> {
    let mut all: Vec<QuantityErrors> = Vec::new();
    for one in errors {
        match all.iter_mut().find(|known| known.is_of_the_same(&one)) {
            Some(known) => known.tally = known.tally.merged(&one.tally),
            None => all.push(one),
        }
    }
    all
}
