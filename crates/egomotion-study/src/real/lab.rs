//! The manipulator's sequences through the whole image pipeline, against exact truth.

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::estimates::{ImageEstimates, MatchingSettings};
use super::matching::MatchedFrames;
use super::record::{DrawId, RealRecord};
use super::rendered::RenderedSequence;
use super::{RealError, publish};
use crate::range::{OutOfRange, sequences, size, within};
use crate::sequences::{owned, required};
use crate::{Publication, Study};
use egomotion::sim::{Sequence, StereoImages};

/// The sequence whose images Figure 11 shows.
const SHOWN_SEQUENCE: &str = "lab-G";

/// `study real`: section 7.2, Tables 3 to 7 and Figures 11 to 14, on rendered images of lab-A … lab-M.
///
/// A draw is three stereo frames at exp((k − s) φ), exp(k φ), exp((k + s) φ) for a reference pose k and the step s,
/// with sensor noise of its own; a seed is a texture. Matching knows nothing of the truth.
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
            sequences: owned(Sequence::lab_names()),
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

impl LabStudy {
    /// (sequence, seed) of each part.
    fn draws(&self) -> Vec<(&str, u64)> {
        let seeds = || (0..u64::from(self.seeds)).map(|i| self.first_seed.wrapping_add(i));
        self.sequences.iter().flat_map(|name| seeds().map(move |seed| (name.as_str(), seed))).collect()
    }

    /// The last reference pose.
    fn last_pose(&self) -> i32 {
        i32::try_from(self.poses).unwrap_or(i32::MAX)
    }

    /// The sequence of that name with the texture of that seed.
    fn sequence(&self, name: &str, seed: u64) -> Result<Sequence, RealError> {
        let mut sequence = required(name, Some((self.width_px, self.height_px)))?;
        sequence.scene = sequence.scene.with_texture(seed);
        Ok(sequence)
    }

    /// The records of one texture, for all reference poses.
    fn draw(&self, name: &str, seed: u64) -> Result<Vec<RealRecord>, RealError> {
        let poses: Vec<i32> = (-self.last_pose()..=self.last_pose()).collect();
        let rendered = RenderedSequence::new(self.sequence(name, seed)?, seed, self.step, &poses);
        let records: Result<Vec<Vec<RealRecord>>, RealError> =
            poses.par_iter().map(|&k| self.pose(&rendered, k)).collect();
        Ok(records?.into_iter().flatten().collect())
    }

    fn pose(&self, rendered: &RenderedSequence, k: i32) -> Result<Vec<RealRecord>, RealError> {
        let rig = &rendered.sequence.rig;
        let draw = DrawId { sequence: rendered.sequence.name.clone(), pose: k.into(), seed: rendered.seed };
        let settings = MatchingSettings {
            levels: self.levels,
            sample_step_px: self.sample_step_px,
            seed: rendered.seed,
        };
        let found = ImageEstimates::of(&rendered.frames(k), rig, &settings)?;
        let truth = rendered.truth(k);

        let to_cyclopean = -rig.left_from_cyclopean();
        let phi = found.motions.iter().flat_map(|(contender, estimate)| {
            draw.phi(*contender, &estimate.seen_from(&to_cyclopean), Some(&rendered.motion()))
        });
        let mut records: Vec<RealRecord> = phi.collect();
        records.extend(truth.matching(&draw, &found.matched));
        for (contender, map) in found.depth_velocities() {
            records.extend(truth.vz(&draw, contender, &map));
        }
        Ok(records)
    }

    /// The exposed frames t−1, t, t+1 at reference pose 0 of [`SHOWN_SEQUENCE`], and what is matched in them: Figure 11.
    fn example(&self) -> Option<([StereoImages; 3], MatchedFrames)> {
        let sequence = self.sequence(SHOWN_SEQUENCE, self.first_seed).ok()?;
        let rig = sequence.rig;
        let frames = RenderedSequence::new(sequence, self.first_seed, self.step, &[0]).frames(0);
        let matched = MatchedFrames::new(&frames, &rig, self.levels as f32).ok()?;
        Some((frames, matched))
    }
}

impl Study for LabStudy {
    type Record = RealRecord;
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

    fn run(&self, part: usize) -> Result<Vec<RealRecord>, RealError> {
        self.draws().get(part).map_or_else(|| Ok(Vec::new()), |(name, seed)| self.draw(name, *seed))
    }

    fn publish(&self, records: &[RealRecord]) -> Publication {
        let example = self.example();
        publish::lab(example.as_ref().map(|(frames, matched)| (frames, matched)), records)
    }
}
