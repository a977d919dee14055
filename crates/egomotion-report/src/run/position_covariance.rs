//! How sure the camera's position is: the covariances of φ, added up along the path.

use egomotion::geometry::RigidMotion;
use nalgebra::{Matrix3, Matrix6};

use super::report::Report;

/// Covariance of the position in m² at every pose, added up from those of φ; `None` from where it is unknown.
///
/// With T' = T exp(φ)⁻¹ and φ = φ̂ + δ the error of the pose, seen from the world, grows by −Ad(T') J δ.
pub(crate) fn covariances(report: &Report<'_>) -> Vec<Option<Matrix3<f64>>> {
    let mut sum = Some(Matrix6::<f64>::zeros());
    let mut answered_s = None;
    let mut all: Vec<Option<Matrix3<f64>>> = Vec::new();
    for (row, pose) in report.frames.iter().zip(report.poses) {
        let last_s: &mut Option<f64> = &mut answered_s;
        if let (Some(motion), Some(dt)) = (&row.motion, row.dt_s) {
            // An interval that does not reach back to the last answer leaves a gap of unknown motion.
            let whole = last_s.is_none_or(|last| row.time_s - dt <= last + 1e-6 * dt.abs().max(1e-3));
            let known = whole && motion.theta.cov.iter().all(|v| v.is_finite());
            let phi = motion.phi_or_zero();
            let by_phi = adjoint(pose) * phi.left_jacobian();
            sum = sum.filter(|_| known).map(|s| s + by_phi * motion.theta.cov * by_phi.transpose());
        }
        if row.motion.is_some() || !row.asks() || last_s.is_none() {
            *last_s = Some(row.time_s);
        }
        all.push(sum.map(|s| {
            let by_pose = RigidMotion::point_jacobian(&pose.translation);
            by_pose * s * by_pose.transpose()
        }));
    }
    all
}

/// Ad(T): a small motion (t, Ω) in the camera's frame, seen from the world.
fn adjoint(pose: &RigidMotion) -> Matrix6<f64> {
    let mut ad = Matrix6::zeros();
    ad.fixed_view_mut::<3, 3>(0, 0).copy_from(&pose.rotation);
    ad.fixed_view_mut::<3, 3>(3, 3).copy_from(&pose.rotation);
    ad.fixed_view_mut::<3, 3>(0, 3).copy_from(&(pose.translation.cross_matrix() * pose.rotation));
    ad
}

#[cfg(test)]
pub mod tests {
    use egomotion::geometry::Twist;
    use nalgebra::Vector6;

    use super::super::album::Album;
    use super::super::tests::{Run, motion};
    use super::*;

    /// Poses from motions, as the trajectory is built.
    pub fn poses(phis: &[Vector6<f64>]) -> Vec<RigidMotion> {
        let mut all = vec![RigidMotion::identity()];
        for phi in phis {
            let last = all[all.len() - 1];
            all.push(last.after(&Twist::from_vector(phi).exp().inverse()));
        }
        all
    }

    #[test]
    fn covariance_of_the_position_is_that_of_differences() {
        let mut phis: Vec<Vector6<f64>> = (0..5)
            .map(|k| Vector6::new(0.1, -0.05, -0.4, 0.02, 0.3, -0.1) * (1.0 + 0.3 * f64::from(k)))
            .collect();
        let mut run = Run::of(&phis);
        let cov = Matrix6::from_fn(|i, j| if i == j { 1e-4 * (1 + i) as f64 } else { 2e-5 });
        for row in &mut run.rows {
            if let Some(estimate) = &mut row.motion {
                estimate.theta.cov = cov;
            }
        }
        run.poses = poses(&phis);
        let found = covariances(&run.report(&Album::of(9))).last().copied().flatten().unwrap();
        let mut expected = Matrix3::zeros();
        for k in 0..phis.len() {
            let mut jacobian = nalgebra::SMatrix::<f64, 3, 6>::zeros();
            for c in 0..6 {
                let mut at = |step: f64| {
                    phis[k][c] += step;
                    let end = poses(&phis)[phis.len()].translation;
                    phis[k][c] -= step;
                    end
                };
                jacobian.set_column(c, &((at(1e-6) - at(-1e-6)) / 2e-6));
            }
            expected += jacobian * cov * jacobian.transpose();
        }
        assert!((found - expected).norm() < 1e-6 * expected.norm(), "{found} {expected}");
    }

    #[test]
    fn a_gap_that_no_interval_bridges_ends_the_ellipses() {
        let phis = vec![Vector6::new(0.0, 0.0, -0.1, 0.0, 0.0, 0.0); 4];
        let mut run = Run::of(&phis);
        run.rows[2].motion = None;
        run.rows[2].status = "few_rows".into();
        let known = |run: &Run| {
            covariances(&run.report(&Album::of(9))).iter().map(Option::is_some).collect::<Vec<_>>()
        };
        assert_eq!(known(&run), [true, true, true, false, false]);
        run.rows[3].dt_s = Some(0.2);
        assert_eq!(known(&run), [true; 5]);
        run.rows[4].motion = Some(motion(&phis[0], f64::INFINITY));
        assert_eq!(known(&run), [true, true, true, true, false]);
    }
}
