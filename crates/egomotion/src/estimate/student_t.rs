//! Student's t as the distribution of residuals: the weights of every robust estimator but least median of squares.

use documented::DocumentedFields;
use serde::{Deserialize, Serialize};

/// Least squared scale of residuals in units of σ: what exact observations leave below it are rounding errors,
/// which have no scale that an iteration could settle at.
pub(crate) const LEAST_SCALE2: f64 = 1e-12;

/// Student's t as the distribution of residuals: heavy tails instead of a cut.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, DocumentedFields)]
#[serde(default, deny_unknown_fields)]
pub struct StudentT {
    /// Degrees of freedom ν; small is heavy-tailed, infinite is Gaussian.
    pub nu: f64,
    /// Whether maximum likelihood finds ν, and a share of outliers, from the residuals.
    ///
    /// Linear rows keep `nu`, and so does the Gaussian.
    pub fitted: bool,
    /// Most iterations.
    pub iterations: usize,
    /// The iteration ends when no unknown moves by more than this share of its standard deviation.
    pub tolerance: f64,
}

impl Default for StudentT {
    fn default() -> Self {
        Self { nu: 4.0, fitted: true, iterations: 50, tolerance: 1e-3 }
    }
}

impl StudentT {
    /// Weight of a residual of `dimension` components whose squared Mahalanobis length is `q`.
    pub fn weight(&self, q: f64, dimension: f64) -> f64 {
        if self.nu.is_infinite() { 1.0 } else { (self.nu + dimension) / (self.nu + q) }
    }

    /// −2 ∂weight/∂q, which turns the weighted information into the score's true derivative.
    pub fn curvature(&self, q: f64, dimension: f64) -> f64 {
        if self.nu.is_infinite() {
            0.0
        } else {
            2.0 * self.weight(q, dimension).powi(2) / (self.nu + dimension)
        }
    }
}
