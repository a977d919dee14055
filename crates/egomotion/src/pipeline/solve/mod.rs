//! φ of a pair of frames from what was observed of it.

mod contradiction;
mod first_motion;
mod observed;
mod scene_motion;
mod shape;
mod solver;

pub use contradiction::{BiasCause, Contradiction, contradiction};
pub(super) use first_motion::{first_motion, refined_motion};
pub use observed::Observed;
pub use solver::Solver;

use super::plan::{Equations, Interval};
use crate::estimate::{MotionEstimate, Unsolvable};
use crate::geometry::Twist;

/// φ over an interval by its planned equations; rows and robust weights start from `start`, or from rest.
///
/// # Errors
/// [`Unsolvable`] when the observations do not determine a motion.
pub fn solve(
    observed: &Observed<'_>,
    interval: &Interval<'_>,
    start: Option<&Twist>,
) -> Result<MotionEstimate, Unsolvable> {
    let rest = Twist::zero();
    let solver =
        Solver::new(interval.rig, start.unwrap_or(&rest), interval.config).with_tolerance(interval.dt_s);
    let found = match (interval.plan.equations, observed) {
        (Equations::ShapeLikelihood, Observed::Fields(pair, corners)) => {
            shape::solve_with_shape(pair, corners, start, interval)
        }
        (Equations::TrackLikelihood | Equations::ShapeLikelihood, _) => {
            solver.sensor_likelihood(&observed.tracks(interval), interval.plan.source)
        }
        (Equations::FlowLikelihood, _) => solver.likelihood(&observed.flows(interval)),
        (Equations::DepthChange, _) => solver.depth_change_beyond_noise(&observed.depth_changes(interval)),
        (Equations::BinocularFlow, _) => solver.binocular(&observed.flows(interval)),
        (Equations::BinocularDisplacement, _) => solver.binocular_displacement(&observed.tracks(interval)),
        (Equations::JointFlow, _) => solver.joint(&observed.flows(interval)),
        (Equations::JointDisplacement, _) => solver.joint_displacement(&observed.tracks(interval)),
        (Equations::Alignment(form), _) => solver.alignment(&observed.tracks(interval), form),
    };
    found?.with_unbounded_unobserved()
}
