//! Whether the stated uncertainty is true: images in, φ, VZ and looming out, judged by exact truth.
//!
//! Every pair of frames stands at a random pose of its own, with a texture and a noise of its own, so that pairs
//! are independent and nothing repeats.

mod by_sigma;
mod depth;
mod figures;
mod pair;
mod verdict;

use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use thiserror::Error;

pub use by_sigma::BySigma;
pub use verdict::Verdict;

use super::{Cell, Publication, Study, Table};
use crate::range::{COUNTS, OutOfRange, sequences, size, within};
pub use depth::DepthKind;
use egomotion::pipeline::Observe;
use egomotion::pipeline::PipelineError;
use egomotion::sim::Sequence;
use pair::Pair;

/// Pairs that one part takes.
const PAIRS_PER_PART: usize = 10;

/// What takes a pair of frames.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum RenderedSensor {
    /// A stereo rig, whose calibration is exact.
    Stereo,
    /// A depth camera, whose calibration and shutter err as its tolerance says.
    Depth(DepthKind),
}

/// The whole pipeline on random pairs of named sequences.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Consistency {
    /// Names of the sequences.
    pub sequences: Vec<String>,
    /// Width of the images, in pixels; the focal length grows with it.
    pub width_px: usize,
    /// Height of the images, in pixels.
    pub height_px: usize,
    /// What takes the pairs.
    pub sensor: RenderedSensor,
    /// What is measured in the images; `Sparse` gives no maps.
    pub observe: Observe,
    /// Pairs of each sequence.
    pub pairs: usize,
    /// Seed of poses, textures and noise.
    pub seed: u64,
}

impl Default for Consistency {
    fn default() -> Self {
        let paper = ["A", "B", "C", "drive"].into_iter();
        Self {
            sequences: paper.chain(Sequence::lab_names()).map(str::to_owned).collect(),
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
    #[error("no sequence {name} of {width}x{height} pixels")]
    Sequence {
        /// Its name.
        name: String,
        /// Width asked for, in pixels.
        width: usize,
        /// Height asked for, in pixels.
        height: usize,
    },
    /// The pipeline refuses the rig.
    #[error(transparent)]
    Pipeline(#[from] PipelineError),
}

/// What one pair says.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Record {
    /// The sequence.
    pub sequence: String,
    /// Number of the pair in its sequence.
    pub pair: usize,
    /// Error of φ, in metres and radians; `None` where a component has no answer.
    pub error: Option<[f64; 6]>,
    /// Covariance of φ, row by row.
    pub cov: Vec<f64>,
    /// VZ of every pixel against the truth.
    pub depth_velocity: BySigma,
    /// Looming of every pixel against the truth.
    pub looming: BySigma,
    /// Share of the pixels in front of a surface that have an answer.
    pub answered: f64,
}

impl Consistency {
    /// (sequence, first pair) of each part.
    fn chunks(&self) -> Vec<(&str, usize)> {
        let starts = || (0..self.pairs).step_by(PAIRS_PER_PART);
        self.sequences.iter().flat_map(|name| starts().map(move |start| (name.as_str(), start))).collect()
    }

    fn sequence(&self, name: &str) -> Result<Sequence, ConsistencyError> {
        let size = (self.width_px, self.height_px);
        let unknown = || ConsistencyError::Sequence { name: name.to_owned(), width: size.0, height: size.1 };
        Sequence::named(name, Some(size), Some(2), 1.0).ok_or_else(unknown)
    }
}

impl Study for Consistency {
    type Record = Record;
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
        let name = |(name, start): (&str, usize)| format!("{name} from pair {start}");
        self.chunks().into_iter().map(name).collect()
    }

    fn run(&self, part: usize) -> Result<Vec<Record>, ConsistencyError> {
        let Some(&(name, start)) = self.chunks().get(part) else { return Ok(Vec::new()) };
        let sequence = self.sequence(name)?;
        (start..(start + PAIRS_PER_PART).min(self.pairs))
            .into_par_iter()
            .map(|pair| Ok(Pair::new(&sequence, pair, self.seed).judge(self.sensor, self.observe)?))
            .collect()
    }

    fn publish(&self, records: &[Record]) -> Publication {
        let caption = "Each pair at a random pose with its own texture and noise, through the whole image \
                       pipeline. NEES/6 is 1 and a normalised variance is 1 where covariances are true.";
        let mut table =
            Table::new("consistency", "Uncertainty against exact truth", caption, &verdict::COLUMNS);
        let named = |name: &str| records.iter().filter(|r| r.sequence == name).collect::<Vec<_>>();
        let mut verdicts: Vec<Verdict> =
            self.sequences.iter().map(|name| Verdict::of(name, &named(name))).collect();
        verdicts.push(Verdict::of("all", &records.iter().collect::<Vec<_>>()));
        table.rows = verdicts.iter().map(Verdict::cells).collect();
        Publication {
            title: "Is the stated uncertainty true?".into(),
            data: vec![table, verdict::pairs(records)],
            tables: vec![verdict::directions(&verdicts)],
            figures: figures::all(&verdicts),
        }
    }
}

/// A cell that says how many of how many in percent.
fn percent(share: Option<f64>) -> Cell {
    share.map(|share| 100.0 * share).into()
}
