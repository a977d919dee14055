//! Systematic errors: those that all observations of a frame share, which no number of observations averages out.
//!
//! Three kinds are known: a *phase error*, by which interpolation and noise shift every match by an amount that
//! depends on the fraction of a pixel of its displacement, like a sine; a *field error*, an offset of all matches in a block of the image, which its geometry causes and not its
//! noise; and the *errors of the rig* ([`RigErrors`](crate::geometry::RigErrors)).
//! Where all points move alike the phase error is common to all; where displacements differ by pixels it averages out.
//! The effect of each on φ̂ follows from the normal equations: δφ = A⁻¹ Σ w Gᵀ S⁻¹ δe.

use std::collections::BTreeMap;

use nalgebra::{Matrix6, SMatrix};
use rayon::prelude::*;

use super::mixture::ResidualModel;
use super::score_sums::squares;
use crate::constrain::{LinearisationPoint, Measurement};
use crate::estimate::certainty::blocks::Blocks;
use crate::estimate::certainty::observability::Observability;
use crate::estimate::student_t::StudentT;
use crate::geometry::gaussian::product;
use crate::geometry::{RIG_ERRORS, StereoRig, Twist};

/// About this many observations tell the response: it is a mean over them, which more would change by a percent.
const OBSERVATIONS: usize = 2048;
/// Observations handled by one task; fixed, so that sums do not depend on the number of threads.
const STRIP: usize = 256;

/// How φ̂ answers to systematic errors, those that all observations of a frame share.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SystematicResponse {
    /// φ̂ per pixel of the phase error's amplitude in x, in y and in disparity (of flows, the right camera's x), 6×3.
    pub phi_per_phase_px: SMatrix<f64, 6, 3>,
    /// φ̂ per pixel of the field error's standard deviation, 6×6: L of L Lᵀ, its covariance per square pixel. A field that
    /// stays the same moves φ̂ of pairs with the same geometry alike.
    pub phi_per_field_px: Matrix6<f64>,
    /// φ̂ per unit of each of [`RigErrors`](crate::geometry::RigErrors), 6×8.
    pub phi_per_rig_error: SMatrix<f64, 6, RIG_ERRORS>,
}

/// Sums over observations, by their small motion.
#[derive(Clone, Default)]
struct SharedSums {
    information: Matrix6<f64>,
    phase: SMatrix<f64, 6, 3>,
    rig: SMatrix<f64, 6, RIG_ERRORS>,
    /// Of each block.
    field: BTreeMap<usize, SMatrix<f64, 6, 3>>,
}

impl SharedSums {
    fn add<M: Measurement>(
        &mut self,
        observation: &M,
        at: &LinearisationPoint<'_>,
        residuals: &ResidualModel,
        blocks: Option<&Blocks>,
    ) {
        // Once to move the structure to where it settles.
        let mut structure = observation.structure();
        let _measured = observation.linearise(&mut structure, at);
        let settled = structure;
        let (Some(l), Some(shared)) =
            (observation.linearise(&mut structure, at), observation.shared_jacobian(&settled, at))
        else {
            return;
        };
        let q = l.e.dot(&product(&l.inverse_cov, &l.e));
        let (weight, _) = residuals.mixture.weight(q / residuals.scale2);
        let weighted = product(&l.motion_jacobian.transpose(), &(l.inverse_cov * weight));
        self.information += product(&weighted, &l.motion_jacobian);
        self.phase += product(&weighted, &shared.phase);
        self.rig += product(&weighted, &shared.rig);
        if let Some(blocks) = blocks {
            let (x, y) = observation.position();
            *self.field.entry(blocks.index(x, y)).or_default() += weighted;
        }
    }

    fn merged(mut self, other: &Self) -> Self {
        for (block, sum) in &other.field {
            *self.field.entry(*block).or_default() += sum;
        }
        self.information += other.information;
        self.phase += other.phase;
        self.rig += other.rig;
        self
    }
}

impl SystematicResponse {
    /// δφ = A⁻¹ Σ w Gᵀ S⁻¹ δe about a motion, with residuals as they were weighed there; `None` where some direction is not
    /// determined.
    pub(crate) fn of<M: Measurement>(
        observations: &[M],
        at: &LinearisationPoint<'_>,
        residuals: &ResidualModel,
        blocks: Option<&Blocks>,
    ) -> Option<Self> {
        let stride = observations.len().div_ceil(OBSERVATIONS).max(1);
        let few: Vec<M> = observations.iter().step_by(stride).copied().collect();
        let of_strip = |strip: &[M]| {
            let mut sums = SharedSums::default();
            strip.iter().for_each(|observation| sums.add(observation, at, residuals, blocks));
            sums
        };
        let strips: Vec<SharedSums> = few.par_chunks(STRIP).map(of_strip).collect();
        let sums = strips.iter().fold(SharedSums::default(), SharedSums::merged);
        // By the small motion δ; φ follows by δ = J φ.
        let jacobian = M::small_motion_jacobian(at);
        let information = jacobian.transpose() * sums.information * jacobian;
        let observability = Observability::of(&information).ok()?;
        let complete = observability.observed::<6>().iter().all(|&o| o);
        let solve = information.cholesky().filter(|_| complete)?;
        let of_block = |sum: &SMatrix<f64, 6, 3>| solve.solve(&(jacobian.transpose() * sum));
        let field: Matrix6<f64> = sums.field.values().map(|sum| squared(&of_block(sum))).sum();
        Some(Self {
            phi_per_phase_px: solve.solve(&(jacobian.transpose() * sums.phase)),
            phi_per_field_px: field.cholesky().map_or_else(Matrix6::zeros, |factor| factor.l()),
            phi_per_rig_error: solve.solve(&(jacobian.transpose() * sums.rig)),
        })
    }
}

/// M Mᵀ.
fn squared(m: &SMatrix<f64, 6, 3>) -> Matrix6<f64> {
    m * m.transpose()
}

/// The response of the maximum-likelihood estimate at φ, but to the field error; `None` where some direction is not determined.
pub fn systematic_response<M: Measurement>(
    observations: &[M],
    rig: &StereoRig,
    phi: &Twist,
    kernel: &StudentT,
) -> Option<SystematicResponse> {
    let at = LinearisationPoint::new(*phi, rig);
    let residuals = ResidualModel::of(kernel, &mut squares(observations, &at))?;
    SystematicResponse::of(observations, &at, &residuals, None)
}

#[cfg(test)]
mod tests {
    use nalgebra::{SVector, Vector3};

    use super::*;
    use crate::constrain::phase_wave;
    use crate::estimate::likelihood::maximum_likelihood::maximum_likelihood;
    use crate::geometry::{Gaussian, RigErrors};
    use crate::observe::StereoTrack;

    fn tracks(rig: &StereoRig, phi: &Twist, amplitude: Vector3<f64>, errors: RigErrors) -> Vec<StereoTrack> {
        let variances = [0.01, 0.01, 0.02];
        let place = |i: usize| {
            let (a, b, c) = ((i * 37 % 200) as f64, (i * 53 % 150) as f64, (i * 17 % 31) as f64);
            Vector3::new(a - 100.0, b - 75.0, 8.0 + c)
        };
        let moved = |xyd: &Vector3<f64>| rig.project(&phi.exp().apply(&rig.point(xyd).unwrap())).unwrap();
        let wrong = |xyd: Vector3<f64>| xyd + RigErrors::jacobian(&xyd, rig) * errors.vector();
        let seen = |i: usize| {
            let (before, after) = (place(i), moved(&place(i)));
            let moved = (after - before).xy().map(phase_wave);
            let phase = Vector3::new(moved.x, moved.y, phase_wave(after.z)).component_mul(&amplitude);
            (wrong(before) + Vector3::z() * amplitude.z * phase_wave(before.z), wrong(after) + phase)
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
        let solve = |amplitude, errors| {
            let tracks = tracks(&rig, &phi, amplitude, errors);
            maximum_likelihood(&tracks, &rig, &phi, None, &kernel).unwrap().motion.theta.mean - phi.vector()
        };
        let exact = tracks(&rig, &phi, Vector3::zeros(), RigErrors::default());
        let found = systematic_response(&exact, &rig, &phi, &kernel).unwrap();
        for k in 0..3 {
            let error =
                solve(Vector3::ith(k, 1e-3), RigErrors::default()) / 1e-3 - found.phi_per_phase_px.column(k);
            assert!(error.amax() < 2e-3 * found.phi_per_phase_px.column(k).amax(), "{k} {error}");
        }
        let expected = found.phi_per_rig_error;
        for k in 0..RIG_ERRORS {
            let errors = RigErrors::from_vector(&SVector::ith(k, 1e-5));
            let error = solve(Vector3::zeros(), errors) / 1e-5 - expected.column(k);
            assert!(error.amax() < 5e-3 * expected.column(k).amax(), "{k} {error} {}", expected.column(k));
        }
    }

    #[test]
    fn the_field_s_response_is_that_of_each_block_moved_by_itself() {
        let rig = StereoRig::new(400.0, (159.5, 119.5), 0.15, (320, 240)).unwrap();
        let phi = Twist { t: Vector3::new(0.02, -0.01, -0.2), omega: Vector3::new(0.004, -0.006, 0.002) };
        let kernel = StudentT { nu: f64::INFINITY, iterations: 50, tolerance: 1e-10, ..StudentT::default() };
        let blocks = Blocks::tiling(&rig, 80.0);
        let exact = tracks(&rig, &phi, Vector3::zeros(), RigErrors::default());
        let solve =
            |tracks: &[StereoTrack]| maximum_likelihood(tracks, &rig, &phi, Some(&blocks), &kernel).unwrap();
        let mut sum = Matrix6::zeros();
        for (block, axis) in (0..blocks.count()).flat_map(|block| (0..3).map(move |axis| (block, axis))) {
            let mut moved = exact.clone();
            let inside =
                |track: &&mut StereoTrack| blocks.index(track.before.mean.x, track.before.mean.y) == block;
            moved.iter_mut().filter(inside).for_each(|track| track.after.mean[axis] += 1e-4);
            let change = (solve(&moved).motion.theta.mean - phi.vector()) / 1e-4;
            sum += change * change.transpose();
        }
        let factor = solve(&exact).systematic.unwrap().phi_per_field_px;
        let found = factor * factor.transpose();
        for i in 0..6 {
            assert!((found[(i, i)] / sum[(i, i)] - 1.0).abs() < 0.01, "{i} {found} {sum}");
        }
    }
}
