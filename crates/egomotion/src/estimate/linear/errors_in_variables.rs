//! The depth change constraint with noise in its regressors: corrected normal equations.
//!
//! The row a of (11) holds the gradients Zx and Zy, which are as noisy as Zt. Least squares solves Σ a aᵀ φ = Σ a b; the
//! noise adds its own covariance N to the products, E[a aᵀ] = a₀ a₀ᵀ + N_aa and E[a b] = a₀ b₀ + N_ab, so that the
//! answer is too small however many pixels there are. Without that part,
//!
//! Σ (a aᵀ − N_aa) φ = Σ (a b − N_ab),
//!
//! it is consistent (W. A. Fuller, "Measurement Error Models", 1987). N follows by one Jacobian from what was measured.
//! Rows are scaled to disparity, by 1/Z², where noise is the same everywhere; further weights would come from the same
//! noise. Where residuals are clearly smaller than the stated noise would make them, all of it is taken as smaller by as
//! much (Fuller: error variances known but for a factor). What is left is the error of differences in place of
//! derivatives, of third order where a surface is curved along the way a point goes in an interval: no noise model tells of
//! it, but the scatter over blocks does.
//!
//! Noise alone fills the plain normal equations up to full rank. A direction is determined only where what the correction
//! leaves exceeds its own scatter over the blocks.

use nalgebra::{Matrix6, SMatrix, Vector6};
use rayon::prelude::*;

use super::fit::{DETERMINED_SIGMAS, NOISE_VARIANCE, noise_factor};
use crate::constrain::dcce;
use crate::estimate::certainty::blocks::{BlockScore, Blocks};
use crate::estimate::certainty::covariance::covariance;
use crate::estimate::certainty::observability::Observability;
use crate::estimate::motion_estimate::{Estimate, MotionEstimate};
use crate::estimate::unsolvable::Unsolvable;
use crate::geometry::distribution::SIGMA_PER_MEDIAN_DEVIATION;
use crate::geometry::{Gaussian, StereoRig, Twist, median};
use crate::observe::DepthChange;

/// Residuals beyond this many standard deviations are outliers: so far out that cutting takes nothing from the noise.
const OUTLIER_SIGMAS: f64 = 4.0;
/// Most iterations of cutting and solving; an estimate that needs more has not converged.
const MOST_ITERATIONS: usize = 20;
/// The iteration ends when at most one row in this many changes sides: the answer then moves by less than its noise.
const ROWS_PER_CHANGE: usize = 10_000;
/// Rows summed by one task; fixed, so that sums do not depend on the number of threads.
const STRIP: usize = 4096;

/// A row of (11) with the noise of its coefficients.
#[derive(Debug, Clone, Copy)]
struct NoisyRow {
    /// Coefficients a.
    a: Vector6<f64>,
    /// Right-hand side b, in metres.
    b: f64,
    /// Covariance N of (a, b).
    noise: SMatrix<f64, 7, 7>,
    block: usize,
}

impl NoisyRow {
    /// `None` where a number is not finite.
    fn of(change: &DepthChange, focal_px: f64, blocks: &Blocks) -> Option<Self> {
        // In disparity, but for b f: there noise is the same at every depth.
        let per_disparity = change.depth.mean[0].powi(-2);
        let constraint = dcce::constraint(change, focal_px, &Twist::zero()).scaled(per_disparity);
        let (a, b) = (constraint.row(), constraint.rate);
        let noise = dcce::row_noise(change, focal_px) * (per_disparity * per_disparity);
        let finite = a.iter().chain(noise.iter()).all(|v| v.is_finite()) && b.is_finite();
        finite.then(|| Self { a, b, noise, block: blocks.index(change.x_px, change.y_px) })
    }

    /// b − a · φ and its variance.
    fn residual(&self, phi: &Vector6<f64>) -> (f64, f64) {
        let mut gradient = SMatrix::<f64, 7, 1>::zeros();
        gradient.fixed_view_mut::<6, 1>(0, 0).copy_from(&-phi);
        gradient[6] = 1.0;
        (self.b - self.a.dot(phi), (gradient.transpose() * self.noise * gradient)[0])
    }
}

/// Corrected sums of some rows, and what the correction took away.
#[derive(Debug, Clone, Copy)]
struct CorrectedSums {
    information: Matrix6<f64>,
    moment: Vector6<f64>,
    noise: Matrix6<f64>,
    /// Σ e² and Σ of its stated variance.
    square: f64,
    variance: f64,
    used: usize,
}

impl CorrectedSums {
    fn zero() -> Self {
        let zero = Matrix6::zeros();
        Self { information: zero, moment: Vector6::zeros(), noise: zero, square: 0.0, variance: 0.0, used: 0 }
    }

    fn merged(mut self, other: &Self) -> Self {
        self.information += other.information;
        self.moment += other.moment;
        self.noise += other.noise;
        self.square += other.square;
        self.variance += other.variance;
        self.used += other.used;
        self
    }
}

/// φ from depth changes whose gradients are noisy: DCCE (12) without its bias. Outliers are judged at `start` first.
///
/// The covariance is block-wise: central differences of neighbouring pixels share pixels, so blocks should be some
/// twelve pixels wide at least.
///
/// # Errors
/// [`Unsolvable`] with too few observations or without any determined direction.
pub fn errors_in_variables(
    changes: &[DepthChange],
    rig: &StereoRig,
    start: &Twist,
    blocks: &Blocks,
) -> Result<MotionEstimate, Unsolvable> {
    let rows: Vec<NoisyRow> =
        changes.par_iter().filter_map(|change| NoisyRow::of(change, rig.focal_px, blocks)).collect();
    let mut phi = start.vector();
    let mut used = 0;
    for _ in 0..MOST_ITERATIONS {
        let by_block = sums(&rows, &phi, blocks);
        let whole = by_block.iter().fold(CorrectedSums::zero(), CorrectedSums::merged);
        if whole.used < 6 {
            return Err(Unsolvable::FewRows { rows: whole.used, needed: 6 });
        }
        let observability = determined(&by_block, &whole)?;
        let last = phi;
        phi = observability.solve(&whole.information, &whole.moment)?;
        // Without anything left to cut the first answer is the last.
        if whole.used.abs_diff(used) <= rows.len() / ROWS_PER_CHANGE || phi == last {
            return Ok(estimate(&phi, &by_block, &whole, observability, rows.len()));
        }
        used = whole.used;
    }
    Err(Unsolvable::NotConverged)
}

/// Scale of the residuals at φ in units of their stated σ, by their median.
fn scale(rows: &[NoisyRow], phi: &Vector6<f64>) -> f64 {
    let standard = |row: &NoisyRow| {
        let (e, variance) = row.residual(phi);
        (variance > 0.0).then(|| e.abs() / variance.sqrt())
    };
    let mut all: Vec<f64> = rows.par_iter().filter_map(standard).collect();
    SIGMA_PER_MEDIAN_DEVIATION * median(&mut all)
}

/// The sums of every block over the rows that are no outliers at φ.
fn sums(rows: &[NoisyRow], phi: &Vector6<f64>, blocks: &Blocks) -> Vec<CorrectedSums> {
    // A start far off makes all residuals large; then the median tells what is usual.
    let scale = scale(rows, phi);
    let cut = (OUTLIER_SIGMAS * scale.max(1.0)).powi(2);
    // Where residuals are smaller than their σ, so is the noise of the coefficients.
    let noise_scale2 = noise_factor(scale);
    let strips: Vec<Vec<(usize, CorrectedSums)>> = rows
        .par_chunks(STRIP)
        .map(|strip| {
            let mut runs: Vec<(usize, CorrectedSums)> = Vec::new();
            for row in strip {
                let (e, variance) = row.residual(phi);
                if e * e > cut * variance {
                    continue;
                }
                if runs.last().is_none_or(|run| run.0 != row.block) {
                    runs.push((row.block, CorrectedSums::zero()));
                }
                let Some((_, sums)) = runs.last_mut() else { continue };
                let noise: Matrix6<f64> = row.noise.fixed_view::<6, 6>(0, 0) * noise_scale2;
                sums.information += row.a * row.a.transpose() - noise;
                sums.moment += row.a * row.b - row.noise.fixed_view::<6, 1>(0, 6) * noise_scale2;
                sums.noise += noise;
                sums.square += e * e;
                sums.variance += variance;
                sums.used += 1;
            }
            runs
        })
        .collect();
    let mut by_block = vec![CorrectedSums::zero(); blocks.count()];
    for (block, part) in strips.iter().flatten() {
        by_block[*block] = by_block[*block].merged(part);
    }
    by_block
}

/// Eigen-analysis of the corrected information, tested against the scatter of its correction.
///
/// Along a direction that is not determined a row adds the square of a normal number less its variance v, which
/// scatters by [`NOISE_VARIANCE`] v².
fn determined(by_block: &[CorrectedSums], whole: &CorrectedSums) -> Result<Observability, Unsolvable> {
    Observability::beyond_noise(&whole.information, &whole.noise, |direction: &Vector6<f64>| {
        let scatter = |sums: &CorrectedSums| {
            let noise = direction.dot(&(sums.noise * direction));
            NOISE_VARIANCE * noise * noise / sums.used.max(1) as f64
        };
        DETERMINED_SIGMAS * by_block.iter().map(scatter).sum::<f64>().sqrt()
    })
}

fn estimate(
    phi: &Vector6<f64>,
    by_block: &[CorrectedSums],
    whole: &CorrectedSums,
    observability: Observability,
    rows: usize,
) -> MotionEstimate {
    let score = |sums: &CorrectedSums| BlockScore {
        information: sums.information,
        score: sums.moment - sums.information * phi,
    };
    let scores: Vec<BlockScore<6>> = by_block.iter().filter(|sums| sums.used > 0).map(score).collect();
    Estimate {
        theta: Gaussian {
            mean: observability.with_unobserved_nan(phi),
            cov: covariance(&scores, None, &observability),
        },
        observed: observability.observed(),
        undetermined: observability.undetermined(),
        rows,
        inliers: whole.used,
        residual_scale: (whole.square / whole.variance.max(f64::MIN_POSITIVE)).sqrt(),
    }
}
