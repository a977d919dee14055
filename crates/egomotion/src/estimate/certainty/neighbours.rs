//! What the motions of two neighbouring pairs share: the noise of the frame that both have.
//!
//! The frame between two pairs is the later one of the first and the earlier one of the second. A disparity that is too
//! large there makes the first motion wrong one way and the second the other. By the influences z of the blocks of that
//! frame ([`super::covariance`]), Σ z zᵀ over its blocks, with z of the first pair and of the second, estimates the
//! covariance between the two motions.

use nalgebra::{Matrix6, Vector6};
use serde::{Deserialize, Serialize};

/// Motions of neighbouring pairs may be correlated by at most this: with more, the sum of many would have a negative
/// variance (a moving average of first order).
const LARGEST_CORRELATION: f64 = 0.5;

/// The influence of each block of a frame on a motion φ̂, in metres and radians.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct BlockInfluences(pub(crate) Vec<Vector6<f64>>);

/// Cov(φ̂ of the first pair, φ̂ of the second), 6×6, from the influences of the blocks of the frame between them.
///
/// `covariances` are those of the two motions.
pub(crate) fn shared_covariance(
    first: &BlockInfluences,
    second: &BlockInfluences,
    covariances: [&Matrix6<f64>; 2],
) -> Matrix6<f64> {
    if first.0.len() != second.0.len() || covariances.iter().any(|cov| cov.iter().any(|v| !v.is_finite())) {
        return Matrix6::zeros();
    }
    let sum: Matrix6<f64> = first.0.iter().zip(&second.0).map(|(a, b)| a * b.transpose()).sum();
    bounded(&sum, covariances).unwrap_or_else(Matrix6::zeros)
}

/// The covariance between two motions with each canonical correlation at most [`LARGEST_CORRELATION`].
fn bounded(cross: &Matrix6<f64>, [first, second]: [&Matrix6<f64>; 2]) -> Option<Matrix6<f64>> {
    let (a, b) = (first.cholesky()?.l(), second.cholesky()?.l());
    let correlation = a.try_inverse()? * cross * b.try_inverse()?.transpose();
    let svd = correlation.try_svd(true, true, f64::EPSILON, 200)?;
    let (u, vt) = (svd.u?, svd.v_t?);
    let bounded = svd.singular_values.map(|r| r.min(LARGEST_CORRELATION));
    Some(a * u * Matrix6::from_diagonal(&bounded) * vt * b.transpose())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn opposite_influences_of_a_common_frame_are_a_negative_covariance() {
        // Six blocks, each of which moves one component by 0.3 and the other way in the next pair.
        let first = BlockInfluences((0..6).map(|i| Vector6::ith(i, 0.3)).collect());
        let second = BlockInfluences((0..6).map(|i| Vector6::ith(i, -0.3)).collect());
        let cov = Matrix6::identity();
        let found = shared_covariance(&first, &second, [&cov, &cov]);
        assert!((found + Matrix6::identity() * 0.09).amax() < 1e-12, "{found}");
    }

    #[test]
    fn no_correlation_exceeds_a_half_and_what_is_unknown_shares_nothing() {
        let blocks = BlockInfluences((0..6).map(|i| Vector6::ith(i, 0.9)).collect());
        let cov = Matrix6::identity();
        let found = shared_covariance(&blocks, &blocks, [&cov, &cov]);
        assert!((found - Matrix6::identity() * 0.5).amax() < 1e-12, "{found}");
        let unknown = Matrix6::from_diagonal_element(f64::INFINITY);
        assert_eq!(shared_covariance(&blocks, &blocks, [&cov, &unknown]), Matrix6::zeros());
        let other_frame = BlockInfluences(Vec::new());
        assert_eq!(shared_covariance(&blocks, &other_frame, [&cov, &cov]), Matrix6::zeros());
    }
}
