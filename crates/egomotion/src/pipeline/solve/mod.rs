//! φ of a pair of frames from what was observed of it.

mod contradiction;
mod first_motion;
mod observed;
mod scene_motion;
mod shape;
mod solver;
mod whole;

pub use contradiction::{BiasCause, Contradiction, contradiction};
pub(super) use first_motion::{first_motion, refined_motion};
pub use observed::Observed;
pub use solver::Solver;
pub(super) use whole::{PairMotion, whole_motion};

use super::plan::{Equations, Interval};
use crate::estimate::{MotionEstimate, SolvedMotion, Unsolvable};
use crate::geometry::Twist;

/// φ over an interval by its planned equations, with the covariance of what is new in it; rows and robust weights start from `start`, or from rest.
///
/// # Errors
/// [`Unsolvable`] when the observations do not determine a motion.
pub fn solve(
    observed: &Observed<'_>,
    interval: &Interval<'_>,
    start: Option<&Twist>,
) -> Result<SolvedMotion, Unsolvable> {
    let rest = Twist::zero();
    let solver =
        Solver::new(interval.rig, start.unwrap_or(&rest), interval.config).with_tolerance(interval.dt_s);
    let linear = |found: Result<MotionEstimate, Unsolvable>| found.map(SolvedMotion::from);
    let found = match (interval.plan.equations, observed) {
        (Equations::ShapeLikelihood, Observed::Fields(pair, corners)) => {
            shape::solve_with_shape(pair, corners, start, interval)
        }
        (Equations::TrackLikelihood | Equations::ShapeLikelihood, _) => {
            solver.sensor_likelihood(&observed.tracks(interval), interval.plan.source)
        }
        (Equations::FlowLikelihood, _) => solver.likelihood(&observed.flows(interval)),
        (Equations::DepthChange, _) => {
            linear(solver.depth_change_beyond_noise(&observed.depth_changes(interval)))
        }
        (Equations::BinocularFlow, _) => linear(solver.binocular(&observed.flows(interval))),
        (Equations::BinocularDisplacement, _) => {
            linear(solver.binocular_displacement(&observed.tracks(interval)))
        }
        (Equations::JointFlow, _) => linear(solver.joint(&observed.flows(interval))),
        (Equations::JointDisplacement, _) => linear(solver.joint_displacement(&observed.tracks(interval))),
        (Equations::Alignment(form), _) => linear(solver.alignment(&observed.tracks(interval), form)),
    };
    let found = found?;
    Ok(SolvedMotion { motion: found.motion.with_unbounded_unobserved()?, ..found })
}
