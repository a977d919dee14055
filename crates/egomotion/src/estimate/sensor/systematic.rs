//! Errors that all observations of a frame share, which no number of observations averages out.
//!
//! Two are named: a *phase error*, by which interpolation and noise shift every match by an amount that
//! depends on the fraction of a pixel of its displacement, like a sine, and an unknown *offset of disparity*,
//! by which the rig's calibration is wrong. Where all points move alike the phase error is common to all;
//! where displacements differ by pixels it averages out. The effect of either on φ̂ follows from the normal
//! equations: δφ = A⁻¹ Σ Gᵀ S⁻¹ δe.

use nalgebra::{Matrix6, SMatrix, Vector3, Vector6};

use crate::estimate::Observability;
use crate::estimate::likelihood::mixture::Mixture;
use crate::estimate::likelihood::step::{Step, Sums, Weighing};
use crate::estimate::linear::m_estimator::StudentT;
use crate::estimate::measurement::{At, Measurement, squares};
use crate::geometry::{StereoRig, Twist};

/// How φ̂ answers to errors common to all observations.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CommonErrors {
    /// φ̂ per pixel of the phase error's amplitude in x, in y and in disparity (of flows, the right camera's x), 6×3.
    pub by_phase: SMatrix<f64, 6, 3>,
    /// φ̂ per pixel by which every disparity is too large, before and after.
    pub by_disparity_offset: Vector6<f64>,
}

impl CommonErrors {
    /// δφ = A⁻¹ Σ Gᵀ S⁻¹ δe; `None` where some direction is not determined.
    pub(crate) fn of(step: &Step) -> Option<Self> {
        let information = &step.score.information;
        let observability = Observability::of(information).ok()?;
        let complete = observability.observed::<6>().iter().all(|&o| o);
        let solved = information.cholesky()?.solve(&step.shared);
        complete.then(|| Self {
            by_phase: solved.fixed_view::<6, 3>(0, 0).into(),
            by_disparity_offset: solved.fixed_view::<6, 1>(0, 3).into(),
        })
    }

    /// Covariance of φ that a phase error adds whose three amplitudes have the standard deviation `sigma_px`.
    pub fn phase_covariance(&self, sigma_px: f64) -> Matrix6<f64> {
        sigma_px * sigma_px * self.by_phase * self.by_phase.transpose()
    }
}

/// The response of the maximum-likelihood estimate at φ, with the structure as measured; `None` where some direction is not determined.
pub fn common_errors<M: Measurement>(
    observations: &[M],
    rig: &StereoRig,
    phi: &Twist,
    kernel: &StudentT,
) -> Option<CommonErrors> {
    let at = At::new(*phi, rig);
    let (mixture, scale2) = Mixture::of(kernel, &mut squares(observations, &at))?;
    let mut structures: Vec<Vector3<f64>> = observations.iter().map(Measurement::structure).collect();
    let weighing = Weighing { blocks: None, mixture, scale2 };
    CommonErrors::of(&Sums::over(observations, &mut structures, &at, &weighing).whole)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::estimate::likelihood::maximum_likelihood::maximum_likelihood;
    use crate::estimate::measurement::wave;
    use crate::geometry::Gaussian;
    use crate::observe::StereoTrack;

    fn tracks(rig: &StereoRig, phi: &Twist, amplitude: Vector3<f64>, offset: f64) -> Vec<StereoTrack> {
        let variances = [0.01, 0.01, 0.02];
        let place = |i: usize| {
            let (a, b, c) = ((i * 37 % 200) as f64, (i * 53 % 150) as f64, (i * 17 % 31) as f64);
            Vector3::new(a - 100.0, b - 75.0, 8.0 + c)
        };
        let moved = |xyd: &Vector3<f64>| rig.project(&phi.exp().apply(&rig.point(xyd).unwrap())).unwrap();
        let d = Vector3::new(0.0, 0.0, offset);
        let seen = |i: usize| {
            let (before, after) = (place(i), moved(&place(i)));
            let moved = (after - before).xy().map(wave);
            let phase = Vector3::new(moved.x, moved.y, wave(after.z)).component_mul(&amplitude);
            (before + Vector3::z() * amplitude.z * wave(before.z) + d, after + phase + d)
        };
        let track = |(before, after): (Vector3<f64>, Vector3<f64>)| StereoTrack {
            before: Gaussian::independent(before.into(), [0.0, 0.0, 0.02]),
            after: Gaussian::independent(after.into(), variances),
        };
        (0..120).map(|i| track(seen(i))).collect()
    }

    #[test]
    fn the_response_is_what_the_estimator_does() {
        let rig = StereoRig::new(400.0, (159.5, 119.5), 0.15, (320, 240)).unwrap();
        let phi = Twist { t: Vector3::new(0.02, -0.01, -0.2), omega: Vector3::new(0.004, -0.006, 0.002) };
        let kernel = StudentT { nu: f64::INFINITY, iterations: 50, tolerance: 1e-10, ..StudentT::default() };
        let solve = |amplitude, offset| {
            let tracks = tracks(&rig, &phi, amplitude, offset);
            maximum_likelihood(&tracks, &rig, &phi, None, &kernel).unwrap().motion.theta.mean - phi.vector()
        };
        let exact = tracks(&rig, &phi, Vector3::zeros(), 0.0);
        let found = common_errors(&exact, &rig, &phi, &kernel).unwrap();
        let scale = found.by_disparity_offset.amax();
        for k in 0..3 {
            let error = solve(Vector3::ith(k, 1e-3), 0.0) / 1e-3 - found.by_phase.column(k);
            assert!(error.amax() < 2e-3 * found.by_phase.column(k).amax(), "{k} {error}");
        }
        let error = solve(Vector3::zeros(), 1e-3) / 1e-3 - found.by_disparity_offset;
        assert!(error.amax() < 2e-3 * scale, "{error} {scale}");
    }
}
