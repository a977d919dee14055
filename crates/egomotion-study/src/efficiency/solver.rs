//! φ by any contender from one draw, each started at the same robust motion.

use nalgebra::Vector3;

use crate::synthetic::{Contender, DifferentialDraw, DiscreteDraw};
use egomotion::estimate::robust_start;
use egomotion::estimate::{MaximumLikelihoodOptions, maximum_likelihood};
use egomotion::estimate::{MotionEstimate, Unsolvable};
use egomotion::geometry::{Gaussian, StereoRig, Twist};
use egomotion::observe::{StereoFlow, StereoTrack};
use egomotion::pipeline::{Config, Method};

/// Side of the blocks within which the errors of rows count as correlated, in pixels.
///
/// Points are drawn one by one, so that two of them are hardly ever neighbours, and blocks need not hold many. Larger
/// blocks leave fewer of them, and so a less certain covariance.
const BLOCK_PX: f64 = 8.0;

/// φ by a contender from measurements of either form.
pub(super) type ContenderSolver<'a> = Box<dyn Fn(&Contender) -> Result<MotionEstimate, Unsolvable> + 'a>;

/// The contender's configuration, with blocks for points instead of pixels.
fn config(contender: &Contender, seed: u64) -> Config {
    Config { block_px: BLOCK_PX, ..contender.config(seed) }
}

/// Contenders on velocities; all start from the same robust motion.
pub(super) fn by_velocities<'a>(
    draw: DifferentialDraw<'static>,
    rig: &'a StereoRig,
    seed: u64,
) -> ContenderSolver<'a> {
    let tracks: Vec<StereoTrack> = draw.complete.iter().map(as_displacement).collect();
    let start = start(&tracks, rig, seed);
    Box::new(move |contender| {
        let config = config(contender, seed);
        if contender.method == Method::Ml {
            // Single points have no blocks.
            let kernel = &config.maximum_likelihood.kernel;
            return Ok(maximum_likelihood(&draw.complete, rig, &start, None, kernel)?.motion);
        }
        contender.differential(&draw, rig, &start, &config)
    })
}

/// Contenders on displacements; all start from the same robust motion.
pub(super) fn by_displacements<'a>(
    draw: DiscreteDraw<'static>,
    rig: &'a StereoRig,
    seed: u64,
) -> ContenderSolver<'a> {
    let start = start(&draw.complete, rig, seed);
    Box::new(move |contender| {
        let config = config(contender, seed);
        if contender.method == Method::Ml {
            // Single points have no blocks.
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
