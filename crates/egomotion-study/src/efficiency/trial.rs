//! One setting of the efficiency study: its draws, and the errors of every contender over them.

use rand::SeedableRng;
use rand::seq::index::sample;
use rand_pcg::Pcg64Mcg;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::exact_point::ExactPoint;
use super::factors::Factors;
use super::measurements::{SampledPoints, differential, discrete};
use super::solver::{ContenderSolver, by_displacements, by_velocities};
use super::tally::EfficiencyTally;
use crate::synthetic::{APPROACHES, Contender, REFERENCE_POSES, SyntheticWorld, draw_seed};
use egomotion::estimate::MotionEstimate;
use egomotion::estimate::efficient;
use egomotion::geometry::{Gaussian, StereoRig, Twist};
use egomotion::pipeline::Approach;
use egomotion::sim::Sequence;

/// Errors of one contender over the draws of one setting.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct ContenderErrors {
    /// The contender.
    pub contender: Contender,
    /// Its errors in units of the bound.
    pub tally: EfficiencyTally,
}

/// The usable points of one reference pose, exact.
#[derive(Debug, Clone)]
pub struct PosePoints {
    rig: StereoRig,
    /// The pair's motion: scene motion of the left camera.
    phi: Twist,
    differential: Vec<ExactPoint>,
    discrete: Vec<ExactPoint>,
}

impl PosePoints {
    /// The usable points of the five reference poses.
    pub fn of(sequence: &Sequence) -> Vec<Self> {
        let Some(phi) = sequence.phi_cyclopean(0) else { return Vec::new() };
        let at_pose = |k: i32| {
            let world = SyntheticWorld::new(&sequence.scene, &sequence.rig, &phi, k, 1.0);
            let points = |approach: Approach| {
                world.usable_in(approach).map(|pixel| ExactPoint::of_world(&world, pixel)).collect()
            };
            Self {
                rig: world.rig,
                phi: world.phi,
                differential: points(Approach::Differential),
                discrete: points(Approach::Discrete),
            }
        };
        REFERENCE_POSES.into_iter().map(at_pose).collect()
    }

    fn points(&self, approach: Approach) -> &[ExactPoint] {
        match approach {
            Approach::Differential => &self.differential,
            Approach::Discrete => &self.discrete,
        }
    }
}

impl Factors {
    /// Errors of `contenders` over so many draws at `poses` in turn.
    ///
    /// Draws are summed in their order, so that the sums do not depend on the number of threads.
    pub fn errors(
        &self,
        poses: &[PosePoints],
        contenders: &[Contender],
        draws: usize,
        seed: u64,
    ) -> Vec<ContenderErrors> {
        let of_draw = |i: usize| -> Option<Vec<EfficiencyTally>> {
            let pose = poses.get(i % poses.len().max(1))?;
            Some(self.draw(pose, contenders, draw_seed(seed, i)))
        };
        let all: Vec<Vec<EfficiencyTally>> = (0..draws).into_par_iter().filter_map(of_draw).collect();
        let none = |&contender: &Contender| ContenderErrors { contender, tally: EfficiencyTally::default() };
        let mut errors: Vec<ContenderErrors> = contenders.iter().map(none).collect();
        for tallies in &all {
            for (sum, tally) in errors.iter_mut().zip(tallies) {
                sum.tally = sum.tally.merged(tally);
            }
        }
        errors
    }

    /// One draw: both approaches see points of their own.
    fn draw(&self, pose: &PosePoints, contenders: &[Contender], seed: u64) -> Vec<EfficiencyTally> {
        let trials = APPROACHES.map(|approach| {
            let asked = contenders.iter().any(|contender| contender.approach == approach);
            asked.then(|| Trial::new(self, pose, approach, seed)).flatten()
        });
        let error = |contender: &Contender| {
            let trial = trials.iter().flatten().find(|trial| trial.approach == contender.approach);
            trial.map_or_else(EfficiencyTally::refusal, |trial| trial.error(contender, &pose.phi))
        };
        contenders.iter().map(error).collect()
    }

    fn sampled(&self, pose: &PosePoints, approach: Approach, rng: &mut Pcg64Mcg) -> SampledPoints {
        let all = pose.points(approach);
        let indices = sample(rng, all.len(), self.points.min(all.len()));
        let points = indices.iter().map(|i| all[i]).collect();
        SampledPoints::new(points, self, &pose.rig, &pose.phi, rng)
    }
}

/// One draw in one approach: its efficient estimate, and how contenders solve it.
struct Trial<'a> {
    approach: Approach,
    /// The efficient estimate of the inliers.
    efficient: Gaussian<6>,
    solve: ContenderSolver<'a>,
}

impl<'a> Trial<'a> {
    /// `None` where the inliers do not determine the motion.
    fn new(factors: &Factors, pose: &'a PosePoints, approach: Approach, seed: u64) -> Option<Self> {
        let mut rng = Pcg64Mcg::seed_from_u64(seed);
        let sampled = factors.sampled(pose, approach, &mut rng);
        let (structures, rig, phi) = (sampled.structures(), &pose.rig, &pose.phi);
        let (efficient, solve) = match approach {
            Approach::Differential => {
                let draw = differential(&sampled.points, factors, &mut rng);
                let inliers = &draw.complete[..sampled.inliers];
                (efficient(inliers, &structures, rig, phi), by_velocities(draw, rig, seed))
            }
            Approach::Discrete => {
                let draw = discrete(&sampled.points, factors, &mut rng);
                let inliers = &draw.complete[..sampled.inliers];
                (efficient(inliers, &structures, rig, phi), by_displacements(draw, rig, seed))
            }
        };
        Some(Self { approach, efficient: efficient?, solve })
    }

    fn error(&self, contender: &Contender, truth: &Twist) -> EfficiencyTally {
        let found = (self.solve)(contender).ok().filter(MotionEstimate::is_complete);
        found.map_or_else(EfficiencyTally::refusal, |found| {
            EfficiencyTally::of(&found, &self.efficient, truth)
        })
    }
}
