//! Whether a method can hold on the data at hand: its answer against that of tracked corners.
//!
//! Maximum likelihood of corners takes no derivative and no small motion for granted. A linear method that differs from
//! it by many standard deviations has a bias that its covariance does not know, and the observations tell why.

use std::fmt;

use serde::{Deserialize, Serialize};

use super::observed::Observed;
use crate::constrain::dcce;
use crate::estimate::{MotionEstimate, noise_factor};
use crate::geometry::distribution::SIGMA_PER_MEDIAN_DEVIATION;
use crate::geometry::{Twist, median};
use crate::observe::{DepthChange, StereoTrack};
use crate::pipeline::config::Approach;
use crate::pipeline::plan::{Equations, Interval};

/// Answers contradict each other beyond this many standard deviations of their difference: far more than six unbiased
/// components would show by chance.
const CONTRADICTING_SIGMAS: f64 = 5.0;
/// Gradients are noisy where this share of their squared effect is noise: least squares then loses as much of the motion.
const NOISY_SHARE: f64 = 0.02;
/// Points move far where their median displacement exceeds this, in pixels: a gradient is one over two pixels.
const FAR_PX: f64 = 2.0;
/// The scene comes nearer fast where it does so by this share of its depth in an interval.
const FAST_SHARE: f64 = 0.03;

/// Symbols of φ's components.
const COMPONENTS: [&str; 6] = ["tX", "tY", "tZ", "ΩX", "ΩY", "ΩZ"];

/// An answer that tracked corners contradict.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Contradiction {
    /// Place in φ, 0 … 5, of the component that is furthest off.
    pub component: usize,
    /// Its value, in metres or radians per interval.
    pub found: f64,
    /// What corners say, in metres or radians per interval.
    pub expected: f64,
    /// The difference in its standard deviations.
    pub sigmas: f64,
    /// What the observations give as the cause.
    pub cause: BiasCause,
}

/// Why a linear method is biased.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum BiasCause {
    /// Gradients of disparity are as noisy as this share of their squared effect.
    NoisyGradients {
        /// The share, 0 … 1.
        share: f64,
    },
    /// Points move too far for differences to stand for derivatives.
    LongDisplacement {
        /// The median displacement, in pixels.
        pixels: f64,
    },
    /// The scene comes nearer, or goes away, too fast for a displacement to stand for a velocity.
    FastApproach {
        /// |tZ| over the median depth.
        share: f64,
    },
    /// The observations show none of these.
    Unknown,
}

impl fmt::Display for BiasCause {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NoisyGradients { share } => {
                write!(
                    f,
                    "gradients of disparity are {:.0} % noise, which makes the motion too small",
                    100.0 * share
                )
            }
            Self::LongDisplacement { pixels } => {
                write!(f, "points move by {pixels:.1} px, too far for differences to stand for derivatives")
            }
            Self::FastApproach { share } => {
                let percent = 100.0 * share;
                write!(f, "depth changes by {percent:.0} % in an interval, too fast to stand for a velocity")
            }
            Self::Unknown => f.write_str("the observations do not show the cause"),
        }
    }
}

impl Contradiction {
    /// Symbol of the component: tX … ΩZ.
    pub fn symbol(&self) -> &'static str {
        COMPONENTS.get(self.component).copied().unwrap_or("φ")
    }
}

impl fmt::Display for Contradiction {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} is {:.1} σ from what tracked corners show: {}", self.symbol(), self.sigmas, self.cause)
    }
}

/// Where an answer lies too far from that of tracked `corners`; `None` where it does not.
pub fn contradiction(
    found: &MotionEstimate,
    corners: &MotionEstimate,
    observed: &Observed<'_>,
    interval: &Interval<'_>,
) -> Option<Contradiction> {
    let off = |i: usize| {
        let variance = found.theta.cov[(i, i)] + corners.theta.cov[(i, i)];
        (found.theta.mean[i] - corners.theta.mean[i]).abs() / variance.sqrt()
    };
    let known = (0..6).filter(|&i| found.observed[i] && corners.observed[i]);
    let (component, sigmas) = known.map(|i| (i, off(i))).max_by(|a, b| a.1.total_cmp(&b.1))?;
    (sigmas > CONTRADICTING_SIGMAS).then(|| Contradiction {
        component,
        found: found.theta.mean[component],
        expected: corners.theta.mean[component],
        sigmas,
        cause: cause(&corners.phi_or_zero(), observed, interval),
    })
}

/// What observations of a motion show that a method takes for granted.
fn cause(phi: &Twist, observed: &Observed<'_>, interval: &Interval<'_>) -> BiasCause {
    if interval.plan.equations == Equations::DepthChange {
        let share = noise_share(&observed.depth_changes(interval), phi, interval.rig.focal_px);
        if share > NOISY_SHARE {
            return BiasCause::NoisyGradients { share };
        }
    }
    let tracks = observed.tracks(interval);
    let moved = |track: &StereoTrack| (track.after.mean - track.before.mean).xy().norm();
    let pixels = median(&mut tracks.iter().map(moved).collect::<Vec<f64>>());
    if interval.plan.equations == Equations::DepthChange && pixels > FAR_PX {
        return BiasCause::LongDisplacement { pixels };
    }
    if interval.plan.approach == Approach::Discrete {
        return BiasCause::Unknown;
    }
    let depth = |track: &StereoTrack| interval.rig.depth(track.before.mean.z);
    let share = phi.t.z.abs() / median(&mut tracks.iter().filter_map(depth).collect::<Vec<f64>>());
    if share > FAST_SHARE { BiasCause::FastApproach { share } } else { BiasCause::Unknown }
}

/// By how much of its squared effect on the rows of (11), in units of disparity, a motion's is that of their noise.
///
/// Where residuals are smaller than their stated σ, so is the noise.
fn noise_share(changes: &[DepthChange], phi: &Twist, focal_px: f64) -> f64 {
    let vector = phi.vector();
    let (mut noise, mut square) = (0.0, 0.0);
    let mut residuals = Vec::with_capacity(changes.len());
    for change in changes {
        let weight = change.depth.mean[0].powi(-4);
        let constraint = dcce::constraint(change, focal_px, phi);
        let own = dcce::row_noise(change, focal_px);
        noise += weight * vector.dot(&(own.fixed_view::<6, 6>(0, 0) * vector));
        square += weight * constraint.row().dot(&vector).powi(2);
        residuals.push((constraint.residual(phi) / constraint.sigma).abs());
    }
    let scale = SIGMA_PER_MEDIAN_DEVIATION * median(&mut residuals);
    noise / square * noise_factor(scale)
}
