//! Whether the covariance of a pose relative to any other is true: whole rendered sequences by rigs with random errors.
//!
//! Each run has a rig, a texture and a noise of its own. Along it, poses of the trajectory relative to earlier ones are set
//! against the truth, over several numbers of frames; the intervals of one length do not overlap. The paper has no such
//! study.

mod run;
mod tables;

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::consistency::ConsistencyError;
use crate::range::{COUNTS, OutOfRange, sequences, size, within};
use crate::sequences::{NoSequence, owned};
use crate::{Publication, Study};
use egomotion::estimate::RigPrior;
use egomotion::pipeline::Observe;
use egomotion::sim::Sequence;

/// Runs of one part.
const RUNS_PER_PART: usize = 2;
/// Distances in frames over which poses are compared.
pub const FRAMES_APART: [usize; 5] = [1, 5, 10, 20, 50];

/// `study consistency --rig`: whole sequences of rigs with random errors.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct PoseConsistency {
    /// Names of the sequences.
    pub sequences: Vec<String>,
    /// Width of the images, in pixels; the focal length grows with it.
    pub width_px: usize,
    /// Height of the images, in pixels.
    pub height_px: usize,
    /// Dense measurements, or tracks alone.
    pub observe: Observe,
    /// Runs of each sequence.
    pub runs: usize,
    /// Frames of a run, at most; fewer where the sequence ends or comes too near to a surface.
    pub frames: usize,
    /// Standard deviations of the rig's errors, from which each run draws, and which the pipeline is told.
    pub rig: RigPrior,
    /// Seed of rigs, textures and noise.
    pub seed: u64,
}

impl PoseConsistency {
    /// Angles of 0.02°, a ratio of focal lengths of 0.0005; a focal length, a baseline and a principal point as factories
    /// calibrate them.
    pub fn erring_rig() -> RigPrior {
        RigPrior::default().with_sigmas([0.02, 0.02, 0.02, 5e-4, 5e-4, 0.2, 0.2, 5e-4])
    }
}

impl Default for PoseConsistency {
    fn default() -> Self {
        Self {
            sequences: owned(["corridor", "C", "lab-E"]),
            width_px: 320,
            height_px: 240,
            observe: Observe::Sparse,
            runs: 30,
            frames: 60,
            rig: Self::erring_rig(),
            seed: 1,
        }
    }
}

/// (error, standard deviation) of each component of δ, (translation, rotation) in metres and radians, and eᵀ Σ⁻¹ e.
pub type ComparedPose = ([(f64, f64); 6], f64);

/// Poses of one run against the truth, over one number of frames.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PoseRecord {
    /// The sequence.
    pub sequence: String,
    /// Number of the run in its sequence.
    pub run: usize,
    /// Frames between the two poses.
    pub frames_apart: usize,
    /// Each pair of poses.
    pub poses: Vec<ComparedPose>,
    /// Pairs of poses without a finite covariance.
    pub unknown: usize,
}

impl PoseConsistency {
    /// (sequence, first run) of each part.
    fn chunks(&self) -> Vec<(&str, usize)> {
        crate::sequences::pair_parts(&self.sequences, self.runs, RUNS_PER_PART)
    }
}

impl Study for PoseConsistency {
    type Record = PoseRecord;
    type Error = ConsistencyError;

    fn name(&self) -> &'static str {
        "pose-consistency"
    }

    fn check(&self) -> Result<(), OutOfRange> {
        sequences(&self.sequences)?;
        size(self.width_px, self.height_px)?;
        within("frames", self.frames, &(2..=10_000))?;
        within("runs", self.runs, &COUNTS)
    }

    fn parts(&self) -> Vec<String> {
        self.chunks().into_iter().map(|(name, start)| format!("{name} from run {start}")).collect()
    }

    fn run(&self, part: usize) -> Result<Vec<PoseRecord>, ConsistencyError> {
        let Some(&(name, start)) = self.chunks().get(part) else { return Ok(Vec::new()) };
        let size_px = Some((self.width_px, self.height_px));
        let sequence = Sequence::named(name, size_px, Some(self.frames), 1.0);
        let sequence = sequence.ok_or_else(|| NoSequence { name: name.to_owned(), size_px })?;
        let runs = (start..(start + RUNS_PER_PART).min(self.runs)).into_par_iter();
        let records = runs.map(|number| self.records(&sequence, number));
        Ok(records.collect::<Result<Vec<_>, _>>()?.into_iter().flatten().collect())
    }

    fn publish(&self, records: &[PoseRecord]) -> Publication {
        Publication {
            title: "Is the covariance of every pose true?".into(),
            data: Vec::new(),
            tables: vec![tables::nees(&self.sequences, records), tables::components(records)],
            figures: Vec::new(),
        }
    }
}
