//! `study table`: every contender at one setting of the sensitivity study.

use std::ops::RangeInclusive;

use serde::{Deserialize, Serialize};

use super::SensitivityError;
use super::errors::{QuantityErrors, merged};
use super::record::{SensitivityRecord, rows, value_name};
use super::setting::Setting;
use super::sweep::Baseline;
use crate::range::{COUNTS, OutOfRange, sequences, within};
use crate::sequences::required;
use crate::synthetic::{APPROACHES, MeasurementModel};
use crate::{Cell, Publication, Study, Table};
use egomotion::sim::Sequence;

/// Factors of the motion that a setting may have. Beyond them no motion is left, or the room is.
const STEP_FACTORS: RangeInclusive<f64> = 1e-6..=1e9;
/// Draws of one part: more make fewer, longer parts, and so a longer wait for the first results.
const DRAWS_PER_PART: usize = 10;
/// Quantities of the overview, each with its heading.
const QUANTITIES: [(&str, &str); 8] = [
    ("vz", "VZ, per pixel"),
    ("vz_phi", "VZ via φ"),
    ("tx", "tX"),
    ("ty", "tY"),
    ("tz", "tZ"),
    ("wx", "ΩX"),
    ("wy", "ΩY"),
    ("wz", "ΩZ"),
];

/// `study table`: one setting of section 7.1 alone, with every contender and the Cramér–Rao bound.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct OneSetting {
    /// The sequence: `A`, `B`, `C`, or any other of [`Sequence::names`].
    pub sequence: String,
    /// STEP: factor of the pair's motion.
    pub step: f64,
    /// Noise and rounding of the measurements.
    #[serde(rename = "measuring")]
    pub model: MeasurementModel,
    /// Number of draws, over the five reference poses in turn.
    pub draws: usize,
    /// Seed of the draws.
    pub seed: u64,
}

impl Default for OneSetting {
    /// Sequence C at the baseline `real`.
    fn default() -> Self {
        Self { sequence: "C".to_owned(), step: 1.0, model: MeasurementModel::default(), draws: 40, seed: 1 }
    }
}

impl OneSetting {
    /// The sequence, as long as one motion takes.
    ///
    /// # Errors
    /// [`SensitivityError`]: there is none of that name, or its cameras leave the room.
    pub fn sequence(&self) -> Result<Sequence, SensitivityError> {
        let sequence = required(&self.sequence, None)?;
        if self.of(&sequence).clearance_m().partial_cmp(&0.0) == Some(std::cmp::Ordering::Greater) {
            return Ok(sequence);
        }
        Err(SensitivityError::OutOfRoom { sequence: self.sequence.clone(), step: self.step })
    }

    /// The setting of that sequence.
    pub fn of<'a>(&self, sequence: &'a Sequence) -> Setting<'a> {
        Setting { sequence, step: self.step, model: self.model, seed: self.seed }
    }

    fn baseline(&self) -> &'static str {
        let is = |baseline: Baseline| self.step == 1.0 && self.model == baseline.model();
        Baseline::ALL.into_iter().find(|b| is(*b)).map_or("custom", Baseline::name)
    }
}

impl Study for OneSetting {
    type Record = SensitivityRecord;
    type Error = SensitivityError;

    fn name(&self) -> &'static str {
        "table"
    }

    fn check(&self) -> Result<(), OutOfRange> {
        sequences([&self.sequence])?;
        self.model.check()?;
        within("draws", self.draws, &COUNTS)?;
        within("step", self.step, &STEP_FACTORS)
    }

    fn parts(&self) -> Vec<String> {
        let last = |first: usize| (first + DRAWS_PER_PART).min(self.draws);
        let name = |first: usize| format!("draws {} to {}", first + 1, last(first));
        (0..self.draws).step_by(DRAWS_PER_PART).map(name).collect()
    }

    fn run(&self, part: usize) -> Result<Vec<SensitivityRecord>, SensitivityError> {
        let sequence = self.sequence()?;
        let first = part * DRAWS_PER_PART;
        let range = first..(first + DRAWS_PER_PART).min(self.draws);
        let record = |errors| SensitivityRecord {
            sequence: sequence.name.clone(),
            baseline: self.baseline().to_owned(),
            sweep: "table".to_owned(),
            value: value_name(self.step),
            errors,
        };
        Ok(self.of(&sequence).errors(range, &APPROACHES).into_iter().map(record).collect())
    }

    fn publish(&self, records: &[SensitivityRecord]) -> Publication {
        let all = merged(records.iter().map(|record| record.errors.clone()));
        let record = |errors: QuantityErrors| {
            records.first().map(|first| SensitivityRecord { errors, ..first.clone() })
        };
        let (bound, methods): (Vec<SensitivityRecord>, Vec<SensitivityRecord>) =
            all.into_iter().filter_map(record).partition(SensitivityRecord::is_bound);
        Publication {
            title: format!("Sequence {} at one setting", self.sequence),
            data: vec![
                rows("table", "One setting", "", methods.iter()),
                rows("table-bound", "The Cramér–Rao bound", "", bound.iter()),
            ],
            tables: vec![overview(&methods, &bound)],
            figures: Vec::new(),
        }
    }
}

/// The unit of a quantity's errors in a file; `None` of what is no quantity, or has no errors.
fn unit(all: &[&QuantityErrors], quantity: &str) -> Option<&'static str> {
    let found = all.iter().filter(|errors| errors.quantity == quantity).find_map(|e| e.tally.statistics())?;
    Some(match (found.erm_abs, quantity.starts_with('w')) {
        (Some(_), _) => "percent",
        (None, true) => "deg",
        (None, false) => "mm",
    })
}

/// ERM of each quantity, EAM where the truth is zero: one row for each contender.
fn overview(methods: &[SensitivityRecord], bound: &[SensitivityRecord]) -> Table {
    let columns: Vec<(&str, &str)> =
        [("approach", "approach"), ("method", "method"), ("estimator", "estimator")]
            .into_iter()
            .chain(QUANTITIES)
            .collect();
    let caption = "Mean of |error| in percent of the truth; in mm or degrees where the truth is zero.";
    let mut table = Table::new("overview", "Every contender at this setting", caption, &columns);
    let all: Vec<&QuantityErrors> = methods.iter().chain(bound).map(|record| &record.errors).collect();
    for column in &mut table.columns {
        if let Some(unit) = unit(&all, &column.name) {
            column.name = format!("{}_{unit}", column.name);
        }
    }
    let mut seen = Vec::new();
    for errors in &all {
        let contender = errors.contender();
        if seen.contains(&contender) {
            continue;
        }
        let mut row: Vec<Cell> = contender.map(Cell::from).to_vec();
        for (quantity, _) in QUANTITIES {
            let of = all.iter().find(|e| e.quantity == quantity && e.contender() == contender);
            row.push(of.and_then(|e| e.tally.statistics()).map(|found| found.mean_error()).into());
        }
        table.rows.push(row);
        seen.push(contender);
    }
    table
}
