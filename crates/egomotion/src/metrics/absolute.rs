//! Absolute errors of a trajectory, after it was laid over the truth.

use std::iter::zip;

use nalgebra::{Matrix3, Vector3};

use crate::geometry::RigidMotion;

/// What may be changed of a trajectory before its positions are compared with the truth.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TrajectoryAlignment {
    /// Nothing.
    None,
    /// Where it begins and how it is turned.
    Se3,
    /// Also its scale.
    Sim3,
}

impl TrajectoryAlignment {
    /// Its name in files and options.
    pub fn name(self) -> &'static str {
        match self {
            Self::None => "none",
            Self::Se3 => "se3",
            Self::Sim3 => "sim3",
        }
    }
}

/// A rigid motion with a scale: p ↦ scale · rotation · p + translation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Similarity {
    /// Factor of all lengths.
    pub scale: f64,
    /// The rigid motion; its translation, in metres, is not scaled.
    pub motion: RigidMotion,
}

impl Similarity {
    /// The pose moved into the other world, its distances scaled.
    pub fn apply(&self, pose: &RigidMotion) -> RigidMotion {
        let translation = self.motion.rotation * pose.translation * self.scale + self.motion.translation;
        RigidMotion { rotation: self.motion.rotation * pose.rotation, translation }
    }
}

/// What lays the positions of an estimate over those of the truth with the least squares (Umeyama 1991, eq. 39 – 43).
///
/// Where one list is longer its tail is ignored. `None` where the positions do not determine it: fewer than three, or
/// all on a line.
pub fn align(
    estimate: &[RigidMotion],
    truth: &[RigidMotion],
    alignment: TrajectoryAlignment,
) -> Option<Similarity> {
    if alignment == TrajectoryAlignment::None {
        return Some(Similarity { scale: 1.0, motion: RigidMotion::identity() });
    }
    let n = estimate.len().min(truth.len());
    let mean =
        |poses: &[RigidMotion]| poses[..n].iter().map(|p| p.translation).sum::<Vector3<f64>>() / n as f64;
    let (from, to) = (mean(estimate), mean(truth));
    let mut cov = Matrix3::zeros();
    let mut variance = 0.0;
    for (e, t) in zip(estimate, truth) {
        let (e, t) = (e.translation - from, t.translation - to);
        cov += t * e.transpose() / n as f64;
        variance += e.norm_squared() / n as f64;
    }
    let svd = cov.svd(true, true);
    let (u, v_t, d) = (svd.u?, svd.v_t?, svd.singular_values);
    // Nothing that is not a number either.
    let spread = d[1] > f64::EPSILON * d[0].max(1.0);
    if !spread {
        return None;
    }
    // A reflection is no rotation: then the least singular direction is turned over.
    let sign = if u.determinant() * v_t.determinant() < 0.0 { -1.0 } else { 1.0 };
    let signs = Vector3::new(1.0, 1.0, sign);
    let rotation = u * Matrix3::from_diagonal(&signs) * v_t;
    let scale = if alignment == TrajectoryAlignment::Sim3 { d.dot(&signs) / variance } else { 1.0 };
    Some(Similarity { scale, motion: RigidMotion { rotation, translation: to - rotation * from * scale } })
}

/// Distance of each pose from the truth, in metres; where one list is longer its tail is ignored.
pub fn absolute_errors_m(estimate: &[RigidMotion], truth: &[RigidMotion]) -> Vec<f64> {
    zip(estimate, truth).map(|(e, t)| (e.translation - t.translation).norm()).collect()
}
