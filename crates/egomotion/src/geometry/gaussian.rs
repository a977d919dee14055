//! A mean with its covariance, and propagation through a Jacobian, equation (30).

use nalgebra::{SMatrix, SVector};
use serde::{Deserialize, Serialize};

/// A Gaussian of N quantities.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Gaussian<const N: usize> {
    /// Mean.
    pub mean: SVector<f64, N>,
    /// Covariance, N×N; a zero variance means *exact*, an infinite one *unknown*.
    pub cov: SMatrix<f64, N, N>,
}

impl<const N: usize> Gaussian<N> {
    /// Independent quantities with the given variances.
    pub fn independent(mean: [f64; N], variances: [f64; N]) -> Self {
        Self { mean: mean.into(), cov: SMatrix::from_diagonal(&variances.into()) }
    }

    /// The Gaussian of a function of the quantities, Σ_F = J Σ_S Jᵀ, equation (30).
    ///
    /// `mean` is the function's value and `jacobian` its derivative, both at this mean.
    #[inline(always)]
    pub fn propagate<const M: usize>(
        &self,
        mean: SVector<f64, M>,
        jacobian: &SMatrix<f64, M, N>,
    ) -> Gaussian<M> {
        Gaussian { mean, cov: product(&product(jacobian, &self.cov), &jacobian.transpose()) }
    }

    /// Standard deviation of quantity `i`.
    pub fn sigma(&self, i: usize) -> f64 {
        self.cov[(i, i)].sqrt()
    }

    /// The same with every correlation dropped: what the paper's printed formulas assume.
    pub(crate) fn without_correlation(&self) -> Self {
        Self { mean: self.mean, cov: SMatrix::from_diagonal(&self.cov.diagonal()) }
    }

    /// The squared Mahalanobis distance of `value` (NEES when `value` is the truth); `None` if the covariance is singular.
    pub fn mahalanobis2(&self, value: &SVector<f64, N>) -> Option<f64> {
        let e = value - self.mean;
        // Scaled first, because metres and radians differ by orders of magnitude.
        let scale = self.cov.diagonal().map(|v| if v > 0.0 { v.sqrt().recip() } else { 0.0 });
        let scaled = SMatrix::<f64, N, N>::from_fn(|i, j| self.cov[(i, j)] * scale[i] * scale[j]);
        let e = e.component_mul(&scale);
        Some(e.dot(&(scaled.try_inverse()? * e)))
    }
}

impl Gaussian<1> {
    /// One quantity with its variance.
    pub fn scalar(value: f64, variance: f64) -> Self {
        Self::independent([value], [variance])
    }

    /// The value.
    pub fn value(&self) -> f64 {
        self.mean[0]
    }

    /// The variance.
    pub fn variance(&self) -> f64 {
        self.cov[(0, 0)]
    }
}

/// A B, in place of the library's product for matrices of any size, which costs twice as much for those as small as here.
#[inline(always)]
pub(crate) fn product<const N: usize, const K: usize, const M: usize>(
    a: &SMatrix<f64, N, K>,
    b: &SMatrix<f64, K, M>,
) -> SMatrix<f64, N, M> {
    let mut out = SMatrix::from_data(nalgebra::ArrayStorage([[0.0; N]; M]));
    accumulate(&mut out, a, b);
    out
}

/// sum += A B.
#[inline(always)]
pub(crate) fn accumulate<const N: usize, const K: usize, const M: usize>(
    sum: &mut SMatrix<f64, N, M>,
    a: &SMatrix<f64, N, K>,
    b: &SMatrix<f64, K, M>,
) {
    // Stored by columns.
    let (sum, a, b) = (&mut sum.data.0, &a.data.0, &b.data.0);
    for m in 0..M {
        for k in 0..K {
            for n in 0..N {
                sum[m][n] += a[k][n] * b[m][k];
            }
        }
    }
}

/// Variance of a quantity rounded to a multiple of `step`, step²/12, equation (52).
pub fn rounding_variance(step: f64) -> f64 {
    step * step / 12.0
}
