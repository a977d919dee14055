//! Rows of a linear system, and the sums that solve it.

use nalgebra::{SMatrix, SVector};
use rayon::prelude::*;

use crate::constrain::LinearConstraint;
use crate::estimate::certainty::observability::Observability;
use crate::estimate::unsolvable::Unsolvable;

/// Rows summed by one task; fixed, so that sums do not depend on the number of threads.
const STRIP: usize = 16_384;

/// One equation a · θ = b ± σ of a linear regression in N unknowns.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Row<const N: usize> {
    /// Coefficients a.
    pub a: SVector<f64, N>,
    /// Right-hand side b.
    pub b: f64,
    /// Standard deviation of b − a · θ.
    pub sigma: f64,
    /// Which block of neighbouring pixels the row comes from; see [`crate::estimate::Blocks`].
    pub block: usize,
}

impl<const N: usize> Row<N> {
    /// b − a · θ.
    pub fn residual(&self, theta: &SVector<f64, N>) -> f64 {
        self.b - self.a.dot(theta)
    }
}

impl Row<6> {
    /// The row of a motion constraint.
    pub fn from_constraint(constraint: &LinearConstraint, block: usize) -> Self {
        Self { a: constraint.row(), b: constraint.rate, sigma: constraint.sigma, block }
    }
}

/// The sums Σ w a aᵀ, Σ w a b and the number of rows: all that least squares needs, equation (57).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NormalEquations<const N: usize> {
    /// Σ w a aᵀ.
    pub information: SMatrix<f64, N, N>,
    /// Σ w a b.
    pub moment: SVector<f64, N>,
    /// Number of rows with a positive weight.
    pub rows: usize,
}

impl<const N: usize> Default for NormalEquations<N> {
    fn default() -> Self {
        Self { information: SMatrix::zeros(), moment: SVector::zeros(), rows: 0 }
    }
}

impl<const N: usize> NormalEquations<N> {
    /// Sums over weighted rows.
    pub fn of_weighted_rows<'a>(rows: impl IntoIterator<Item = (&'a Row<N>, f64)>) -> Self {
        let mut sums = Self::default();
        for (row, weight) in rows {
            if weight > 0.0 {
                sums.information += weight * row.a * row.a.transpose();
                sums.moment += weight * row.b * row.a;
                sums.rows += 1;
            }
        }
        sums
    }

    /// Sums over rows with their weights, in fixed strips: the same whatever the number of threads.
    pub(crate) fn in_strips(rows: &[Row<N>], weights: &[f64]) -> Self {
        debug_assert_eq!(rows.len(), weights.len(), "each row has one weight");
        let strips = rows.par_chunks(STRIP).zip(weights.par_chunks(STRIP));
        let parts: Vec<Self> =
            strips.map(|(rows, w)| Self::of_weighted_rows(rows.iter().zip(w.iter().copied()))).collect();
        parts.iter().fold(Self::default(), |sum, part| Self {
            information: sum.information + part.information,
            moment: sum.moment + part.moment,
            rows: sum.rows + part.rows,
        })
    }

    /// The θ that minimises Σ w (b − a · θ)², with the directions no row speaks of left at zero.
    ///
    /// # Errors
    /// [`Unsolvable::FewRows`] with fewer rows than unknowns, [`Unsolvable::NotFinite`] on NaN.
    pub fn solve(&self) -> Result<(SVector<f64, N>, Observability), Unsolvable> {
        if self.rows < N {
            return Err(Unsolvable::FewRows { rows: self.rows, needed: N });
        }
        let observability = Observability::of(&self.information)?;
        Ok((observability.solve(&self.information, &self.moment)?, observability))
    }
}
