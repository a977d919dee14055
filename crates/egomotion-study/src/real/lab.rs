//! The manipulator's sequences through the whole image pipeline, judged by exact truth.

use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::measured::{Measured, Unmeasured};
use super::record::{Draw, Record};
use super::stage::Stage;
use super::way::Way;
use super::{depth_velocity, estimates, publish};
use crate::range::{OutOfRange, sequences, size, within};
use crate::{Publication, Study};
use egomotion::estimate::MotionEstimate;
use egomotion::pipeline::PipelineError;
use egomotion::sim::{Sequence, StereoImages};

/// Tables 3 to 7 and Figures 11 to 14 on rendered images of lab-A … lab-M.
///
/// A draw is three stereo frames at exp((k − s) φ), exp(k φ), exp((k + s) φ) for a reference pose k and the step s,
/// with sensor noise of its own; a seed is a texture. What is matched in the images knows nothing of the truth.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct LabStudy {
    /// Names of the sequences.
    pub sequences: Vec<String>,
    /// Width of the images, in pixels; the focal length grows with it.
    pub width_px: usize,
    /// Height of the images, in pixels.
    pub height_px: usize,
    /// STEP: how many frames of the sequence lie between two frames of a draw.
    pub step: u32,
    /// Reference poses k = −poses … poses.
    pub poses: u32,
    /// Number of textures.
    pub seeds: u32,
    /// The first seed; the others follow.
    pub first_seed: u64,
    /// ROUND: steps of disparity in a pixel.
    pub levels: u32,
    /// φ is estimated from every n-th pixel in both directions.
    pub sample_step_px: usize,
}

impl Default for LabStudy {
    fn default() -> Self {
        Self {
            sequences: Sequence::lab_names().map(str::to_owned).collect(),
            width_px: 320,
            height_px: 240,
            step: 1,
            poses: 2,
            seeds: 3,
            first_seed: 1,
            levels: 16,
            sample_step_px: 2,
        }
    }
}

/// Why there are no records.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum RealError {
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
    /// The images are not of the rig's size.
    #[error("the images are of {found:?} pixels, the rig of {expected:?}")]
    Size {
        /// (width, height) of the images.
        found: (usize, usize),
        /// (width, height) of the rig.
        expected: (usize, usize),
    },
    /// Nothing could be measured.
    #[error(transparent)]
    Unmeasured(#[from] Unmeasured),
    /// The pipeline refuses the rig.
    #[error(transparent)]
    Pipeline(#[from] PipelineError),
}

impl LabStudy {
    /// (sequence, seed) of each part.
    pub(super) fn draws(&self) -> Vec<(&str, u64)> {
        let seeds = || (0..u64::from(self.seeds)).map(|i| self.first_seed.wrapping_add(i));
        self.sequences.iter().flat_map(|name| seeds().map(move |seed| (name.as_str(), seed))).collect()
    }

    /// The last reference pose.
    fn reach(&self) -> i32 {
        i32::try_from(self.poses).unwrap_or(i32::MAX)
    }

    /// The sequence of that name with the texture of that seed.
    fn sequence(&self, name: &str, seed: u64) -> Result<Sequence, RealError> {
        let size = (self.width_px, self.height_px);
        let unknown = || RealError::Sequence { name: name.to_owned(), width: size.0, height: size.1 };
        let mut sequence = Sequence::named(name, Some(size), Some(2), 1.0).ok_or_else(unknown)?;
        sequence.scene = sequence.scene.with_texture(seed);
        Ok(sequence)
    }

    /// Everything estimated with one texture, for all reference poses.
    pub(super) fn draw(&self, name: &str, seed: u64) -> Result<Vec<Record>, RealError> {
        let poses: Vec<i32> = (-self.reach()..=self.reach()).collect();
        let stage = Stage::new(self.sequence(name, seed)?, seed, self.step, &poses);
        let records: Result<Vec<Vec<Record>>, RealError> =
            poses.par_iter().map(|&k| self.pose(&stage, k)).collect();
        Ok(records?.into_iter().flatten().collect())
    }

    fn pose(&self, stage: &Stage, k: i32) -> Result<Vec<Record>, RealError> {
        let rig = &stage.sequence.rig;
        let draw = Draw { sequence: stage.sequence.name.clone(), pose: k.into(), seed: stage.seed };
        let frames = stage.frames(k);
        let measured = Measured::new(&frames, rig, self.levels as f32)?;
        let [_, now, after] = &frames;
        let best = estimates::best(now, after, rig)?;
        let truth = stage.truth(k);

        let mut ways = estimates::printed_ways(&measured, self.sample_step_px, stage.seed);
        ways.extend(best.motion.as_ref().ok().map(|estimate| (Way::BEST, *estimate)));
        let to_cyclopean = -rig.left_from_cyclopean();
        let phi = |(way, estimate): &(Way, MotionEstimate)| {
            draw.phi(*way, &estimate.seen_from(&to_cyclopean), &stage.motion())
        };
        let mut records: Vec<Record> = ways.iter().flat_map(phi).collect();
        records.extend(truth.matching(&draw, &measured));
        for (way, map) in depth_velocity::maps(&measured, &best) {
            records.extend(truth.vz(&draw, way, &map));
        }
        Ok(records)
    }

    /// The exposed frames t−1, t, t+1 at reference pose 0 of a sequence, and what is measured in them: Figure 11.
    pub(super) fn example(&self, name: &str) -> Option<([StereoImages; 3], Measured)> {
        let sequence = self.sequence(name, self.first_seed).ok()?;
        let rig = sequence.rig;
        let frames = Stage::new(sequence, self.first_seed, self.step, &[0]).frames(0);
        let measured = Measured::new(&frames, &rig, self.levels as f32).ok()?;
        Some((frames, measured))
    }
}

impl Study for LabStudy {
    type Record = Record;
    type Error = RealError;

    fn name(&self) -> &'static str {
        "real"
    }

    fn check(&self) -> Result<(), OutOfRange> {
        sequences(&self.sequences)?;
        size(self.width_px, self.height_px)?;
        within("step", self.step, &(1..=64))?;
        within("poses", self.poses, &(0..=1000))?;
        within("seeds", self.seeds, &(1..=1_000_000))?;
        within("levels", self.levels, &(1..=4096))?;
        within("sample_step_px", self.sample_step_px, &(1..=64))
    }

    fn parts(&self) -> Vec<String> {
        self.draws().iter().map(|(name, seed)| format!("{name} seed {seed}")).collect()
    }

    fn run(&self, part: usize) -> Result<Vec<Record>, RealError> {
        self.draws().get(part).map_or_else(|| Ok(Vec::new()), |(name, seed)| self.draw(name, *seed))
    }

    fn publish(&self, records: &[Record]) -> Publication {
        publish::lab(self, records)
    }
}
