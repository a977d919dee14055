//! 3D motion, depth velocity and time to impact from stereo, each with an uncertainty that can be trusted.
//!
//! # From images to an answer
//!
//! Give [`StereoMotion`] the rig and one pair of rectified images after the other. Each answer holds φ, the motion of the
//! *scene* relative to the left camera (tX, tY, tZ in metres and ΩX, ΩY, ΩZ in radians over one interval), with its
//! covariance; the time to impact of the nearest obstacle; and maps of every pixel.
//!
//! ```
//! use egomotion::sim::{SensorNoise, Sequence};
//! use egomotion::{Config, StereoFrame, StereoMotion};
//!
//! // Stands in for a camera: a rendered room whose motion is known exactly.
//! let camera = Sequence::named("C", None, Some(2), 1.0).ok_or("no such sequence")?;
//! let mut motion = StereoMotion::new(camera.rig, Config::default())?;
//! for (k, time_s) in [(0, 0.0), (1, 0.1)] {
//!     let images = SensorNoise::default().expose(&camera.view(k).ok_or("no such frame")?.render(2), k as u64);
//!     let answer = motion.push(StereoFrame { time_s, left: images.left, right: images.right });
//!     let Ok(estimate) = &answer.motion else { continue }; // the first frame has nothing to be compared with
//!
//!     let (tz, sigma) = (estimate.theta.mean[2], estimate.theta.sigma(2));
//!     let truth = camera.phi(0).ok_or("no truth")?.t.z;
//!     println!("tZ {tz:.5} ± {sigma:.5} m, true {truth:.5} m");
//!     assert!((tz - truth).abs() < 5.0 * sigma);
//!
//!     let seconds = answer.impact().and_then(|impact| impact.interval95_s());
//!     println!("impact of the nearest obstacle, 95 % interval: {seconds:?} s");
//!
//!     let maps = answer.dense.ok_or("observed sparsely")?.motion;
//!     let (vz, sigma) = (maps.depth_velocity.get(160, 120), maps.depth_velocity_sigma.get(160, 120));
//!     println!("depth velocity of the pixel (160, 120): {vz:?} ± {sigma:?} m a frame");
//! }
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # Where to go on
//!
//! | you have | use |
//! |---|---|
//! | rectified pairs | [`StereoMotion`] |
//! | raw pairs and their calibration | [`geometry::StereoRectification`], [`observe::Rectifier`], then [`StereoMotion`] |
//! | images and depth | [`RgbdMotion`] |
//! | images and disparity or flow of your own | [`Frame`] in [`StereoMotion::push`] |
//! | tracks of your own | [`TrackMotion`] |
//! | equations of your own | [`constrain::LinearConstraint`], [`estimate`] |
//! | a pair, and want disparity alone | [`DisparityMatcher`] |
//! | a method to be tested against exact truth | [`sim`], [`metrics`] |
//!
//! Files are read and written by the crate `egomotion-io`. The folder `examples` of this crate has a program for each of
//! these, and <https://docs.rs/nalgebra> the vectors and matrices, re-exported as [`nalgebra`].
//!
//! The modules follow the way of the data; each imports only from those before it: [`geometry`], [`observe`],
//! [`constrain`], [`estimate`], [`motion`], [`pipeline`]. Beside them stand [`sim`] and [`metrics`], which need geometry
//! alone.
//!
//! # Build with optimisation
//!
//! Without optimisation images take long. Build with `--release`, or say in your workspace's `Cargo.toml`:
//!
//! ```toml
//! [profile.dev.package."*"]
//! opt-level = 3
//! ```
#![deny(missing_docs)]
#![deny(clippy::disallowed_methods)]
#![warn(clippy::too_many_lines)]
#![cfg_attr(not(test), deny(clippy::unwrap_used, clippy::expect_used, clippy::panic))]

pub mod constrain;
pub mod estimate;
pub mod geometry;
pub mod metrics;
pub mod motion;
pub mod observe;
pub mod pipeline;
pub mod sim;
mod simd;

pub use nalgebra;

#[doc(inline)]
pub use crate::{
    estimate::MotionEstimate,
    geometry::{Image, RigidMotion, StereoRig, Twist},
    motion::{Obstacle, TimeToImpact},
    observe::{DisparityMap, DisparityMatcher},
    pipeline::{
        Config, Frame, FrameMotion, RgbdMotion, StereoFrame, StereoMotion, TrackMotion, TrackPoint,
        Trajectory, Unanswered,
    },
};
