//! Poses from frame-to-frame motions; every frame gets one.

use crate::geometry::{RigidMotion, Twist};

use super::answer::FrameMotion;

/// Camera poses world_from_camera, the first the identity, one for each frame.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Trajectory {
    poses: Vec<RigidMotion>,
    times_s: Vec<f64>,
    /// The last frame with an answer, and its velocity per second.
    answered: Option<(usize, Twist)>,
}

impl Trajectory {
    /// No poses yet.
    pub fn new() -> Self {
        Self::default()
    }

    /// Append the next frame.
    ///
    /// Without an answer the camera is taken to stand still, until a later frame bridges the gap: then
    /// the poses between are interpolated in time at constant φ. A gap that no frame bridges (the next answer
    /// begins after it) is passed at the mean of the velocities before and after.
    pub fn push(&mut self, answer: &FrameMotion) {
        let last = self.poses.last().copied().unwrap_or_else(RigidMotion::identity);
        self.poses.push(last);
        self.times_s.push(answer.time_s);
        let (Ok(motion), Some(reference), Some(dt)) = (&answer.motion, answer.reference, answer.dt_s) else {
            return;
        };
        let velocity = motion.phi_or_zero().scaled(1.0 / dt);
        let last = self.poses.len() - 1;
        if let Some((from, before)) = self.answered.filter(|(from, _)| *from < reference) {
            let mean = Twist::from_vector(&(0.5 * (before.vector() + velocity.vector())));
            let (start, start_s) = (self.poses[from], self.times_s[from]);
            for k in from + 1..=reference {
                let gone_s = self.times_s[k] - start_s;
                let gone_s = if gone_s.is_finite() { gone_s.max(0.0) } else { 0.0 };
                self.poses[k] = start.after(&mean.scaled(gone_s).exp().inverse());
            }
        }
        self.answered = Some((last, velocity));
        let (start, start_s) = (self.poses[reference], self.times_s[reference]);
        for k in reference + 1..self.poses.len() {
            // Frames without an answer may have any time, or none: they stay between their neighbours.
            let share = (self.times_s[k] - start_s) / dt;
            let share = if share.is_nan() { 0.0 } else { share.clamp(0.0, 1.0) };
            // The scene moves by exp(φ), so the camera by its inverse.
            self.poses[k] = start.after(&motion.phi_or_zero().scaled(share).exp().inverse());
        }
    }

    /// The poses world_from_camera.
    pub fn poses(&self) -> &[RigidMotion] {
        &self.poses
    }

    /// The times, in seconds.
    pub fn times_s(&self) -> &[f64] {
        &self.times_s
    }
}
