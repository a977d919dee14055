//! Whether the stated uncertainty is true: images in, φ, VZ and looming out, set against exact truth.
//!
//! Each pair of frames stands at a random pose of its own, with a texture and noise of its own, so that pairs are
//! independent. The statistics are NEES, normalised variances and coverage ([`CoverageBySigma`]). The paper has no
//! such study: it says what the uncertainties of sections 5 and 6 are worth once images are matched.

mod coverage;
mod depth_camera;
mod figures;
pub(crate) mod pair;
mod statistics;
mod tables;

use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use thiserror::Error;

pub use coverage::{CoverageBySigma, CoverageCounts};
pub use depth_camera::DepthKind;

use crate::range::{COUNTS, OutOfRange, sequences, size, within};
use crate::sequences::{NoSequence, PAPER_SEQUENCES, owned, pair_part_names, pair_parts, required};
use crate::{Publication, Study};
use egomotion::pipeline::Observe;
use egomotion::pipeline::PipelineError;
use egomotion::sim::Sequence;
use pair::RandomPair;
use statistics::ConsistencyStatistics;

/// Pairs of one part: more make fewer, longer parts, and so a longer wait for the first results.
const PAIRS_PER_PART: usize = 10;

/// The sensor that takes a pair of frames.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum RenderedSensor {
    /// A stereo rig, whose calibration is exact.
    Stereo,
    /// A depth camera, whose calibration and shutter err as its tolerance says.
    Depth(DepthKind),
}

/// `study consistency`: the whole pipeline on random pairs of rendered sequences.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Consistency {
    /// Names of the sequences.
    pub sequences: Vec<String>,
    /// Width of the images, in pixels; the focal length grows with it.
    pub width_px: usize,
    /// Height of the images, in pixels.
    pub height_px: usize,
    /// The sensor that takes the pairs.
    pub sensor: RenderedSensor,
    /// Dense measurements, or tracks alone, which give no maps.
    pub observe: Observe,
    /// Pairs of each sequence.
    pub pairs: usize,
    /// Seed of poses, textures and noise.
    pub seed: u64,
}

impl Default for Consistency {
    fn default() -> Self {
        let sequences = PAPER_SEQUENCES.into_iter().chain(["drive"]).chain(Sequence::lab_names());
        Self {
            sequences: owned(sequences),
            width_px: 320,
            height_px: 240,
            sensor: RenderedSensor::Stereo,
            observe: Observe::Dense,
            pairs: 50,
            seed: 1,
        }
    }
}

/// Why there are no records.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum ConsistencyError {
    /// There is no such sequence, or the images have no pixels.
    #[error(transparent)]
    Sequence(#[from] NoSequence),
    /// The pipeline refuses the rig.
    #[error(transparent)]
    Pipeline(#[from] PipelineError),
}

/// Error and covariance of φ for one pair, and the coverage of its pixels.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ConsistencyRecord {
    /// The sequence.
    pub sequence: String,
    /// Number of the pair in its sequence.
    pub pair: usize,
    /// Error of φ, in metres and radians; `None` where a component has no answer.
    pub error: Option<[f64; 6]>,
    /// Covariance of φ, row by row.
    pub cov: Vec<f64>,
    /// VZ of every pixel against the truth.
    pub depth_velocity: CoverageBySigma,
    /// Looming of every pixel against the truth.
    pub looming: CoverageBySigma,
    /// Share of the pixels in front of a surface that have an answer.
    pub answered: f64,
}

impl Consistency {
    /// (sequence, first pair) of each part.
    fn chunks(&self) -> Vec<(&str, usize)> {
        pair_parts(&self.sequences, self.pairs, PAIRS_PER_PART)
    }
}

impl Study for Consistency {
    type Record = ConsistencyRecord;
    type Error = ConsistencyError;

    fn name(&self) -> &'static str {
        "consistency"
    }

    fn check(&self) -> Result<(), OutOfRange> {
        sequences(&self.sequences)?;
        size(self.width_px, self.height_px)?;
        within("pairs", self.pairs, &COUNTS)
    }

    fn parts(&self) -> Vec<String> {
        pair_part_names(self.chunks())
    }

    fn run(&self, part: usize) -> Result<Vec<ConsistencyRecord>, ConsistencyError> {
        let Some(&(name, start)) = self.chunks().get(part) else { return Ok(Vec::new()) };
        let sequence = required(name, Some((self.width_px, self.height_px)))?;
        (start..(start + PAIRS_PER_PART).min(self.pairs))
            .into_par_iter()
            .map(|pair| Ok(RandomPair::new(&sequence, pair, self.seed).record(self.sensor, self.observe)?))
            .collect()
    }

    fn publish(&self, records: &[ConsistencyRecord]) -> Publication {
        let named = |name: &str| records.iter().filter(|r| r.sequence == name).collect::<Vec<_>>();
        let mut statistics: Vec<ConsistencyStatistics> =
            self.sequences.iter().map(|name| ConsistencyStatistics::of(name, &named(name))).collect();
        statistics.push(ConsistencyStatistics::of("all", &records.iter().collect::<Vec<_>>()));
        Publication {
            title: "Is the stated uncertainty true?".into(),
            data: vec![tables::consistency(&statistics), tables::pairs(records)],
            tables: vec![tables::normalised_variances(&statistics)],
            figures: figures::all(&statistics),
        }
    }
}
