//! One setting of the sensitivity study: its draws, and the errors of every contender over them.

use nalgebra::{Matrix6, RowVector6, Vector3};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::contender::{Contender, approach_name};
use crate::draw::{self, Measuring};
use crate::tally::Tally;
use crate::world::{UsablePixel, World};
use egomotion::estimate::{MotionEstimate, cramer_rao_bound};
use egomotion::geometry::{Gaussian, RigidMotion, StereoRig, Twist};
use egomotion::metrics::quantile;
use egomotion::motion::{DisparityOffset, RigidPrediction, depth_velocity};
use egomotion::pipeline::{Approach, EstimatorKind, Method};
use egomotion::sim::{Sequence, reference_pose};

/// Reference poses exp(k φ) that the draws go through in turn.
pub const POSES: [i32; 5] = [-2, -1, 0, 1, 2];
/// Quantities of φ, and the factors to millimetres and degrees.
const COMPONENTS: [(&str, f64); 6] = [
    ("tx", 1e3),
    ("ty", 1e3),
    ("tz", 1e3),
    ("wx", 180.0 / std::f64::consts::PI),
    ("wy", 180.0 / std::f64::consts::PI),
    ("wz", 180.0 / std::f64::consts::PI),
];

/// Errors of one quantity by one contender, over some draws of one setting.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Score {
    /// `differential` or `discrete`.
    pub approach: String,
    /// `dcce`, `dv`, `joint`, `linear22`, `rigid`, `ml`, or `bound`.
    pub method: String,
    /// `ls`, `lmeds`, `irls`, `ml`, or `bound`.
    pub estimator: String,
    /// `vz` (each pixel alone), `vz_phi` (through φ), `tx` … `wz`.
    pub quantity: String,
    /// The errors. Of the bound: as an unbiased Gaussian estimator at the bound has them.
    pub tally: Tally,
}

/// A sequence and a setting of the measurements.
#[derive(Debug, Clone, Copy)]
pub struct Setting<'a> {
    /// The scene, the rig and the motion.
    pub sequence: &'a Sequence,
    /// Factor of the pair's motion.
    pub step: f64,
    /// What measurements suffer from.
    pub measuring: Measuring,
    /// Seed of the draws.
    pub seed: u64,
}

impl Setting<'_> {
    /// Least distance from the rig's centre to a surface at t − 1, t and t + 1 of every pose, in metres.
    ///
    /// Negative where it has left the room or entered a part.
    pub fn clearance_m(&self) -> f64 {
        let Some(phi) = self.sequence.phi_cyclopean(0) else { return f64::INFINITY };
        let moved = phi.scaled(self.step).exp();
        let at = |pose: i32| {
            let now = reference_pose(&phi, pose);
            [now, now.after(&moved), now.after(&moved.inverse())]
        };
        let clearance = |pose: RigidMotion| self.sequence.scene.clearance_m(&pose.translation);
        POSES.into_iter().flat_map(at).map(clearance).fold(f64::INFINITY, f64::min)
    }

    /// The world that draw `i` is taken in, at the pose i mod 5; `None` for a sequence without motion.
    pub fn world(&self, i: usize) -> Option<World> {
        let phi = self.sequence.phi_cyclopean(0)?;
        Some(World::new(&self.sequence.scene, &self.sequence.rig, &phi, POSES[i % POSES.len()], self.step))
    }

    /// Seed of draw `i`.
    pub fn seed_of(&self, i: usize) -> u64 {
        self.seed.wrapping_mul(1_000_003).wrapping_add(i as u64)
    }

    /// Scores of the draws in `range`, in a fixed order; draw i is taken at the pose i mod 5.
    pub fn scores(&self, range: std::ops::Range<usize>, approaches: &[Approach]) -> Vec<Score> {
        let Some(phi) = self.sequence.phi_cyclopean(0) else { return Vec::new() };
        let needed = |pose: usize| range.clone().any(|i| i % POSES.len() == pose);
        let centre = -self.sequence.rig.left_from_cyclopean();
        let worlds: Vec<Option<(World, Floors)>> = (0..POSES.len())
            .map(|pose| {
                let world = if needed(pose) { self.world(pose)? } else { return None };
                let floors = Floors::of(&world);
                Some((world, floors))
            })
            .collect();
        let draws: Vec<Vec<Score>> = range
            .into_par_iter()
            .map(|i| {
                let Some((world, floors)) = &worlds[i % POSES.len()] else { return Vec::new() };
                let seed = self.seed_of(i);
                let trial = |approach: &Approach| match approach {
                    Approach::Differential => {
                        Trial::differential(world, floors.differential_m, &self.measuring, seed)
                    }
                    Approach::Discrete => Trial::discrete(world, floors.discrete_m, &self.measuring, seed),
                };
                let truth = phi.scaled(self.step);
                approaches.iter().flat_map(|approach| trial(approach).scores(&truth, &centre)).collect()
            })
            .collect();
        merged(draws.into_iter().flatten())
    }
}

/// Scores of the same contender and quantity added up, in the order in which they first come.
pub fn merged(scores: impl Iterator<Item = Score>) -> Vec<Score> {
    let mut all: Vec<Score> = Vec::new();
    for score in scores {
        let same = |s: &&mut Score| {
            s.approach == score.approach
                && s.method == score.method
                && s.estimator == score.estimator
                && s.quantity == score.quantity
        };
        match all.iter_mut().find(same) {
            Some(known) => known.tally = known.tally.merged(&score.tally),
            None => all.push(score),
        }
    }
    all
}

/// |VZ| from which on a relative error counts: 10 % of its 99th percentile over the pose's usable pixels.
struct Floors {
    differential_m: f64,
    discrete_m: f64,
}

impl Floors {
    fn of(world: &World) -> Self {
        let floor = |values: Vec<f64>| 0.1 * quantile(&values, 0.99).unwrap_or(0.0);
        let dense = world.pixels().iter().filter(|p| p.differential);
        let features = world.pixels().iter().filter(|p| p.discrete);
        Self {
            differential_m: floor(dense.map(|p| p.vz_m.abs()).collect()),
            discrete_m: floor(features.map(|p| p.depth_change_m.abs()).collect()),
        }
    }
}

/// φ by a contender whose rows are weighted at a motion.
type Solve<'a> = Box<dyn Fn(&Contender, &Twist) -> Option<MotionEstimate> + 'a>;
/// VZ of every measured point through φ, in metres.
type Through<'a> = Box<dyn Fn(&Twist) -> Vec<f64> + 'a>;

/// What is judged of a draw, the same for both forms.
struct Trial<'a> {
    approach: Approach,
    /// VZ of every pixel alone, by DCCE and by DV, in metres.
    alone: [(Method, Vec<f64>); 2],
    solve: Solve<'a>,
    through: Through<'a>,
    /// True VZ of every pixel, in metres, and the least that counts for relative errors.
    truth: Vec<f64>,
    floor_m: f64,
    /// The bound of φ's covariance, and the variance of each pixel's VZ through φ there.
    bound: Option<(Matrix6<f64>, Vec<f64>)>,
}

/// The measured points; one whose disparity is not positive is nowhere.
fn points(rig: &StereoRig, xyd: impl Iterator<Item = Vector3<f64>>) -> Vec<Vector3<f64>> {
    xyd.map(|xyd| rig.point(&xyd).unwrap_or_else(|| Vector3::from_element(f64::NAN))).collect()
}

impl<'a> Trial<'a> {
    fn differential(world: &'a World, floor_m: f64, measuring: &Measuring, seed: u64) -> Self {
        let draw = draw::differential(world, measuring, seed);
        let rig = &world.rig;
        let bf = rig.depth_disparity_product();
        let dcce = draw.changes.iter().map(|c| depth_velocity::dcce(&c.depth_change(bf)).vz().value());
        let dv = draw.motions.iter().map(|m| depth_velocity::dv(m, bf).vz().value());
        let alone = [(Method::Dcce, dcce.collect()), (Method::Dv, dv.collect())];
        let points =
            points(rig, draw.motions.iter().map(|m| Vector3::new(m.x_px, m.y_px, m.measured.mean[0])));
        let turn = Twist { t: Vector3::zeros(), ..world.phi };
        let by_d = |xyd: &Vector3<f64>| turn.velocity(&rig.point_jacobian(xyd).column(2).into_owned()).z;
        let noisy = measuring.disparity_variance() > 0.0 && measuring.std_vel_px > 0.0;
        let cov = noisy.then(|| cramer_rao_bound(&draw.exact(), rig, &world.phi)).flatten();
        let variance = |cov: &Matrix6<f64>, p: &UsablePixel| {
            let row = vz_by_phi(&p.point);
            (row * cov * row.transpose())[0] + by_d(&p.xyd).powi(2) * measuring.disparity_variance()
        };
        Self {
            approach: Approach::Differential,
            alone,
            truth: draw.pixels.iter().map(|p| p.vz_m).collect(),
            floor_m,
            bound: cov.map(|cov| (cov, draw.pixels.iter().map(|p| variance(&cov, p)).collect())),
            through: Box::new(move |phi| points.iter().map(|p| phi.velocity(p).z).collect()),
            solve: Box::new(move |contender, at| {
                contender.differential(&draw, rig, at, &contender.config(seed)).ok()
            }),
        }
    }

    fn discrete(world: &'a World, floor_m: f64, measuring: &Measuring, seed: u64) -> Self {
        let draw = draw::discrete(world, measuring, seed);
        let rig = &world.rig;
        let bf = rig.depth_disparity_product();
        let dcce = draw.changes.iter().map(|c| depth_velocity::dcce(&c.depth_change(bf)).vz().value());
        let dv = draw.motions.iter().map(|m| depth_velocity::dv_discrete(m, bf).vz().value());
        let alone = [(Method::Dcce, dcce.collect()), (Method::Dv, dv.collect())];
        let points = points(rig, draw.motions.iter().map(|m| m.before.mean));
        let noisy = measuring.disparity_variance() > 0.0 && measuring.std_track_px > 0.0;
        let cov = noisy.then(|| cramer_rao_bound(&draw.exact(measuring), rig, &world.phi)).flatten();
        let sigma_d = measuring.disparity_variance().sqrt();
        let variances = |cov: &Matrix6<f64>| {
            let phi = Gaussian { mean: world.phi.vector(), cov: *cov };
            let rigid = RigidPrediction::new(&phi, DisparityOffset::none(), rig);
            let of = |p: &&UsablePixel| rigid?.depth_velocity(&p.xyd, sigma_d);
            draw.pixels.iter().map(|p| of(p).map_or(f64::NAN, |vz| vz.vz().variance())).collect()
        };
        Self {
            approach: Approach::Discrete,
            alone,
            truth: draw.pixels.iter().map(|p| p.depth_change_m).collect(),
            floor_m,
            bound: cov.map(|cov| (cov, variances(&cov))),
            through: Box::new(move |phi| {
                let motion = phi.exp();
                points.iter().map(|p| motion.apply(p).z - p.z).collect()
            }),
            solve: Box::new(move |contender, at| {
                contender.discrete(&draw, rig, at, &contender.config(seed)).ok()
            }),
        }
    }

    /// Scores of all contenders against the true φ of the cyclopean camera, whose `centre` the left one sees.
    fn scores(&self, phi: &Twist, centre: &Vector3<f64>) -> Vec<Score> {
        let contenders = Contender::all(self.approach);
        let start = start(&contenders, |c| (self.solve)(c, &Twist::zero()));
        let judge = |contender: &Contender| {
            let name = |quantity: &str, tally| score(contender, quantity, tally);
            // The paper's VZ of a pixel needs no estimator: it stands with least squares.
            let alone = self.alone.iter().filter(|(method, _)| *method == contender.method);
            let alone = alone.filter(|_| contender.estimator == EstimatorKind::Ls);
            let mut scores: Vec<Score> =
                alone.filter_map(|(_, vz)| Some(name("vz", self.vz_tally(vz)?))).collect();
            let found = (self.solve)(contender, &start).filter(MotionEstimate::is_complete);
            if let Some(found) = found {
                let found = found.phi();
                scores.extend(self.vz_tally(&(self.through)(&found)).map(|tally| name("vz_phi", tally)));
                let (found, truth) = (found.seen_from(centre).vector(), phi.vector());
                scores.extend(COMPONENTS.iter().enumerate().map(|(i, (quantity, scale))| {
                    name(quantity, Tally::component(found[i], truth[i], *scale))
                }));
            }
            scores
        };
        let of_contenders = contenders.iter().flat_map(judge).collect::<Vec<_>>();
        of_contenders.into_iter().chain(self.bound(phi, centre)).collect()
    }

    fn vz_tally(&self, vz: &[f64]) -> Option<Tally> {
        let pairs: Vec<_> = vz.iter().copied().zip(self.truth.iter().copied()).collect();
        Tally::depth_velocity(&pairs, self.floor_m)
    }

    /// What an estimator at the bound would show: each error √(2/π) σ.
    fn bound(&self, phi: &Twist, centre: &Vector3<f64>) -> Vec<Score> {
        let Some((cov, variances)) = &self.bound else { return Vec::new() };
        let expected = |variance: f64| (2.0 / std::f64::consts::PI * variance).sqrt();
        let score = |quantity: &str, tally: Tally| Score {
            approach: approach_name(self.approach).to_owned(),
            method: "bound".to_owned(),
            estimator: "bound".to_owned(),
            quantity: quantity.to_owned(),
            tally,
        };
        let vz: Vec<f64> = self.truth.iter().zip(variances).map(|(vz, var)| vz + expected(*var)).collect();
        let through = self.vz_tally(&vz).map(|tally| score("vz_phi", tally));
        let to_centre = Twist::seen_from_matrix(centre);
        let cov = to_centre * cov * to_centre.transpose();
        let truth = phi.vector();
        let components = COMPONENTS.iter().enumerate().map(|(i, (name, scale))| {
            score(name, Tally::component(truth[i] + expected(cov[(i, i)]), truth[i], *scale))
        });
        through.into_iter().chain(components).collect()
    }
}

/// Derivative of VZ = tZ + ΩX Y − ΩY X by φ.
fn vz_by_phi(p: &Vector3<f64>) -> RowVector6<f64> {
    RigidMotion::point_jacobian(p).row(2).into_owned()
}

fn score(contender: &Contender, quantity: &str, tally: Tally) -> Score {
    Score {
        approach: approach_name(contender.approach).to_owned(),
        method: contender.method_name().to_owned(),
        estimator: contender.estimator_name().to_owned(),
        quantity: quantity.to_owned(),
        tally,
    }
}

/// Where weighted rows and iterations start: binocular flow by least squares, or no motion.
fn start(contenders: &[Contender], solve: impl Fn(&Contender) -> Option<MotionEstimate>) -> Twist {
    let plain = |c: &&Contender| c.method == Method::Dv && c.estimator == EstimatorKind::Ls;
    let found = contenders.iter().find(plain).and_then(solve).filter(MotionEstimate::is_complete);
    found.map_or(Twist::zero(), |found| found.phi())
}
