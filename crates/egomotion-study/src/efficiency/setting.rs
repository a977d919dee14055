//! One setting of the efficiency study: its draws, and the errors of every contender over them.

use nalgebra::Vector3;
use rand::SeedableRng;
use rand::seq::index::sample;
use rand_pcg::Pcg64Mcg;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::measure::{Chosen, differential, discrete};
use super::site::Site;
use super::tally::Tally;
use crate::contender::Contender;
use crate::draw::{Differential, Discrete};
use crate::world::World;
use egomotion::estimate::{
    MaximumLikelihoodOptions, MotionEstimate, Unsolvable, efficient, maximum_likelihood, robust_start,
};
use egomotion::geometry::{Gaussian, StereoRig, Twist};
use egomotion::observe::{StereoFlow, StereoTrack};
use egomotion::pipeline::{Approach, Config, Method};
use egomotion::sim::Sequence;

/// Reference poses exp(k φ) that the draws go through in turn.
const POSES: [i32; 5] = [-2, -1, 0, 1, 2];
/// Points are drawn one by one, so that pixels are hardly ever neighbours: blocks need not hold many.
const BLOCK_PX: f64 = 8.0;

/// At which ends of a displacement x and y are noisy; disparity is at both.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Ends {
    /// At t and t′.
    Both,
    /// At t′ alone: points are exact pixels at t.
    Later,
}

/// What outliers are.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Kind {
    /// Found anywhere within a matcher's reach.
    Uniform,
    /// One body with its own rigid motion.
    Coherent,
}

/// What points suffer from.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Setting {
    /// σ of x, y and d, in pixels; in the differential form of d and of every component of flow.
    pub noise_px: f64,
    /// Where x and y have it.
    pub ends: Ends,
    /// Number of points, outliers included.
    pub points: usize,
    /// Share of outliers.
    pub outliers: f64,
    /// What they are.
    pub kind: Kind,
}

/// Errors of one contender.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Score {
    /// Who.
    pub contender: Contender,
    /// How wrong.
    pub tally: Tally,
}

/// The points of one reference pose.
#[derive(Debug, Clone)]
pub struct Place {
    rig: StereoRig,
    /// The pair's motion: scene motion of the left camera.
    phi: Twist,
    differential: Vec<Site>,
    discrete: Vec<Site>,
}

impl Place {
    /// The usable points of the five reference poses.
    pub fn of(sequence: &Sequence) -> Vec<Self> {
        let Some(phi) = sequence.phi_cyclopean(0) else { return Vec::new() };
        let place = |k: i32| {
            let world = World::new(&sequence.scene, &sequence.rig, &phi, k, 1.0);
            let sites = |discrete: bool| {
                let usable =
                    world.pixels().iter().filter(|p| if discrete { p.discrete } else { p.differential });
                usable.map(|pixel| Site::of_world(&world, pixel)).collect()
            };
            Self { rig: world.rig, phi: world.phi, differential: sites(false), discrete: sites(true) }
        };
        POSES.into_iter().map(place).collect()
    }

    fn sites(&self, approach: Approach) -> &[Site] {
        match approach {
            Approach::Differential => &self.differential,
            Approach::Discrete => &self.discrete,
        }
    }
}

impl Setting {
    /// Scores of `contenders` over so many draws at `places` in turn.
    ///
    /// Draws are summed in their order, so that the sums do not depend on the number of threads.
    pub fn scores(&self, places: &[Place], contenders: &[Contender], draws: usize, seed: u64) -> Vec<Score> {
        let of_draw = |i: usize| -> Option<Vec<Tally>> {
            let place = places.get(i % places.len().max(1))?;
            Some(self.draw(place, contenders, seed.wrapping_mul(1_000_003).wrapping_add(i as u64)))
        };
        let all: Vec<Vec<Tally>> = (0..draws).into_par_iter().filter_map(of_draw).collect();
        let mut scores: Vec<Score> =
            contenders.iter().map(|&contender| Score { contender, tally: Tally::default() }).collect();
        for tallies in &all {
            for (score, tally) in scores.iter_mut().zip(tallies) {
                score.tally = score.tally.merged(tally);
            }
        }
        scores
    }

    /// One draw: both approaches see points of their own.
    fn draw(&self, place: &Place, contenders: &[Contender], seed: u64) -> Vec<Tally> {
        let trials = [Approach::Differential, Approach::Discrete].map(|approach| {
            let asked = contenders.iter().any(|contender| contender.approach == approach);
            asked.then(|| Trial::new(self, place, approach, seed)).flatten()
        });
        let judge = |contender: &Contender| {
            let trial = trials.iter().flatten().find(|trial| trial.approach == contender.approach);
            trial.map_or_else(Tally::refusal, |trial| trial.judge(contender, &place.phi))
        };
        contenders.iter().map(judge).collect()
    }

    fn chosen(&self, place: &Place, approach: Approach, rng: &mut Pcg64Mcg) -> Chosen {
        let all = place.sites(approach);
        let indices = sample(rng, all.len(), self.points.min(all.len()));
        let sites = indices.iter().map(|i| all[i]).collect();
        Chosen::new(sites, self, &place.rig, &place.phi, rng)
    }
}

/// φ by a contender from measurements of either form.
pub(super) type Solve<'a> = Box<dyn Fn(&Contender) -> Result<MotionEstimate, Unsolvable> + 'a>;

/// What is judged of a draw, the same for both forms.
struct Trial<'a> {
    approach: Approach,
    /// The efficient estimate of the inliers.
    efficient: Gaussian<6>,
    solve: Solve<'a>,
}

impl<'a> Trial<'a> {
    /// `None` where the inliers do not determine the motion.
    fn new(setting: &Setting, place: &'a Place, approach: Approach, seed: u64) -> Option<Self> {
        let mut rng = Pcg64Mcg::seed_from_u64(seed);
        let chosen = setting.chosen(place, approach, &mut rng);
        let (structures, rig, phi) = (chosen.structures(), &place.rig, &place.phi);
        let (efficient, solve) = match approach {
            Approach::Differential => {
                let draw = differential(&chosen.sites, setting, &mut rng);
                (
                    efficient(&draw.complete[..chosen.inliers], &structures, rig, phi),
                    by_velocities(draw, rig, seed),
                )
            }
            Approach::Discrete => {
                let draw = discrete(&chosen.sites, setting, &mut rng);
                (
                    efficient(&draw.complete[..chosen.inliers], &structures, rig, phi),
                    by_displacements(draw, rig, seed),
                )
            }
        };
        Some(Self { approach, efficient: efficient?, solve })
    }

    fn judge(&self, contender: &Contender, truth: &Twist) -> Tally {
        let found = (self.solve)(contender).ok().filter(MotionEstimate::is_complete);
        found.map_or_else(Tally::refusal, |found| Tally::of(&found, &self.efficient, truth))
    }
}

fn config(contender: &Contender, seed: u64) -> Config {
    Config { block_px: BLOCK_PX, ..contender.config(seed) }
}

/// Contenders on velocities; all start from the same robust motion.
pub(super) fn by_velocities<'a>(draw: Differential<'static>, rig: &'a StereoRig, seed: u64) -> Solve<'a> {
    let tracks: Vec<StereoTrack> = draw.complete.iter().map(as_displacement).collect();
    let start = start(&tracks, rig, seed);
    Box::new(move |contender| {
        let config = config(contender, seed);
        if contender.method == Method::Ml {
            let kernel = &config.maximum_likelihood.kernel;
            return Ok(maximum_likelihood(&draw.complete, rig, &start, None, kernel)?.motion);
        }
        contender.differential(&draw, rig, &start, &config)
    })
}

/// Contenders on displacements; all start from the same robust motion.
pub(super) fn by_displacements<'a>(draw: Discrete<'static>, rig: &'a StereoRig, seed: u64) -> Solve<'a> {
    let start = start(&draw.complete, rig, seed);
    Box::new(move |contender| {
        let config = config(contender, seed);
        if contender.method == Method::Ml {
            let kernel = &config.maximum_likelihood.kernel;
            return Ok(maximum_likelihood(&draw.complete, rig, &start, None, kernel)?.motion);
        }
        contender.discrete(&draw, rig, &start, &config)
    })
}

/// The robust alignment of displacements.
fn start(tracks: &[StereoTrack], rig: &StereoRig, seed: u64) -> Twist {
    let options = MaximumLikelihoodOptions { seed, ..MaximumLikelihoodOptions::default() };
    robust_start(tracks, rig, None, &options).unwrap_or_else(|_| Twist::zero())
}

/// A velocity as the displacement of one interval, near enough to start from.
fn as_displacement(flow: &StereoFlow) -> StereoTrack {
    let [d, vx, vy, right] = flow.measured.mean.into();
    let variance = |i: usize| flow.measured.cov[(i, i)];
    let before = Vector3::new(flow.x_px, flow.y_px, d);
    let later = before + Vector3::new(vx, vy, vx - right);
    // The rate of disparity has the noise of both cameras' flow beside that of d, which both ends share.
    let rate = variance(1) + variance(3);
    StereoTrack {
        before: Gaussian::independent(before.into(), [0.0, 0.0, variance(0)]),
        after: Gaussian::independent(later.into(), [variance(1), variance(2), rate]),
    }
}
