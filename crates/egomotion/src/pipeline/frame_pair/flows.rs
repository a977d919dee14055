//! Dense flow of one or of both cameras between two frames.

use super::FramePair;
use crate::geometry::Twist;
use crate::observe::flow::{FlowPair, FlowSpace, Side, rigid_flow};
use crate::observe::{DisparityMap, FlowField, FlowOptions};

/// Flow of the left camera, and of the right one where the method needs it.
pub(super) struct Flows {
    pub(super) left: FlowField,
    pub(super) right: Option<FlowField>,
}

impl FramePair<'_> {
    /// The flows, predicted by `motion`; `None` where disparity or flow is missing as a whole.
    pub(super) fn flows(&self, motion: Option<&Twist>, space: &mut FlowSpace) -> Option<Flows> {
        let (disparity, _) = self.before.disparity.as_ref().zip(self.after.disparity.as_ref())?;
        let left = match self.given_flow() {
            Some(given) => Some(given.clone()),
            None => self.flow(Side::Left, disparity, motion, space),
        };
        let right = self.interval.plan.right_flow.then(|| self.flow(Side::Right, disparity, motion, space));
        Some(Flows { left: left?, right: right.flatten() })
    }

    /// Flow that was given with the earlier frame, if it leads to this later one.
    fn given_flow(&self) -> Option<&FlowField> {
        self.before.flow.as_ref().filter(|_| self.after.frame == self.before.frame + 1)
    }

    /// Flow of one camera. Guesses where nothing is measured count for the left one only, for the right one's is read
    /// between its pixels.
    fn flow(
        &self,
        side: Side,
        disparity: &DisparityMap,
        motion: Option<&Twist>,
        space: &mut FlowSpace,
    ) -> Option<FlowField> {
        let (before, after) = self.images();
        let (from, to, spline) = match side {
            Side::Left => (&before.left, &after.left, &after.left_spline),
            Side::Right => (&before.right, &after.right, &after.right_spline),
        };
        let (rig, options) = (self.interval.rig, &self.interval.config.flow);
        let initial = motion.map(|motion| rigid_flow(disparity, rig, motion, side));
        let options = FlowOptions { fill: options.fill && side == Side::Left, ..options.clone() };
        FlowPair { from, to, to_spline: Some(spline) }.flow(initial.as_ref(), &options, space).ok()
    }
}
