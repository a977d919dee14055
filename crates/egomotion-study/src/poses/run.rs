//! One run: a sequence with a rig, a texture and a noise of its own, through the pipeline, against the truth.

use nalgebra::{SVector, Vector6};
use rand::{RngExt, SeedableRng};
use rand_distr::StandardNormal;
use rand_pcg::Pcg64Mcg;

use super::{FRAMES_APART, PoseConsistency, PoseRecord};
use crate::synthetic::{EDGE_RAYS, draw_seed};
use egomotion::geometry::{Gaussian, RIG_ERRORS, RigErrors, RigidMotion};
use egomotion::pipeline::{Config, PipelineError, StereoFrame, StereoMotion, Trajectory};
use egomotion::sim::{SensorNoise, Sequence};

/// A run ends where a camera comes nearer to a surface than this, in metres.
const LEAST_CLEARANCE_M: f64 = 0.3;
/// Odd number that spreads a sequence's length of name and the seed over 64 bits: 2⁶⁴ over the golden ratio.
const SEED_FACTOR: u64 = 0x9E37_79B9_7F4A_7C15;

impl PoseConsistency {
    /// The records of the run of that number; everything random in it follows from the number and the seed.
    pub(super) fn records(
        &self,
        sequence: &Sequence,
        number: usize,
    ) -> Result<Vec<PoseRecord>, PipelineError> {
        let name = sequence.name.bytes().fold(0_u64, |h, b| h.wrapping_mul(131).wrapping_add(b.into()));
        let seed = self.seed.wrapping_mul(SEED_FACTOR) ^ draw_seed(name, number);
        let mut rng = Pcg64Mcg::seed_from_u64(seed);
        let sigma = self.rig.sigma(0.0, &Config::default().tolerance, &sequence.rig);
        let drawn = SVector::<f64, RIG_ERRORS>::from_fn(|_, _| rng.sample(StandardNormal));
        let errors = RigErrors::from_vector(&drawn.component_mul(&sigma.vector()));
        let sequence = sequence.clone().with_texture(rng.random()).with_rig_errors(errors);
        let trajectory = self.trajectory(&sequence, seed >> 1)?;
        Ok(FRAMES_APART
            .map(|apart| {
                let mut record = PoseRecord {
                    sequence: sequence.name.clone(),
                    run: number,
                    frames_apart: apart,
                    poses: Vec::new(),
                    unknown: 0,
                };
                record.compare(&trajectory, &sequence);
                record
            })
            .to_vec())
    }

    /// The trajectory of a sequence with the sensor's noise.
    fn trajectory(&self, sequence: &Sequence, noise_seed: u64) -> Result<Trajectory, PipelineError> {
        let config = Config { observe: self.observe, rig_errors: self.rig, ..Config::default() };
        let mut motion = StereoMotion::new(sequence.rig, config)?;
        let noise = SensorNoise::default().with_seed(noise_seed);
        let mut trajectory = Trajectory::new();
        let clear = |k: &usize| sequence.clearance_m(*k).is_some_and(|m| m > LEAST_CLEARANCE_M);
        for k in (0..sequence.frames()).take_while(clear) {
            let Some(view) = sequence.view(k) else { break };
            let seen = noise.expose(&view.render(EDGE_RAYS), k as u64);
            let time_s = sequence.interval_s * k as f64;
            let mut answer = motion.push(StereoFrame { time_s, left: seen.left, right: seen.right });
            answer.dense = None;
            trajectory.push(&answer);
        }
        Ok(trajectory)
    }
}

impl PoseRecord {
    /// Set poses that are so many frames apart against the truth.
    fn compare(&mut self, trajectory: &Trajectory, sequence: &Sequence) {
        let frames = trajectory.poses().len();
        for i in (0..frames).step_by(self.frames_apart) {
            let j = i + self.frames_apart;
            let truth = |k: usize| sequence.world_from_left(k);
            let (Some(found), Some(from), Some(to)) = (trajectory.relative(i, j), truth(i), truth(j)) else {
                continue;
            };
            let error = error(&found.pose, &from.inverse().after(&to));
            let estimate = Gaussian { mean: error, cov: found.cov };
            match estimate.mahalanobis2(&Vector6::zeros()).filter(|square| square.is_finite()) {
                Some(square) => {
                    let components = std::array::from_fn(|c| (error[c], found.cov[(c, c)].sqrt()));
                    self.poses.push((components, square));
                }
                None => self.unknown += 1,
            }
        }
    }
}

/// δ of T = T̂ exp(δ).
fn error(found: &RigidMotion, truth: &RigidMotion) -> Vector6<f64> {
    found.inverse().after(truth).log().vector()
}
