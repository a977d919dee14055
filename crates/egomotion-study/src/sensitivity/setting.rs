//! One setting of the sensitivity study: its draws, and the errors of every contender over them.

use rayon::prelude::*;

use super::errors::{QuantityErrors, merged};
use super::trial::Trial;
use crate::synthetic::{MeasurementModel, REFERENCE_POSES, SyntheticWorld, draw_seed};
use egomotion::geometry::RigidMotion;
use egomotion::metrics::quantile;
use egomotion::pipeline::Approach;
use egomotion::sim::{Sequence, reference_pose};

/// Share of the 99th percentile of |VZ| from which on a relative error counts.
///
/// A point that hardly moves in depth has a relative error without bound. A larger share leaves out more points.
const LEAST_SHARE_OF_SPEED: f64 = 0.1;

/// One setting of a study: a sequence, the factor of its motion, and what measurements suffer from.
#[derive(Debug, Clone, Copy)]
pub struct Setting<'a> {
    /// The scene, the rig and the motion.
    pub sequence: &'a Sequence,
    /// Factor of the pair's motion.
    pub step: f64,
    /// Noise and rounding of the measurements.
    pub model: MeasurementModel,
    /// Seed of the draws.
    pub seed: u64,
}

impl Setting<'_> {
    /// Least distance from the rig's centre to a surface at t − 1, t and t + 1 of every pose, in metres.
    ///
    /// Negative where it has left the room or entered a part.
    pub(super) fn clearance_m(&self) -> f64 {
        let Some(phi) = self.sequence.phi_cyclopean(0) else { return f64::INFINITY };
        let moved = phi.scaled(self.step).exp();
        let at = |pose: i32| {
            let now = reference_pose(&phi, pose);
            [now, now.after(&moved), now.after(&moved.inverse())]
        };
        let clearance = |pose: RigidMotion| self.sequence.scene.clearance_m(&pose.translation);
        REFERENCE_POSES.into_iter().flat_map(at).map(clearance).fold(f64::INFINITY, f64::min)
    }

    /// The world that draw `i` is taken in, at the pose i mod 5; `None` for a sequence without motion.
    pub fn world(&self, i: usize) -> Option<SyntheticWorld> {
        let phi = self.sequence.phi_cyclopean(0)?;
        Some(SyntheticWorld::new(
            &self.sequence.scene,
            &self.sequence.rig,
            &phi,
            REFERENCE_POSES[i % REFERENCE_POSES.len()],
            self.step,
        ))
    }

    /// Seed of draw `i`.
    pub fn seed_of(&self, i: usize) -> u64 {
        draw_seed(self.seed, i)
    }

    /// Errors of all contenders over the draws in `range`, in a fixed order; draw i is taken at the pose i mod 5.
    pub fn errors(&self, range: std::ops::Range<usize>, approaches: &[Approach]) -> Vec<QuantityErrors> {
        let Some(phi) = self.sequence.phi_cyclopean(0) else { return Vec::new() };
        let needed = |pose: usize| range.clone().any(|i| i % REFERENCE_POSES.len() == pose);
        let centre = -self.sequence.rig.left_from_cyclopean();
        let worlds: Vec<Option<PosedWorld>> = (0..REFERENCE_POSES.len())
            .map(|pose| if needed(pose) { self.world(pose).map(PosedWorld::new) } else { None })
            .collect();
        let truth = phi.scaled(self.step);
        let draws: Vec<Vec<QuantityErrors>> = range
            .into_par_iter()
            .map(|i| {
                let Some(world) = &worlds[i % REFERENCE_POSES.len()] else { return Vec::new() };
                let trial = |&approach: &Approach| world.trial(approach, &self.model, self.seed_of(i));
                approaches.iter().flat_map(|approach| trial(approach).errors(&truth, &centre)).collect()
            })
            .collect();
        merged(draws.into_iter().flatten())
    }
}

/// The world of one reference pose, and |VZ| from which on a relative error counts there, in metres.
struct PosedWorld {
    world: SyntheticWorld,
    differential_floor_m: f64,
    discrete_floor_m: f64,
}

impl PosedWorld {
    fn new(world: SyntheticWorld) -> Self {
        let floor_m = |approach: Approach| {
            let speeds = world.usable_in(approach).map(|p| p.depth_velocity_m(approach).abs());
            LEAST_SHARE_OF_SPEED * quantile(&speeds.collect::<Vec<f64>>(), 0.99).unwrap_or(0.0)
        };
        let differential_floor_m = floor_m(Approach::Differential);
        let discrete_floor_m = floor_m(Approach::Discrete);
        Self { world, differential_floor_m, discrete_floor_m }
    }

    fn trial(&self, approach: Approach, model: &MeasurementModel, seed: u64) -> Trial<'_> {
        match approach {
            Approach::Differential => {
                Trial::differential(&self.world, self.differential_floor_m, model, seed)
            }
            Approach::Discrete => Trial::discrete(&self.world, self.discrete_floor_m, model, seed),
        }
    }
}
