//! Sections 1, 3.1 and 4.3: two assumptions that the paper makes and does not test.
//!
//! Depth is said to be better than brightness (1, 3.1), and a small motion is taken as instantaneous (4.3).

mod brightness;
mod instantaneous;

use std::convert::Infallible;

use serde::{Deserialize, Serialize};

pub use brightness::BrightnessError;
pub use instantaneous::InstantaneousError;

use crate::{Publication, Study};

/// `study assumptions`: how far the paper's assumptions hold.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Assumptions {
    /// Seed of the noise.
    pub seed: u64,
}

impl Default for Assumptions {
    fn default() -> Self {
        Self { seed: 1 }
    }
}

/// A finding of one part.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum AssumptionRecord {
    /// φ from depth and from brightness.
    Brightness(BrightnessError),
    /// Formulas for instants on finite motions.
    Instantaneous(InstantaneousError),
}

impl Study for Assumptions {
    type Record = AssumptionRecord;
    type Error = Infallible;

    fn name(&self) -> &'static str {
        "assumptions"
    }

    fn parts(&self) -> Vec<String> {
        let brightness =
            brightness::MOTION_FACTORS.iter().map(|step| format!("depth against brightness, STEP {step}"));
        brightness.chain(["instantaneous motion".to_owned()]).collect()
    }

    fn run(&self, part: usize) -> Result<Vec<AssumptionRecord>, Infallible> {
        Ok(match brightness::MOTION_FACTORS.get(part) {
            Some(&step) => {
                brightness::errors(step, self.seed).into_iter().map(AssumptionRecord::Brightness).collect()
            }
            None => instantaneous::errors().into_iter().map(AssumptionRecord::Instantaneous).collect(),
        })
    }

    fn publish(&self, records: &[AssumptionRecord]) -> Publication {
        let brightness: Vec<&BrightnessError> =
            records.iter().filter_map(AssumptionRecord::brightness).collect();
        let instants: Vec<&InstantaneousError> =
            records.iter().filter_map(AssumptionRecord::instantaneous).collect();
        Publication {
            title: "What the paper takes for granted".to_owned(),
            data: vec![brightness::table(&brightness), instantaneous::table(&instants)],
            tables: Vec::new(),
            figures: vec![brightness::figure(&brightness), instantaneous::figure(&instants)],
        }
    }
}

impl AssumptionRecord {
    fn brightness(&self) -> Option<&BrightnessError> {
        if let Self::Brightness(error) = self { Some(error) } else { None }
    }

    fn instantaneous(&self) -> Option<&InstantaneousError> {
        if let Self::Instantaneous(error) = self { Some(error) } else { None }
    }
}
