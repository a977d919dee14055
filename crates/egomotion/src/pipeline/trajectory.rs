//! Poses from frame-to-frame motions, and the uncertainty of any pose relative to any other; every frame gets one.
//!
//! A pose T_k = world_from_camera goes on by the inverse of the scene's motion, T_k = T_{k−1} exp(φ_k)⁻¹. With its error
//! on the right, T = T̂ exp(δ), and ε = J dφ that of a motion, δ_k = Ad(exp φ_k) δ_{k−1} − ε_k. The errors ε of
//! neighbouring pairs share the noise of a frame, and all share the systematic errors of matching and the errors of the rig.

use nalgebra::{Matrix6, SMatrix, Vector6};

use super::answer::FrameMotion;
use crate::estimate::{CovarianceParts, MATCHING_ERRORS};
use crate::geometry::{RIG_ERRORS, RigErrors, RigidMotion, Twist};

/// Camera poses world_from_camera, the first the identity, one for each frame.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Trajectory {
    poses: Vec<RigidMotion>,
    times_s: Vec<f64>,
    /// What was measured, in the order of time.
    steps: Vec<Step>,
    /// The velocity per second of the last answer.
    velocity: Option<Twist>,
    /// How much velocities change, over all answers.
    changes: VelocityChanges,
    /// Standard deviations of the rig's errors, as the last frame knows them.
    rig_sigma: RigErrors,
}

/// A pose relative to another one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RelativePose {
    /// first_from_second.
    pub pose: RigidMotion,
    /// Covariance of δ in T = T̂ exp(δ), (translation, rotation) in metres and radians, 6×6; where nothing is known, all
    /// variances are infinite.
    pub cov: Matrix6<f64>,
}

/// A measured motion between two frames.
#[derive(Debug, Clone, PartialEq)]
struct Step {
    from: usize,
    to: usize,
    /// How long it took, in seconds.
    dt_s: f64,
    phi: Twist,
    /// The parts of its covariance; `None` where a component is not known.
    parts: Option<CovarianceParts>,
}

/// A part of a step, from one share of its time to another one.
struct Segment<'a> {
    step: &'a Step,
    from: f64,
    to: f64,
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
        let (Ok(motion), Some(reference), Some(dt_s)) = (&answer.motion, answer.reference, answer.dt_s)
        else {
            return;
        };
        let phi = motion.phi_or_zero();
        let velocity = phi.scaled(1.0 / dt_s);
        let from = self.steps.last().map_or(0, |step| step.to);
        if let Some(before) = self.velocity {
            if from < reference {
                self.pass_gap(from, reference, &before, &velocity);
            }
            self.changes.add(&before, &velocity, dt_s);
        }
        self.velocity = Some(velocity);
        self.rig_sigma = answer.rig_sigma;
        let step = Step {
            from: reference,
            to: self.poses.len() - 1,
            dt_s,
            phi,
            parts: answer.parts.filter(|_| motion.is_complete()),
        };
        for k in step.from + 1..=step.to {
            let share = self.share(&step, k);
            self.poses[k] = self.poses[step.from].after(&step.phi.scaled(share).exp().inverse());
        }
        self.steps.push(step);
    }

    /// The poses from the frame `from` to `to`, between which nothing was measured.
    fn pass_gap(&mut self, from: usize, to: usize, before: &Twist, after: &Twist) {
        let mean = Twist::from_vector(&(0.5 * (before.vector() + after.vector())));
        let (start, start_s) = (self.poses[from], self.times_s[from]);
        for k in from + 1..=to {
            let gone_s = self.times_s[k] - start_s;
            let gone_s = if gone_s.is_finite() { gone_s.max(0.0) } else { 0.0 };
            self.poses[k] = start.after(&mean.scaled(gone_s).exp().inverse());
        }
    }

    /// What share of a step's time has gone at a frame.
    ///
    /// Frames without an answer may have any time, or none: they stay between their neighbours.
    fn share(&self, step: &Step, frame: usize) -> f64 {
        let share = (self.times_s[frame] - self.times_s[step.from]) / step.dt_s;
        if share.is_nan() { 0.0 } else { share.clamp(0.0, 1.0) }
    }

    /// The poses world_from_camera.
    pub fn poses(&self) -> &[RigidMotion] {
        &self.poses
    }

    /// The times, in seconds.
    pub fn times_s(&self) -> &[f64] {
        &self.times_s
    }

    /// The pose of the frame `j` relative to that of the frame `i`, i_from_j, with its covariance; `None` where there is
    /// no such frame.
    pub fn relative(&self, i: usize, j: usize) -> Option<RelativePose> {
        let (first, second) = (i.min(j), i.max(j));
        let pose = self.poses.get(first)?.inverse().after(self.poses.get(second)?);
        let cov = self.covariances_from(first).nth(second - first)?;
        let relative = RelativePose { pose, cov };
        Some(if i <= j { relative } else { relative.inverse() })
    }

    /// The covariance of each pose from the frame `first` on relative to that frame's, as that of [`RelativePose`].
    pub fn covariances_from(&self, first: usize) -> impl Iterator<Item = Matrix6<f64>> {
        let mut next = self.steps.partition_point(|step| step.to <= first);
        let mut chain = Some(Chain { at: first, ..Chain::default() });
        let further = move |chain: &Chain, step: &Step, to: usize| {
            let reached = step.from.max(first);
            let segment = Segment { step, from: self.share(step, reached), to: self.share(step, to) };
            if chain.at == reached { chain.then(&segment, to, &self.changes) } else { None }
        };
        (first..self.poses.len()).map(move |k| {
            while let Some(step) = self.steps.get(next).filter(|step| step.to <= k) {
                chain = chain.as_ref().and_then(|chain| further(chain, step, step.to));
                next += 1;
            }
            let inside = self.steps.get(next).filter(|step| step.from < k && k > first);
            let here = match inside {
                Some(step) => chain.as_ref().and_then(|chain| further(chain, step, k)),
                None => chain.clone().filter(|chain| chain.at == k),
            };
            here.map_or_else(unknown, |chain| chain.covariance(&self.rig_sigma))
        })
    }
}

/// The covariance of a pose of which nothing is known.
fn unknown() -> Matrix6<f64> {
    Matrix6::from_diagonal_element(f64::INFINITY)
}

impl RelativePose {
    /// The first pose relative to the second.
    fn inverse(&self) -> Self {
        // (T exp(δ))⁻¹ = T⁻¹ exp(−Ad(T) δ).
        let across = self.pose.adjoint();
        let known = self.cov.iter().all(|v| v.is_finite());
        let cov = if known { across * self.cov * across.transpose() } else { self.cov };
        Self { pose: self.pose.inverse(), cov }
    }
}

/// The error δ of a pose, as far as the steps lead to it.
#[derive(Debug, Clone, Default)]
struct Chain {
    /// The frame where it ends.
    at: usize,
    /// What is new in the steps.
    own: Matrix6<f64>,
    /// ∂δ/∂(errors of the rig).
    by_rig: SMatrix<f64, 6, RIG_ERRORS>,
    /// δ by one standard deviation of each systematic error of matching.
    by_matching: SMatrix<f64, 6, MATCHING_ERRORS>,
    /// ε of the last step by its φ; zero before the first.
    last_jacobian: Matrix6<f64>,
}

impl Chain {
    /// One segment further, to the frame `at`; `None` where its step is not known completely.
    fn then(&self, segment: &Segment<'_>, at: usize, changes: &VelocityChanges) -> Option<Self> {
        let Segment { step, from, to } = segment;
        let parts = step.parts.as_ref()?;
        let share = to - from;
        let moved = step.phi.scaled(share);
        let (across, jacobian) = (moved.exp().adjoint(), moved.left_jacobian() * share);
        let cross = across * self.last_jacobian * parts.with_previous * jacobian.transpose();
        let mut own = across * self.own * across.transpose() + cross + cross.transpose();
        own += jacobian * parts.own * jacobian.transpose();
        own += changes.interpolation(step.dt_s, *from) + changes.interpolation(step.dt_s, *to);
        Some(Self {
            at,
            own,
            by_rig: across * self.by_rig - jacobian * parts.phi_per_rig_error,
            by_matching: across * self.by_matching - jacobian * parts.phi_per_matching_sigma,
            last_jacobian: jacobian,
        })
    }

    /// The whole covariance.
    fn covariance(&self, rig_sigma: &RigErrors) -> Matrix6<f64> {
        let by_sigma = self.by_rig * SMatrix::from_diagonal(&rig_sigma.vector());
        self.own + self.by_matching * self.by_matching.transpose() + by_sigma * by_sigma.transpose()
    }
}

/// How much the velocity changes from one answer to the next.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
struct VelocityChanges {
    /// Σ (change of velocity)²/Δt, in the squared units of φ per s³.
    squares: Vector6<f64>,
    count: usize,
}

impl VelocityChanges {
    fn add(&mut self, before: &Twist, after: &Twist, dt_s: f64) {
        let change = after.vector() - before.vector();
        self.squares += change.component_mul(&change) / dt_s;
        self.count += 1;
    }

    /// Covariance of a pose that is interpolated at a share of a step: where the velocity changes by Δv on the way, a pose
    /// at constant velocity is off by Δv Δt s (1 − s)/2.
    fn interpolation(&self, dt_s: f64, share: f64) -> Matrix6<f64> {
        let arc = 0.5 * share * (1.0 - share);
        let change2 = self.squares / self.count.max(1) as f64 * dt_s;
        Matrix6::from_diagonal(&(change2 * (dt_s * arc).powi(2)))
    }
}
