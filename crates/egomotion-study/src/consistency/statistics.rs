//! Statistics over pairs: NEES, normalised variances, coverage.

use egomotion::geometry::distribution::CHI2_6_P99;
use nalgebra::{Matrix6, Vector6};

use super::{ConsistencyRecord, CoverageBySigma};
use egomotion::geometry::Gaussian;
use egomotion::metrics::Nees;

impl ConsistencyRecord {
    /// Error of φ and its covariance.
    pub(super) fn phi(&self) -> Option<(Vector6<f64>, Matrix6<f64>)> {
        let cov = (self.cov.len() == 36).then(|| Matrix6::from_column_slice(&self.cov))?;
        Some((Vector6::from(self.error?), cov))
    }
}

/// Statistics over the pairs of one sequence, or of all.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct ConsistencyStatistics {
    /// The sequence, or `all`.
    pub(super) name: String,
    /// Pairs.
    pub(super) pairs: usize,
    /// Pairs with a complete φ.
    pub(super) answered: usize,
    /// Mean of eᵀ Σ⁻¹ e over the six degrees of freedom.
    pub(super) nees_over_6: Option<f64>,
    /// Share of the pairs beyond χ²₆(0.99).
    pub(super) beyond_chi2_99: Option<f64>,
    /// Mean of e²/σ² of each component.
    pub(super) components: [f64; 6],
    /// The same along each eigenvector of the covariance in metres and radians, the surest direction first.
    pub(super) directions: [f64; 6],
    /// Root mean square of the error of translation, in metres.
    pub(super) translation_rmse_m: f64,
    /// Root mean square of the error of rotation, in radians.
    pub(super) rotation_rmse_rad: f64,
    /// VZ of the pixels.
    pub(super) depth_velocity: CoverageBySigma,
    /// Looming of the pixels.
    pub(super) looming: CoverageBySigma,
    /// Mean share of pixels with an answer.
    pub(super) pixels_answered: f64,
}

impl ConsistencyStatistics {
    /// Over some records.
    pub(super) fn of(name: &str, records: &[&ConsistencyRecord]) -> Self {
        let found: Vec<(Vector6<f64>, Matrix6<f64>)> = records.iter().filter_map(|r| r.phi()).collect();
        let n = found.len().max(1) as f64;
        let (mut components, mut directions) = ([0.0; 6], [0.0; 6]);
        let (mut t2, mut r2, mut beyond) = (0.0, 0.0, 0);
        let mut nees = Nees::default();
        for (error, cov) in &found {
            let estimate = Gaussian { mean: *error, cov: *cov };
            nees.add(&estimate, &Vector6::zeros());
            for (i, sum) in components.iter_mut().enumerate() {
                *sum += error[i].powi(2) / cov[(i, i)] / n;
            }
            for (sum, square) in directions.iter_mut().zip(along_eigenvectors(error, cov)) {
                *sum += square / n;
            }
            t2 += error.fixed_rows::<3>(0).norm_squared() / n;
            r2 += error.fixed_rows::<3>(3).norm_squared() / n;
            beyond += usize::from(estimate.mahalanobis2(&Vector6::zeros()).is_none_or(|d| d > CHI2_6_P99));
        }
        let sum = |of: fn(&ConsistencyRecord) -> &CoverageBySigma| {
            records.iter().fold(CoverageBySigma::default(), |sum, record| sum.merged(of(record)))
        };
        Self {
            name: name.to_owned(),
            pairs: records.len(),
            answered: found.len(),
            nees_over_6: nees.per_degree(),
            beyond_chi2_99: (!found.is_empty()).then(|| beyond as f64 / n),
            components,
            directions,
            translation_rmse_m: t2.sqrt(),
            rotation_rmse_rad: r2.sqrt(),
            depth_velocity: sum(|r| &r.depth_velocity),
            looming: sum(|r| &r.looming),
            pixels_answered: records.iter().map(|r| r.answered).sum::<f64>() / records.len().max(1) as f64,
        }
    }
}

/// e²/λ along each eigenvector of a covariance, the least eigenvalue λ first.
fn along_eigenvectors(error: &Vector6<f64>, cov: &Matrix6<f64>) -> [f64; 6] {
    let eigen = cov.symmetric_eigen();
    let mut order: [usize; 6] = std::array::from_fn(|i| i);
    order.sort_by(|&a, &b| eigen.eigenvalues[a].total_cmp(&eigen.eigenvalues[b]));
    order.map(|k| eigen.eigenvectors.column(k).dot(error).powi(2) / eigen.eigenvalues[k])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_are_normalised_by_component_and_by_eigenvector() {
        let record = |error: [f64; 6]| {
            // tY and ΩY are known together: the surest direction lies across them.
            let mut cov = Matrix6::from_diagonal(&Vector6::new(9.0, 4.0, 16.0, 25.0, 4.0, 36.0));
            (cov[(1, 4)], cov[(4, 1)]) = (3.0, 3.0);
            ConsistencyRecord {
                sequence: "C".into(),
                pair: 0,
                error: Some(error),
                cov: cov.iter().copied().collect(),
                depth_velocity: CoverageBySigma::default(),
                looming: CoverageBySigma::default(),
                answered: 1.0,
            }
        };
        // Across by 4 and along by 0: the eigenvalues are 1 and 7.
        let across = 8.0_f64.sqrt();
        let records = [record([3.0, across, 0.0, 0.0, -across, 0.0]), record([3.0, 0.0, 8.0, 0.0, 0.0, 0.0])];
        let statistics = ConsistencyStatistics::of("C", &records.iter().collect::<Vec<_>>());
        let near = |found: [f64; 6], expected: [f64; 6]| {
            found.iter().zip(expected).for_each(|(a, b)| assert!((a - b).abs() < 1e-9, "{found:?}"));
        };
        near(statistics.components, [1.0, 1.0, 2.0, 0.0, 1.0, 0.0]);
        near(statistics.directions, [8.0, 0.0, 1.0, 2.0, 0.0, 0.0]);
        // 1 + 16 and 1 + 4 over six degrees each; 17 is beyond χ²₆(0.99).
        assert!((statistics.nees_over_6.unwrap() - 22.0 / 12.0).abs() < 1e-9);
        assert_eq!(statistics.beyond_chi2_99, Some(0.5));
    }
}
