//! One pair of frames at a random pose, through the pipeline, against the truth.

use nalgebra::Vector3;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

use super::depth_camera::ErringDepthCamera;
use super::{ConsistencyRecord, CoverageBySigma, RenderedSensor};
use crate::synthetic::{EDGE_RAYS, draw_seed};
use egomotion::estimate::RigPrior;
use egomotion::geometry::{RigidMotion, Twist};
use egomotion::pipeline::{Config, FrameMotion, Observe, StereoFrame, StereoMotion};
use egomotion::pipeline::{DenseResults, PipelineError};
use egomotion::sim::{Scene, SensorNoise, Sequence, View};

/// Largest distance of a pose from the sequence's own along each axis, in metres.
///
/// Larger distances vary the view more, and more poses come too near to a surface.
const POSE_REACH_M: f64 = 0.2;
/// Largest rotation of a pose from the sequence's own about each axis, in degrees.
///
/// Larger rotations vary the view more, and may turn the camera away from the room.
const POSE_REACH_DEG: f64 = 6.0;
/// Least distance to a surface, in metres: a pose that comes nearer is drawn again.
///
/// A smaller distance admits views of hardly anything but one surface.
const LEAST_CLEARANCE_M: f64 = 0.5;
/// Number of poses that are drawn before the sequence's own is taken.
///
/// More of them find a pose in a narrower room.
const POSE_ATTEMPTS: usize = 50;
/// Factor by which a sequence's name becomes a number, one byte after another.
const NAME_HASH_FACTOR: u64 = 131;
/// Odd number that spreads the study's seed over 64 bits: 2⁶⁴ over the golden ratio.
const SEED_FACTOR: u64 = 0x9E37_79B9_7F4A_7C15;

/// A pair of frames with a pose, a texture and a noise of its own.
pub(crate) struct RandomPair<'a> {
    sequence: &'a Sequence,
    scene: Scene,
    number: usize,
    seed: u64,
    phi: Twist,
    poses: [RigidMotion; 2],
}

impl<'a> RandomPair<'a> {
    /// The pair of that number; everything random in it follows from the number and the seed.
    pub(crate) fn new(sequence: &'a Sequence, number: usize, seed: u64) -> Self {
        let name =
            sequence.name.bytes().fold(0_u64, |h, b| h.wrapping_mul(NAME_HASH_FACTOR).wrapping_add(b.into()));
        let seed = seed.wrapping_mul(SEED_FACTOR) ^ draw_seed(name, number);
        let mut rng = Pcg64Mcg::seed_from_u64(seed);
        let scene = sequence.scene.clone().with_texture(rng.random());
        let phi = sequence.phi_cyclopean(0).unwrap_or_else(Twist::zero);
        let moved = |pose: RigidMotion| [pose, pose.after(&phi.exp().inverse())];
        let clear = |poses: &[RigidMotion; 2]| {
            poses.iter().all(|pose| scene.clearance_m(&pose.translation) > LEAST_CLEARANCE_M)
        };
        let mut any = || {
            let mut within = |reach: f64| Vector3::from_fn(|_, _| rng.random_range(-reach..=reach));
            Twist { t: within(POSE_REACH_M), omega: within(POSE_REACH_DEG.to_radians()) }
        };
        let poses = (0..POSE_ATTEMPTS).map(|_| moved(any().exp())).find(clear);
        let poses = poses.unwrap_or_else(|| moved(RigidMotion::identity()));
        // Files that hold a scene take no larger seed of noise.
        Self { sequence, scene, number, seed: seed >> 1, phi, poses }
    }

    /// What the rig sees at the first or the second moment.
    pub(crate) fn view(&self, k: usize) -> View<'_> {
        View::new(&self.scene, &self.sequence.rig, self.poses[k])
    }

    /// The pipeline's answer to the frames of a stereo rig.
    fn by_stereo(&self, observe: Observe) -> Result<FrameMotion, PipelineError> {
        // The rig that is rendered is exactly the stated one.
        let config = Config { observe, rig_errors: RigPrior::exact(), ..Config::default() };
        let mut motion = StereoMotion::new(self.sequence.rig, config)?;
        motion.push(self.frame(0));
        Ok(motion.push(self.frame(1)))
    }

    /// The images of the first or the second moment, with the sensor's noise.
    pub(crate) fn frame(&self, k: usize) -> StereoFrame {
        let noise = SensorNoise::default().with_seed(self.seed);
        let seen = noise.expose(&self.view(k).render(EDGE_RAYS), k as u64);
        StereoFrame { time_s: self.sequence.interval_s * k as f64, left: seen.left, right: seen.right }
    }

    /// φ of the left camera.
    pub(crate) fn phi(&self) -> Twist {
        self.phi.seen_from(&self.sequence.rig.left_from_cyclopean())
    }

    /// Run the pipeline and set its answer against the truth.
    pub(super) fn record(
        &self,
        sensor: RenderedSensor,
        observe: Observe,
    ) -> Result<ConsistencyRecord, PipelineError> {
        let rig = self.sequence.rig;
        let answer = match sensor {
            RenderedSensor::Stereo => self.by_stereo(observe)?,
            RenderedSensor::Depth(kind) => ErringDepthCamera::new(kind, &self.scene, &rig, self.seed)
                .answer(self.poses[0], &self.phi, observe)?,
        };
        let phi = self.phi();
        let mut record = ConsistencyRecord {
            sequence: self.sequence.name.clone(),
            pair: self.number,
            error: None,
            cov: Vec::new(),
            depth_velocity: CoverageBySigma::default(),
            looming: CoverageBySigma::default(),
            answered: 0.0,
        };
        if let Some(found) = answer.motion.ok().filter(|found| found.is_complete()) {
            record.error = Some((found.theta.mean - phi.vector()).into());
            record.cov = found.theta.cov.iter().copied().collect();
        }
        if let Some(dense) = &answer.dense {
            let interval_s = answer.dt_s.unwrap_or(self.sequence.interval_s);
            self.count_pixels(&mut record, dense, &phi, interval_s);
        }
        Ok(record)
    }

    /// Count VZ and looming of every pixel against the truth.
    fn count_pixels(
        &self,
        record: &mut ConsistencyRecord,
        dense: &DenseResults,
        phi: &Twist,
        interval_s: f64,
    ) {
        let rig = &self.sequence.rig;
        let truth = self.view(0).truth_maps(Some(phi));
        let maps = &dense.motion;
        let (mut answers, mut pixels) = (0, 0);
        for v in 0..rig.height_px {
            for u in 0..rig.width_px {
                let (Some(z), Some(vz)) = (truth.depth.get(u, v), truth.depth_velocity.get(u, v)) else {
                    continue;
                };
                pixels += 1;
                let (Some(found), Some(sigma)) =
                    (maps.depth_velocity.get(u, v), maps.depth_velocity_sigma.get(u, v))
                else {
                    continue;
                };
                answers += 1;
                record.depth_velocity.add(f64::from(found - vz), sigma.into());
                if let Some(impact) = maps.impact(u, v) {
                    let looming = f64::from(-vz / (z + vz)) / interval_s;
                    record.looming.add(impact.looming.value() - looming, impact.looming.sigma(0));
                }
            }
        }
        record.answered = f64::from(answers) / f64::from(pixels.max(1));
    }
}
