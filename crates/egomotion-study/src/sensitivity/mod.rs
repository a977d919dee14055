//! Section 7.1: how sensitive VZ and φ are to motion, resolution, noise and the number of features.
//!
//! [`Sensitivity`] runs the paper's six sweeps, [`OneSetting`] one setting alone. A setting's draws are trials: each
//! contender estimates φ from the same measurements, and its errors are added up in an [`ErrorTally`].

mod errors;
mod figures;
mod one_setting;
mod record;
mod setting;
mod sweep;
mod tally;
mod trial;

use serde::{Deserialize, Serialize};
use thiserror::Error;

pub use errors::QuantityErrors;
pub use one_setting::OneSetting;
pub use record::SensitivityRecord;
pub use setting::Setting;
pub use tally::{ErrorStatistics, ErrorTally};

use crate::range::{COUNTS, OutOfRange, sequences, within};
use crate::sequences::{NoSequence, PAPER_SEQUENCES, owned, required};
use crate::{Publication, Study};
use record::{rows, value_name};
use sweep::{Baseline, Sweep};

/// Why a setting gives no numbers.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum SensitivityError {
    /// There is no such sequence.
    #[error(transparent)]
    Sequence(#[from] NoSequence),
    /// The motion is so large that the cameras leave the room.
    #[error("sequence {sequence} at STEP {step}: the cameras leave the room or enter a part of it")]
    OutOfRoom {
        /// Name of the sequence.
        sequence: String,
        /// STEP, the factor of its motion.
        step: f64,
    },
}

/// `study sensitivity`: section 7.1, the six sweeps of Figures 7 to 9 at both baselines.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Sensitivity {
    /// Sequences: `A`, `B`, `C`.
    pub sequences: Vec<String>,
    /// Draws of each setting, over the five reference poses in turn.
    pub draws: usize,
    /// Seed of the draws.
    pub seed: u64,
}

impl Default for Sensitivity {
    fn default() -> Self {
        Self { sequences: owned(PAPER_SEQUENCES), draws: 10, seed: 1 }
    }
}

impl Sensitivity {
    fn settings(&self) -> Vec<(&str, Baseline, Sweep, f64)> {
        let mut all = Vec::new();
        for sequence in &self.sequences {
            for baseline in Baseline::ALL {
                for sweep in Sweep::ALL {
                    all.extend(sweep.values().iter().map(|&v| (sequence.as_str(), baseline, sweep, v)));
                }
            }
        }
        all
    }
}

impl Study for Sensitivity {
    type Record = SensitivityRecord;
    type Error = SensitivityError;

    fn name(&self) -> &'static str {
        "sensitivity"
    }

    fn check(&self) -> Result<(), OutOfRange> {
        sequences(&self.sequences)?;
        within("draws", self.draws, &COUNTS)
    }

    fn parts(&self) -> Vec<String> {
        let name = |(sequence, baseline, sweep, value): (&str, Baseline, Sweep, f64)| {
            format!("{sequence} {} {} {}", baseline.name(), sweep.name(), value_name(value))
        };
        self.settings().into_iter().map(name).collect()
    }

    fn run(&self, part: usize) -> Result<Vec<SensitivityRecord>, SensitivityError> {
        let Some((name, baseline, sweep, value)) = self.settings().get(part).copied() else {
            return Ok(Vec::new());
        };
        let sequence = required(name, None)?;
        let (step, model) = sweep.at(value, baseline);
        let setting = Setting { sequence: &sequence, step, model, seed: self.seed };
        let record = |errors| SensitivityRecord {
            sequence: name.to_owned(),
            baseline: baseline.name().to_owned(),
            sweep: sweep.name().to_owned(),
            value: value_name(value),
            errors,
        };
        Ok(setting.errors(0..self.draws, sweep.approaches()).into_iter().map(record).collect())
    }

    fn publish(&self, records: &[SensitivityRecord]) -> Publication {
        let caption = "Every setting, method and estimator. STD and the standard error are in percent where \
                       the truth is not zero, else in mm or degrees.";
        let bound_caption = "What an unbiased Gaussian estimator at the Cramér–Rao bound would show.";
        let of_methods = records.iter().filter(|r| !r.is_bound());
        let of_bound = records.iter().filter(|r| r.is_bound());
        Publication {
            title: "Sensitivity of VZ and φ to motion, resolution, noise and number of features".to_owned(),
            data: vec![
                rows("sensitivity", "The sensitivity study", caption, of_methods),
                rows("sensitivity-bound", "The bound of the sensitivity study", bound_caption, of_bound),
            ],
            tables: Vec::new(),
            figures: figures::all(&self.sequences, records),
        }
    }
}
