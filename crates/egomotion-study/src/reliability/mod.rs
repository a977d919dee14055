//! Which answers of the linear methods can be believed: answered, refused, and warned of.
//!
//! Each random pair is observed once, and solved by every linear method, approach and estimator. An answer that lies far
//! from the truth in its own standard deviations must be one that the pipeline warns of.

mod observed;
mod tables;
mod tally;

use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::consistency::pair::RandomPair;
use crate::range::{COUNTS, OutOfRange, sequences, size, within};
use crate::sequences::{NoSequence, PAPER_SEQUENCES, owned, pair_part_names, pair_parts, required};
use crate::{Publication, Study};
use egomotion::pipeline::{Approach, Config, EstimatorKind, Method};
use egomotion::sim::Sequence;
use observed::{ObservedPair, ObservingError};

/// Pairs of one part: more make fewer, longer parts, and so a longer wait for the first results.
const PAIRS_PER_PART: usize = 5;
/// The methods on dense fields that solve linear rows.
const METHODS: [Method; 3] = [Method::Dcce, Method::Dv, Method::Joint];
/// How their rows are solved.
const ESTIMATORS: [EstimatorKind; 3] = [EstimatorKind::Ls, EstimatorKind::Irls, EstimatorKind::Lmeds];

/// Where the disparity of a pair comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum DisparitySource {
    /// The truth, stated as good to 0.3 px.
    Exact,
    /// The rendered images.
    Matched,
}

/// `study reliability`: random pairs of rendered sequences, by every linear method.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Reliability {
    /// Names of the sequences.
    pub sequences: Vec<String>,
    /// Width of the images, in pixels; the focal length grows with it.
    pub width_px: usize,
    /// Height of the images, in pixels.
    pub height_px: usize,
    /// Pairs of each sequence.
    pub pairs: usize,
    /// Seed of poses, textures and noise.
    pub seed: u64,
}

impl Default for Reliability {
    fn default() -> Self {
        let sequences = PAPER_SEQUENCES.into_iter().chain(["demo", "drive"]).chain(Sequence::lab_names());
        Self { sequences: owned(sequences), width_px: 320, height_px: 240, pairs: 20, seed: 1 }
    }
}

/// Why there are no records.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum ReliabilityError {
    /// There is no such sequence, or the images have no pixels.
    #[error(transparent)]
    Sequence(#[from] NoSequence),
    /// A pair cannot be observed.
    #[error(transparent)]
    Observing(#[from] ObservingError),
}

/// How one pair was solved in one way.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ReliabilityRecord {
    /// The sequence.
    pub sequence: String,
    /// Number of the pair in its sequence.
    pub pair: usize,
    /// Where disparity comes from.
    pub disparity: DisparitySource,
    /// The method.
    pub method: Method,
    /// Finite displacements or velocities.
    pub approach: Approach,
    /// How the rows were solved.
    pub estimator: EstimatorKind,
    /// Error of each component over its σ; `None` where it is not observed.
    pub sigmas: [Option<f64>; 6],
    /// Why there is no answer.
    pub refused: Option<String>,
    /// What the data do not determine, in words.
    pub undetermined: String,
    /// The warning that corners contradict the answer.
    pub warning: Option<String>,
}

impl Reliability {
    /// (sequence, first pair) of each part.
    fn chunks(&self) -> Vec<(&str, usize)> {
        pair_parts(&self.sequences, self.pairs, PAIRS_PER_PART)
    }
}

impl Study for Reliability {
    type Record = ReliabilityRecord;
    type Error = ReliabilityError;

    fn name(&self) -> &'static str {
        "reliability"
    }

    fn check(&self) -> Result<(), OutOfRange> {
        sequences(&self.sequences)?;
        size(self.width_px, self.height_px)?;
        within("pairs", self.pairs, &COUNTS)
    }

    fn parts(&self) -> Vec<String> {
        pair_part_names(self.chunks())
    }

    fn run(&self, part: usize) -> Result<Vec<ReliabilityRecord>, ReliabilityError> {
        let Some(&(name, start)) = self.chunks().get(part) else { return Ok(Vec::new()) };
        let sequence = required(name, Some((self.width_px, self.height_px)))?;
        let numbers = (start..(start + PAIRS_PER_PART).min(self.pairs)).into_par_iter();
        let found: Result<Vec<_>, ReliabilityError> =
            numbers.map(|number| records(&sequence, number, self.seed)).collect();
        Ok(found?.into_iter().flatten().collect())
    }

    fn publish(&self, records: &[ReliabilityRecord]) -> Publication {
        Publication {
            title: "Which linear methods can be believed?".into(),
            data: vec![tables::every_pair(records)],
            tables: vec![tables::by_sequence(&self.sequences, records), tables::by_method(records)],
            figures: Vec::new(),
        }
    }
}

/// One pair in every way.
fn records(
    sequence: &Sequence,
    number: usize,
    seed: u64,
) -> Result<Vec<ReliabilityRecord>, ReliabilityError> {
    let pair = RandomPair::new(sequence, number, seed);
    let truth = pair.phi().vector();
    let mut all = Vec::new();
    for disparity in [DisparitySource::Exact, DisparitySource::Matched] {
        let observed = ObservedPair::new(&pair, &sequence.rig, sequence.interval_s, disparity)?;
        let corners = observed.by_corners();
        let start = corners.as_ref().ok().map(|motion| motion.phi_or_zero());
        for (method, approach, estimator) in ways() {
            let config = Config { method, approach, estimator, ..Config::default() };
            let answer = observed.solve(&config, start.as_ref());
            let sigmas = std::array::from_fn(|i| {
                let found = answer.as_ref().ok().filter(|found| found.observed[i])?;
                Some((found.theta.mean[i] - truth[i]) / found.theta.sigma(i))
            });
            let warning = answer.as_ref().ok().zip(corners.as_ref().ok());
            let warning =
                warning.and_then(|(found, corners)| observed.contradiction(&config, found, corners));
            all.push(ReliabilityRecord {
                sequence: sequence.name.clone(),
                pair: number,
                disparity,
                method,
                approach,
                estimator,
                sigmas,
                refused: answer.as_ref().err().map(ToString::to_string),
                undetermined: answer.map(|found| found.undetermined.to_string()).unwrap_or_default(),
                warning: warning.map(|warning| warning.cause.to_string()),
            });
        }
    }
    Ok(all)
}

/// Every method, approach and estimator.
fn ways() -> impl Iterator<Item = (Method, Approach, EstimatorKind)> {
    let approaches = |method| [Approach::Differential, Approach::Discrete].map(move |a| (method, a));
    METHODS.into_iter().flat_map(approaches).flat_map(|(method, approach)| {
        ESTIMATORS.into_iter().map(move |estimator| (method, approach, estimator))
    })
}
