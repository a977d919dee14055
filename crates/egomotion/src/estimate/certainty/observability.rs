//! Which directions of motion a system of equations determines at all.

use nalgebra::{DMatrix, DVector, SMatrix, SVector};

use super::undetermined::UndeterminedDirections;
use crate::estimate::unsolvable::Unsolvable;

/// Eigenvalues of the scaled information below this share of the largest count as zero.
///
/// The scaled matrix has a unit diagonal, so the share does not depend on units; double precision
/// sums of 10⁵ rows are good to about 10⁻¹².
const RANK_TOLERANCE: f64 = 1e-10;

/// Unknowns with less than this share of the largest diagonal entry are ones no row speaks of: scaled up to a
/// unit diagonal, the rounding errors there would pass for information. Metres and radians lie nearer together.
const NEGLIGIBLE: f64 = 1e-24;

/// Components with more of themselves than this (squared) in an undetermined direction are unobservable.
const NULL_SHARE: f64 = 1e-6;

/// [`NULL_SHARE`] grows up to this where noise makes directions uncertain: more would call observed what is not.
const LARGEST_NULL_SHARE: f64 = 0.05;

/// The eigen-analysis of a scaled information matrix.
#[derive(Debug, Clone, PartialEq)]
pub struct Observability {
    /// Scale of each unknown: the inverse root of the information's diagonal.
    scale: DVector<f64>,
    /// Eigenvalues of the scaled information.
    eigenvalues: DVector<f64>,
    /// Eigenvectors, one a column.
    eigenvectors: DMatrix<f64>,
    /// The eigenvalue that each direction must exceed to be determined.
    floors: DVector<f64>,
    /// Components with more of themselves (squared) than this in undetermined directions are unobservable.
    null_share: f64,
}

impl Observability {
    /// Analyse an N×N information matrix (symmetric, positive semi-definite, finite).
    ///
    /// # Errors
    /// [`Unsolvable::NotFinite`] when an entry is NaN or infinite, [`Unsolvable::Unobservable`] when all are zero.
    pub(crate) fn of<const N: usize>(information: &SMatrix<f64, N, N>) -> Result<Self, Unsolvable> {
        if !information.iter().all(|v| v.is_finite()) {
            return Err(Unsolvable::NotFinite);
        }
        let diagonal = information.diagonal();
        let negligible = NEGLIGIBLE * diagonal.max();
        if diagonal.max() <= 0.0 {
            return Err(Unsolvable::Unobservable);
        }
        let inverse_root = |v: f64| if v > negligible { v.sqrt().recip() } else { 0.0 };
        let scale = DVector::from_iterator(N, diagonal.iter().map(|&v| inverse_root(v)));
        let scaled = DMatrix::from_fn(N, N, |i, j| information[(i, j)] * scale[i] * scale[j]);
        let eigen = scaled.symmetric_eigen();
        let floors = DVector::from_element(N, RANK_TOLERANCE * eigen.eigenvalues.max());
        Ok(Self {
            scale,
            eigenvalues: eigen.eigenvalues,
            eigenvectors: eigen.eigenvectors,
            floors,
            null_share: NULL_SHARE,
        })
    }

    /// Analyse information from which the share of noise was subtracted.
    ///
    /// A direction x is determined only where its information xᵀ A x exceeds `uncertain(x)`: what is less may be what the
    /// subtraction left. An undetermined direction is then known no better, so that a component is observed
    /// although it has a little of itself there.
    ///
    /// # Errors
    /// As [`Observability::of`]; [`Unsolvable::Unobservable`] too when no direction exceeds what is uncertain.
    pub(crate) fn beyond_noise<const N: usize>(
        information: &SMatrix<f64, N, N>,
        noise: &SMatrix<f64, N, N>,
        uncertain: impl Fn(&SVector<f64, N>) -> f64,
    ) -> Result<Self, Unsolvable> {
        let plain = Self::of(&(information + noise))?;
        let scale = &plain.scale;
        let scaled = DMatrix::from_fn(N, N, |i, j| information[(i, j)] * scale[i] * scale[j]);
        let eigen = scaled.symmetric_eigen();
        let least = RANK_TOLERANCE * plain.eigenvalues.max();
        let floors = DVector::from_fn(N, |k, _| {
            uncertain(&SVector::from_fn(|i, _| eigen.eigenvectors[(i, k)] * scale[i])).max(least)
        });
        let mut found = Self {
            scale: plain.scale,
            eigenvalues: eigen.eigenvalues,
            eigenvectors: eigen.eigenvectors,
            floors,
            null_share: NULL_SHARE,
        };
        if found.rank() == 0 {
            return Err(Unsolvable::Unobservable);
        }
        // An eigenvector leans towards another by the matrix's error over the difference of their eigenvalues.
        let weakest = found.determined().map(|k| found.eigenvalues[k]).fold(f64::INFINITY, f64::min);
        let lean = found.floors.max() / weakest;
        found.null_share = (lean * lean).clamp(NULL_SHARE, LARGEST_NULL_SHARE);
        Ok(found)
    }

    /// The same, but a direction counts as undetermined too where its information is no more than `least` of it.
    ///
    /// # Errors
    /// [`Unsolvable::Unobservable`] when no direction is left.
    pub(crate) fn exceeding<const N: usize>(
        mut self,
        least: impl Fn(&SVector<f64, N>) -> f64,
    ) -> Result<Self, Unsolvable> {
        for k in 0..N {
            let direction = SVector::from_fn(|i, _| self.eigenvectors[(i, k)] * self.scale[i]);
            self.floors[k] = self.floors[k].max(least(&direction));
        }
        if self.rank() > 0 { Ok(self) } else { Err(Unsolvable::Unobservable) }
    }

    fn determined(&self) -> impl Iterator<Item = usize> + '_ {
        (0..self.eigenvalues.len()).filter(|&k| self.eigenvalues[k] > self.floors[k])
    }

    /// Number of independent directions that are determined.
    pub fn rank(&self) -> usize {
        self.determined().count()
    }

    /// Which of the N unknowns are determined.
    pub fn observed<const N: usize>(&self) -> [bool; N] {
        let kept: Vec<usize> = self.determined().collect();
        std::array::from_fn(|i| {
            let share: f64 = kept.iter().map(|&k| self.eigenvectors[(i, k)].powi(2)).sum();
            self.scale[i] > 0.0 && 1.0 - share < self.null_share
        })
    }

    /// The directions that are not determined.
    pub fn undetermined<const N: usize>(&self) -> UndeterminedDirections<N> {
        let kept: Vec<usize> = self.determined().collect();
        // What no row speaks of has no scale of its own.
        let scale = |i: usize| if self.scale[i] > 0.0 { self.scale[i] } else { self.scale.max() };
        let direction = |k: usize| SVector::from_fn(|i, _| self.eigenvectors[(i, k)] * scale(i));
        let free = (0..self.eigenvalues.len()).filter(|k| !kept.contains(k));
        UndeterminedDirections::spanned(free.map(direction), self.null_share.sqrt())
    }

    /// θ as far as it is determined: the unobserved components NaN.
    pub(crate) fn with_unobserved_nan<const N: usize>(&self, theta: &SVector<f64, N>) -> SVector<f64, N> {
        let observed: [bool; N] = self.observed();
        SVector::from_fn(|i, _| if observed[i] { theta[i] } else { f64::NAN })
    }

    /// The whitening matrix W, N × rank: W Wᵀ is the (pseudo-)inverse of the information.
    pub(crate) fn whitening(&self) -> DMatrix<f64> {
        let kept: Vec<usize> = self.determined().collect();
        DMatrix::from_fn(self.scale.len(), kept.len(), |i, j| {
            self.scale[i] * self.eigenvectors[(i, kept[j])] / self.eigenvalues[kept[j]].sqrt()
        })
    }

    /// Solve `information` θ = `moment` in the determined directions.
    ///
    /// # Errors
    /// [`Unsolvable::NotFinite`] when the moment is not finite.
    pub(crate) fn solve<const N: usize>(
        &self,
        information: &SMatrix<f64, N, N>,
        moment: &SVector<f64, N>,
    ) -> Result<SVector<f64, N>, Unsolvable> {
        let w = self.whitening();
        let apply = |v: &SVector<f64, N>| -> SVector<f64, N> {
            let out = &w * (w.transpose() * DVector::from_column_slice(v.as_slice()));
            SVector::from_column_slice(out.as_slice())
        };
        let theta = apply(moment);
        // One step of refinement wins back the digits that the eigen-decomposition loses.
        let theta = theta + apply(&(moment - information * theta));
        if theta.iter().all(|v| v.is_finite()) { Ok(theta) } else { Err(Unsolvable::NotFinite) }
    }
}
