//! 3D motion, depth velocity and time to impact from stereo, each with an uncertainty that can be trusted.
//!
//! The modules follow the way of the data; each imports only from those before it:
//! [`geometry`], [`observe`], [`constrain`], [`estimate`], [`motion`], [`pipeline`]. Beside them stand [`sim`]
//! and [`metrics`], which need geometry alone.
//!
//! Two rendered frames in, the motion of the scene between them out:
//!
//! ```
//! use egomotion::pipeline::{Config, StereoFrame, StereoMotion};
//! use egomotion::sim::{SensorNoise, Sequence};
//!
//! let sequence = Sequence::named("C", None, Some(2), 1.0).ok_or("no such sequence")?;
//! let mut motion = StereoMotion::new(sequence.rig, Config::default())?;
//! for (k, time_s) in [(0, 0.0), (1, 0.1)] {
//!     let view = sequence.view(k).ok_or("no such frame")?;
//!     let images = SensorNoise::default().expose(&view.render(2), k as u64);
//!     let answer = motion.push(StereoFrame { time_s, left: images.left, right: images.right });
//!     if let (Ok(estimate), Some(truth)) = (answer.motion, sequence.phi(0)) {
//!         let (tz, sigma) = (estimate.theta.mean[2], estimate.theta.sigma(2));
//!         println!("tZ {tz:.5} ± {sigma:.5} m, true {:.5} m", truth.t.z);
//!         assert!((tz - truth.t.z).abs() < 5.0 * sigma);
//!     }
//! }
//! assert_eq!(motion.reference(), Some(1));
//! # Ok::<(), Box<dyn std::error::Error>>(())
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
