//! The sensitivity study of 7.1: six sweeps of what measurements suffer from, and one setting alone.

mod figures;
pub mod setting;

use std::ops::RangeInclusive;

use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::draw::Measuring;
use super::{Cell, Publication, Study, Table};
use crate::range::{COUNTS, OutOfRange, sequences, within};
use egomotion::pipeline::Approach;
use egomotion::sim::Sequence;
use setting::{Score, Setting, merged};

/// STEP of a single setting.
const STEPS: RangeInclusive<f64> = 1e-6..=1e9;
/// Draws that one part of a single setting takes.
const DRAWS_PER_PART: usize = 10;
/// Columns of the study's file.
const COLUMNS: [(&str, &str); 14] = [
    ("sequence", "sequence"),
    ("baseline", "baseline"),
    ("sweep", "sweep"),
    ("value", "value"),
    ("approach", "approach"),
    ("method", "method"),
    ("estimator", "estimator"),
    ("quantity", "quantity"),
    ("erm_signed", "ERM, signed (%)"),
    ("erm_abs", "ERM (%)"),
    ("eam", "EAM (mm, °)"),
    ("std", "STD (%; mm, °)"),
    ("standard_error", "standard error"),
    ("n", "draws"),
];

/// Why a setting gives no numbers.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum SensitivityError {
    /// There is no such sequence.
    #[error("there is no sequence {0}")]
    Sequence(String),
    /// The motion is so large that the cameras leave the room.
    #[error("sequence {sequence} at STEP {step}: the cameras leave the room or enter a part of it")]
    OutOfRoom {
        /// The sequence.
        sequence: String,
        /// STEP.
        step: f64,
    },
}

/// The sequence of a name, as long as one motion takes.
fn sequence(name: &str) -> Result<Sequence, SensitivityError> {
    Sequence::named(name, None, Some(2), 1.0).ok_or_else(|| SensitivityError::Sequence(name.to_owned()))
}

/// The values that all parameters but the swept one have.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Baseline {
    /// No noise, no rounding.
    Clean,
    /// 1/16 px of disparity, 1/8 px of noise.
    Real,
}

impl Baseline {
    /// Its name in files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Clean => "clean",
            Self::Real => "real",
        }
    }

    fn measuring(self) -> Measuring {
        match self {
            Self::Clean => Measuring::clean(),
            Self::Real => Measuring::real(),
        }
    }
}

/// What is swept.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Sweep {
    /// STEP: factor of the velocity.
    Step,
    /// ROUND: levels of disparity for each pixel.
    Round,
    /// STD_DISP: noise of disparity.
    StdDisp,
    /// STD_VEL: noise of differential flow.
    StdVel,
    /// STD_TRACK: noise of discrete displacement.
    StdTrack,
    /// FEATURES: number of tracked features.
    Features,
}

impl Sweep {
    /// All six, in the paper's order.
    pub const ALL: [Self; 6] =
        [Self::Step, Self::Round, Self::StdDisp, Self::StdVel, Self::StdTrack, Self::Features];

    /// Its name in files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Step => "step",
            Self::Round => "round",
            Self::StdDisp => "std_disp",
            Self::StdVel => "std_vel",
            Self::StdTrack => "std_track",
            Self::Features => "features",
        }
    }

    /// Its values; infinite for ROUND is no rounding.
    pub fn values(self) -> &'static [f64] {
        match self {
            Self::Step => &[1.0, 2.0, 4.0, 8.0, 16.0, 32.0],
            Self::Round => &[f64::INFINITY, 32.0, 16.0, 8.0, 4.0],
            Self::StdDisp | Self::StdVel | Self::StdTrack => &[0.0, 0.0625, 0.125, 0.25, 0.5],
            Self::Features => &[128.0, 512.0, 2048.0, 8192.0],
        }
    }

    /// The approaches that it bears on.
    pub fn approaches(self) -> &'static [Approach] {
        match self {
            Self::Step | Self::Round | Self::StdDisp => &[Approach::Differential, Approach::Discrete],
            Self::StdVel => &[Approach::Differential],
            Self::StdTrack | Self::Features => &[Approach::Discrete],
        }
    }

    fn apply(self, value: f64, step: &mut f64, measuring: &mut Measuring) {
        match self {
            Self::Step => *step = value,
            Self::Round => measuring.round = value.is_finite().then_some(value as u32),
            Self::StdDisp => measuring.std_disp_px = value,
            Self::StdVel => measuring.std_vel_px = value,
            Self::StdTrack => measuring.std_track_px = value,
            Self::Features => measuring.features = value as usize,
        }
    }
}

/// One row of the study's file, its errors still as sums.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Record {
    /// The sequence: `A`, `B`, `C`.
    pub sequence: String,
    /// `clean` or `real`; of a single setting `custom` where it is neither.
    pub baseline: String,
    /// What is swept; `table` for a single setting.
    pub sweep: String,
    /// The swept parameter's value, `inf` for no rounding; STEP for a single setting.
    pub value: String,
    /// Who, what, and how wrong.
    pub score: Score,
}

impl Record {
    fn cells(&self) -> Option<Vec<Cell>> {
        let figures = self.score.tally.figures()?;
        let words = [&self.sequence, &self.baseline, &self.sweep, &self.value];
        let who = [&self.score.approach, &self.score.method, &self.score.estimator, &self.score.quantity];
        let mut cells: Vec<Cell> = words.into_iter().chain(who).map(|w| Cell::from(w.as_str())).collect();
        let numbers =
            [figures.erm_signed, figures.erm_abs, Some(figures.eam), figures.std, figures.standard_error];
        cells.extend(numbers.map(Cell::from));
        cells.push(figures.n.into());
        Some(cells)
    }

    fn is_bound(&self) -> bool {
        self.score.method == "bound"
    }
}

fn rows<'a>(id: &str, title: &str, caption: &str, records: impl Iterator<Item = &'a Record>) -> Table {
    let mut table = Table::new(id, title, caption, &COLUMNS);
    table.rows = records.filter_map(Record::cells).collect();
    table
}

/// The six sweeps for some sequences, at both baselines.
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
        Self { sequences: ["A", "B", "C"].map(str::to_owned).to_vec(), draws: 10, seed: 1 }
    }
}

impl Sensitivity {
    fn settings(&self) -> Vec<(&str, Baseline, Sweep, f64)> {
        let mut all = Vec::new();
        for sequence in &self.sequences {
            for baseline in [Baseline::Clean, Baseline::Real] {
                for sweep in Sweep::ALL {
                    all.extend(sweep.values().iter().map(|&v| (sequence.as_str(), baseline, sweep, v)));
                }
            }
        }
        all
    }
}

fn value_name(value: f64) -> String {
    if value.is_finite() { value.to_string() } else { "inf".to_owned() }
}

impl Study for Sensitivity {
    type Record = Record;
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

    fn run(&self, part: usize) -> Result<Vec<Record>, SensitivityError> {
        let Some((name, baseline, sweep, value)) = self.settings().get(part).copied() else {
            return Ok(Vec::new());
        };
        let sequence = sequence(name)?;
        let (mut step, mut measuring) = (1.0, baseline.measuring());
        sweep.apply(value, &mut step, &mut measuring);
        let setting = Setting { sequence: &sequence, step, measuring, seed: self.seed };
        let record = |score| Record {
            sequence: name.to_owned(),
            baseline: baseline.name().to_owned(),
            sweep: sweep.name().to_owned(),
            value: value_name(value),
            score,
        };
        Ok(setting.scores(0..self.draws, sweep.approaches()).into_iter().map(record).collect())
    }

    fn publish(&self, records: &[Record]) -> Publication {
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
            figures: figures::figures(&self.sequences, records),
        }
    }
}

/// One setting alone.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct OneSetting {
    /// The sequence: `A`, `B`, `C`, or any other of [`Sequence::names`].
    pub sequence: String,
    /// STEP: factor of the pair's motion.
    pub step: f64,
    /// What measurements suffer from.
    pub measuring: Measuring,
    /// Number of draws, over the five reference poses in turn.
    pub draws: usize,
    /// Seed of the draws.
    pub seed: u64,
}

impl Default for OneSetting {
    /// Sequence C at the baseline `real`.
    fn default() -> Self {
        Self { sequence: "C".to_owned(), step: 1.0, measuring: Measuring::default(), draws: 40, seed: 1 }
    }
}

impl OneSetting {
    /// The sequence, as long as one motion takes.
    ///
    /// # Errors
    /// [`SensitivityError`]: there is none of that name, or its cameras leave the room.
    pub fn sequence(&self) -> Result<Sequence, SensitivityError> {
        let sequence = sequence(&self.sequence)?;
        if self.of(&sequence).clearance_m().partial_cmp(&0.0) == Some(std::cmp::Ordering::Greater) {
            return Ok(sequence);
        }
        Err(SensitivityError::OutOfRoom { sequence: self.sequence.clone(), step: self.step })
    }

    /// The setting of that sequence.
    pub fn of<'a>(&self, sequence: &'a Sequence) -> Setting<'a> {
        Setting { sequence, step: self.step, measuring: self.measuring, seed: self.seed }
    }

    fn baseline(&self) -> &'static str {
        let is = |baseline: Baseline| self.step == 1.0 && self.measuring == baseline.measuring();
        [Baseline::Clean, Baseline::Real].into_iter().find(|b| is(*b)).map_or("custom", Baseline::name)
    }
}

impl Study for OneSetting {
    type Record = Record;
    type Error = SensitivityError;

    fn name(&self) -> &'static str {
        "table"
    }

    fn check(&self) -> Result<(), OutOfRange> {
        sequences([&self.sequence])?;
        self.measuring.check()?;
        within("draws", self.draws, &COUNTS)?;
        within("step", self.step, &STEPS)
    }

    fn parts(&self) -> Vec<String> {
        let last = |first: usize| (first + DRAWS_PER_PART).min(self.draws);
        let name = |first: usize| format!("draws {} to {}", first + 1, last(first));
        (0..self.draws).step_by(DRAWS_PER_PART).map(name).collect()
    }

    fn run(&self, part: usize) -> Result<Vec<Record>, SensitivityError> {
        let sequence = self.sequence()?;
        let first = part * DRAWS_PER_PART;
        let range = first..(first + DRAWS_PER_PART).min(self.draws);
        let record = |score| Record {
            sequence: sequence.name.clone(),
            baseline: self.baseline().to_owned(),
            sweep: "table".to_owned(),
            value: value_name(self.step),
            score,
        };
        let approaches = [Approach::Differential, Approach::Discrete];
        Ok(self.of(&sequence).scores(range, &approaches).into_iter().map(record).collect())
    }

    fn publish(&self, records: &[Record]) -> Publication {
        let scores = merged(records.iter().map(|record| record.score.clone()));
        let named = |score: Score| records.first().map(|first| Record { score, ..first.clone() });
        let (bound, methods): (Vec<Record>, Vec<Record>) =
            scores.into_iter().filter_map(named).partition(Record::is_bound);
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

/// Quantities of the overview, with their headings.
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

/// ERM of each quantity, EAM where the truth is zero: one row for each contender.
fn overview(methods: &[Record], bound: &[Record]) -> Table {
    let columns: Vec<(&str, &str)> =
        [("approach", "approach"), ("method", "method"), ("estimator", "estimator")]
            .into_iter()
            .chain(QUANTITIES)
            .collect();
    let caption = "Mean of |error| in percent of the truth; in mm or degrees where the truth is zero.";
    let mut table = Table::new("overview", "Every contender at this setting", caption, &columns);
    let all: Vec<&Record> = methods.iter().chain(bound).collect();
    let key = |r: &Record| (r.score.approach.clone(), r.score.method.clone(), r.score.estimator.clone());
    let mut seen = Vec::new();
    for record in &all {
        let who = key(record);
        if seen.contains(&who) {
            continue;
        }
        let mut row: Vec<Cell> = [&who.0, &who.1, &who.2].map(|w| Cell::from(w.as_str())).to_vec();
        for (quantity, _) in QUANTITIES {
            let of = all.iter().find(|r| r.score.quantity == quantity && key(r) == who);
            let figures = of.and_then(|r| r.score.tally.figures());
            row.push(figures.map(|f| f.erm_abs.unwrap_or(f.eam)).into());
        }
        table.rows.push(row);
        seen.push(who);
    }
    table
}
