//! Covariance of an estimate: from the scatter of its blocks, from the model, or from leaving out one block at a time.
//!
//! An estimate θ̂ solves Σ s_b(θ) = 0 over blocks b. To first order θ̂ − θ = Σ z_b with the
//! *influence* z_b = B⁻¹ s_b of each block, so Σ z_b z_bᵀ estimates the covariance whatever the
//! correlation inside the blocks (the sandwich or cluster-robust estimator). Two refinements make
//! it usable with few blocks: the residuals of a block that pulls θ̂ towards itself are inflated
//! (Bell and McCaffrey 2002, their CR2), and the noisy 6×6 sum is shrunk towards a multiple of
//! the model's covariance (Ledoit and Wolf 2004).

use nalgebra::{DMatrix, DVector, SMatrix, SVector};

use super::blocks::BlockScore;
use super::observability::Observability;

/// Fewest blocks whose scatter says anything: the score of a single one is zero at the estimate.
const LEAST_BLOCKS: usize = 2;
/// Residuals of a block are inflated as though at least this share of them were left: a block that alone determines a
/// direction has none.
const LEAST_RESIDUAL_SHARE: f64 = 0.05;

/// Covariance of an estimate from the scores of its blocks.
///
/// `bread_inverse` is the inverse derivative of the total score; where it is `None` it is taken
/// from the total information. Undetermined directions get an infinite variance; with a single block
/// all do.
pub(crate) fn covariance<const N: usize>(
    scores: &[BlockScore<N>],
    bread_inverse: Option<&SMatrix<f64, N, N>>,
    observability: &Observability,
) -> SMatrix<f64, N, N> {
    let w = observability.whitening();
    let influences: Vec<DVector<f64>> = scores
        .iter()
        .filter(|block| block.information.trace() > 0.0)
        .map(|block| {
            let score = w.transpose() * DVector::from_column_slice(block.score.as_slice());
            let information = DMatrix::from_column_slice(N, N, block.information.as_slice());
            inverse_root_of_residual_share(&(w.transpose() * information * &w)) * score
        })
        .collect();
    if influences.len() < LEAST_BLOCKS {
        return with_unobserved(SMatrix::zeros(), &[false; N]);
    }
    let whitened = shrunk_second_moment(&influences, w.ncols());
    let spread = match bread_inverse.filter(|_| w.ncols() == N) {
        // B⁻¹ A^{1/2} instead of A^{−1/2}: the whitening's pseudo-inverse is A W.
        Some(inverse) => {
            let total: SMatrix<f64, N, N> = scores.iter().map(|b| b.information).sum();
            let product = inverse * total;
            DMatrix::from_column_slice(N, N, product.as_slice()) * w
        }
        None => w,
    };
    let cov = &spread * whitened * spread.transpose();
    with_unobserved(SMatrix::from_column_slice(cov.as_slice()), &observability.observed())
}

/// Covariance from the model alone, `scale2` times the inverse information: rows independent and σ true.
pub(crate) fn model_covariance<const N: usize>(
    scale2: f64,
    observability: &Observability,
) -> SMatrix<f64, N, N> {
    let w = observability.whitening();
    let cov = scale2 * (&w * w.transpose());
    with_unobserved(SMatrix::from_column_slice(cov.as_slice()), &observability.observed())
}

/// Covariance from leave-one-block-out estimates (the jackknife), for estimators without a score.
///
/// Infinite with a single block.
pub(crate) fn jackknife<const N: usize>(left_out: &[SVector<f64, N>]) -> SMatrix<f64, N, N> {
    if left_out.len() < LEAST_BLOCKS {
        return with_unobserved(SMatrix::zeros(), &[false; N]);
    }
    let count = left_out.len() as f64;
    let mean = left_out.iter().sum::<SVector<f64, N>>() / count;
    left_out.iter().map(|theta| (theta - mean) * (theta - mean).transpose()).sum::<SMatrix<f64, N, N>>()
        * ((count - 1.0) / count)
}

/// The covariance with an infinite variance for what is not observed.
pub(crate) fn with_unobserved<const N: usize>(
    mut cov: SMatrix<f64, N, N>,
    observed: &[bool; N],
) -> SMatrix<f64, N, N> {
    for i in (0..N).filter(|&i| !observed[i]) {
        cov.row_mut(i).fill(0.0);
        cov.column_mut(i).fill(0.0);
        cov[(i, i)] = f64::INFINITY;
    }
    cov
}

/// (I − H)^{−1/2}, where H is a block's share of the whitened information.
fn inverse_root_of_residual_share(share: &DMatrix<f64>) -> DMatrix<f64> {
    let eigen = (0.5 * (share + share.transpose())).symmetric_eigen();
    let root = eigen.eigenvalues.map(|h| (1.0 - h).max(LEAST_RESIDUAL_SHARE).sqrt().recip());
    &eigen.eigenvectors * DMatrix::from_diagonal(&root) * eigen.eigenvectors.transpose()
}

/// Σ z zᵀ shrunk towards a multiple of I by the intensity of Ledoit and Wolf.
fn shrunk_second_moment(influences: &[DVector<f64>], n: usize) -> DMatrix<f64> {
    let sum = influences.iter().fold(DMatrix::zeros(n, n), |sum, z| sum + z * z.transpose());
    let target = DMatrix::identity(n, n) * (sum.trace() / n.max(1) as f64);
    let count = influences.len() as f64;
    let distance = (&sum - &target).norm_squared();
    // Each z zᵀ · count is one sample of the sum.
    let scatter: f64 =
        influences.iter().map(|z| (z * z.transpose() * count - &sum).norm_squared()).sum::<f64>()
            / (count * count);
    let intensity = if distance > 0.0 { (scatter / distance).min(1.0) } else { 1.0 };
    sum * (1.0 - intensity) + target * intensity
}
