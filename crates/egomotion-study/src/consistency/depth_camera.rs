//! A depth camera that errs as its tolerance says, and the pipeline's answer to its frames.

use nalgebra::Vector3;
use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64Mcg;
use serde::{Deserialize, Serialize};

use crate::synthetic::EDGE_RAYS;
use egomotion::estimate::Tolerance;
use egomotion::estimate::{HAND_ACCELERATION_M_S2, HAND_ACCELERATION_RAD_S2};
use egomotion::geometry::{Field, Grid, Image, RigidMotion, StereoRig, Twist};
use egomotion::pipeline::PipelineError;
use egomotion::pipeline::{Config, DepthCamera, DepthNoise, FrameMotion, Observe, RgbdMotion};
use egomotion::sim::{DepthSensing, Scene, SensorNoise, View};

/// Time between the frames of a pair, in seconds: that of a camera with 30 frames a second.
const INTERVAL_S: f64 = 1.0 / 30.0;
/// Bands of rows of which an image with a rolling shutter is made, each rendered at one time.
///
/// More bands come nearer to a shutter that reads row by row, and take longer to render.
const SHUTTER_BANDS: usize = 16;
/// Turns a pair's seed into that of its camera's errors, so that these differ from its pose and texture.
const ERROR_SEED_MASK: u64 = 0x5eed_dee9;

/// Kinds of depth cameras.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum DepthKind {
    /// Structured light, held in a hand.
    Kinect,
    /// Time of flight, held in a hand.
    TimeOfFlight,
    /// Rendered depth in half-precision numbers.
    Rendered,
}

impl DepthKind {
    /// The noise that the pipeline is told.
    fn noise(self) -> DepthNoise {
        match self {
            Self::Kinect => DepthNoise::kinect(),
            Self::TimeOfFlight => DepthNoise::time_of_flight(),
            Self::Rendered => DepthNoise::exact(),
        }
    }

    fn sensing(self, seed: u64) -> DepthSensing {
        match self {
            Self::Kinect => DepthSensing::kinect(seed),
            Self::TimeOfFlight => DepthSensing::time_of_flight(seed),
            Self::Rendered => DepthSensing::half_precision(),
        }
    }
}

/// A depth camera with errors of its own: drawn once, the same for all its frames.
pub(super) struct ErringDepthCamera<'a> {
    kind: DepthKind,
    scene: &'a Scene,
    rig: &'a StereoRig,
    seed: u64,
    tolerance: Tolerance,
    /// Relative error of the focal length, error of the principal point in pixels, relative error of depth.
    calibration: [f64; 4],
    /// Time by which depth lags behind the image, in intervals.
    delay: f64,
    /// Change of the motion from one interval to the next.
    acceleration: Twist,
}

impl<'a> ErringDepthCamera<'a> {
    /// The camera of a pair; its errors follow from the seed.
    pub(super) fn new(kind: DepthKind, scene: &'a Scene, rig: &'a StereoRig, seed: u64) -> Self {
        let tolerance = kind.noise().tolerance();
        let mut rng = Pcg64Mcg::seed_from_u64(seed ^ ERROR_SEED_MASK);
        let mut any = |sigma: f64| {
            let unit: f64 = StandardNormal.sample(&mut rng);
            sigma * unit
        };
        let Tolerance { focal, centre_px, scale, delay_s, .. } = tolerance;
        let calibration = [any(focal), any(centre_px), any(centre_px), any(scale)];
        let delay = any(delay_s) / INTERVAL_S;
        let per_interval = INTERVAL_S * INTERVAL_S;
        let acceleration = Twist {
            t: Vector3::from_fn(|_, _| any(HAND_ACCELERATION_M_S2 * per_interval)),
            omega: Vector3::from_fn(|_, _| any(HAND_ACCELERATION_RAD_S2 * per_interval)),
        };
        Self { kind, scene, rig, seed, tolerance, calibration, delay, acceleration }
    }

    /// Whether something moves while an image is read.
    fn rolls(&self) -> bool {
        self.tolerance.readout_s > 0.0
    }

    /// The pipeline's answer about two frames; `pose` is the cyclopean camera's at the first, `phi` the scene's motion.
    pub(super) fn answer(
        &self,
        pose: RigidMotion,
        phi: &Twist,
        observe: Observe,
    ) -> Result<FrameMotion, PipelineError> {
        let [focal, x, y, _] = self.calibration;
        // A scene seen with f that is believed to be f/(1 + e) is one whose f is underestimated by e.
        let believed = StereoRig {
            focal_px: self.rig.focal_px / (1.0 + focal),
            focal_y_px: self.rig.focal_y_px / (1.0 + focal),
            cx_px: self.rig.cx_px - x,
            cy_px: self.rig.cy_px - y,
            ..*self.rig
        };
        let camera = DepthCamera { rig: believed, noise: self.kind.noise() };
        let mut motion = RgbdMotion::new(camera, Config { observe, ..Config::default() })?;
        let path = Path {
            pose,
            phi: *phi,
            acceleration: if self.rolls() { self.acceleration } else { Twist::zero() },
        };
        let mut push =
            |k: usize| motion.push(k as f64 * INTERVAL_S, self.image(&path, k), &self.depth(&path, k));
        push(0);
        Ok(push(1))
    }

    /// The image, read row by row.
    fn image(&self, path: &Path, k: usize) -> Image {
        let (width, height) = (self.rig.width_px, self.rig.height_px);
        let bands = if self.rolls() { SHUTTER_BANDS.min(height) } else { 1 };
        let readout = self.tolerance.readout_s / INTERVAL_S;
        let mut rows: Vec<f32> = Vec::with_capacity(width * height);
        for band in 0..bands {
            let (top, bottom) = (band * height / bands, (band + 1) * height / bands);
            let middle = 0.5 * (top + bottom) as f64 / height as f64 - 0.5;
            let rig = StereoRig { cy_px: self.rig.cy_px - top as f64, height_px: bottom - top, ..*self.rig };
            let pose = path.pose_at(k as f64 + readout * middle);
            rows.extend_from_slice(View::new(self.scene, &rig, pose).render(EDGE_RAYS).left.values());
        }
        let exact = Grid::from_fn(width, height, |u, v| rows.get(v * width + u).copied().unwrap_or(0.0));
        let seen = egomotion::sim::StereoImages { left: exact.clone(), right: exact };
        SensorNoise::default().with_seed(self.seed >> 1).expose(&seen, k as u64).left
    }

    fn depth(&self, path: &Path, k: usize) -> Field {
        let pose = path.pose_at(k as f64 + self.delay);
        let truth = View::new(self.scene, self.rig, pose).truth_maps(None);
        let measured = self.kind.sensing(self.seed).measure(&truth, k as u64);
        let scale = (1.0 / (1.0 + self.calibration[3])) as f32;
        let (width, height) = measured.size();
        Field::from_grid(Grid::from_fn(width, height, |u, v| {
            measured.get(u, v).map_or(f32::NAN, |z| z * scale)
        }))
    }
}

/// The path of the cyclopean camera: from time 0 to 1 the scene moves by φ, faster in the end.
struct Path {
    pose: RigidMotion,
    phi: Twist,
    acceleration: Twist,
}

impl Path {
    /// At a time in intervals.
    fn pose_at(&self, time: f64) -> RigidMotion {
        let bend = 0.5 * (time * time - time);
        let moved = self.phi.scaled(time).vector() + self.acceleration.scaled(bend).vector();
        self.pose.after(&Twist::from_vector(&moved).exp().inverse())
    }
}
