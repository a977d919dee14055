//! What pairs say together: NEES, normalised variances, coverage.

use nalgebra::{Matrix6, Vector6};

use super::{BySigma, Record, percent};
use crate::{Cell, Table};
use egomotion::geometry::Gaussian;
use egomotion::geometry::distribution::CHI2_6_P99;
use egomotion::metrics::Nees;

/// Columns of the study's file.
pub(super) const COLUMNS: [(&str, &str); 17] = [
    ("sequence", "sequence"),
    ("pairs", "pairs"),
    ("answered", "answered"),
    ("nees_over_6", "NEES/6"),
    ("beyond_chi2_99_percent", "beyond χ²₆(.99) (%)"),
    ("t_rmse_mm", "translation (mm)"),
    ("r_rmse_deg", "rotation (°)"),
    ("vz_coverage_95_percent", "VZ in its 95 % (%)"),
    ("vz_least_fifth_within_3_sigma_percent", "VZ within 3σ, worst fifth (%)"),
    ("looming_coverage_95_percent", "looming in its 95 % (%)"),
    ("looming_least_fifth_within_3_sigma_percent", "looming within 3σ, worst fifth (%)"),
    ("pixels_answered_percent", "pixels answered (%)"),
    ("vz_fifth_1", "1st fifth (%)"),
    ("vz_fifth_2", "2nd"),
    ("vz_fifth_3", "3rd"),
    ("vz_fifth_4", "4th"),
    ("vz_fifth_5", "5th"),
];

impl Record {
    /// Error of φ and its covariance.
    pub(super) fn phi(&self) -> Option<(Vector6<f64>, Matrix6<f64>)> {
        let cov = (self.cov.len() == 36).then(|| Matrix6::from_column_slice(&self.cov))?;
        Some((Vector6::from(self.error?), cov))
    }
}

/// What the pairs of a sequence, or of all, say.
#[derive(Debug, Clone, PartialEq)]
pub struct Verdict {
    /// The sequence, or `all`.
    pub name: String,
    /// Pairs.
    pub pairs: usize,
    /// Pairs with a complete φ.
    pub answered: usize,
    /// Mean of eᵀ Σ⁻¹ e over the six degrees of freedom.
    pub nees_over_6: Option<f64>,
    /// Share of the pairs beyond χ²₆(0.99).
    pub beyond: Option<f64>,
    /// Mean of e²/σ² of each component.
    pub components: [f64; 6],
    /// The same along each eigenvector of the covariance in metres and radians, the surest direction first.
    pub directions: [f64; 6],
    /// Root mean square of the error of translation in metres, and of rotation in radians.
    pub rmse: (f64, f64),
    /// VZ of the pixels.
    pub depth_velocity: BySigma,
    /// Looming of the pixels.
    pub looming: BySigma,
    /// Mean share of pixels with an answer.
    pub pixels_answered: f64,
}

impl Verdict {
    /// Over some records.
    pub fn of(name: &str, records: &[&Record]) -> Self {
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
        let sum = |of: fn(&Record) -> &BySigma| {
            records.iter().fold(BySigma::default(), |sum, record| sum.merged(of(record)))
        };
        Self {
            name: name.to_owned(),
            pairs: records.len(),
            answered: found.len(),
            nees_over_6: nees.per_degree(),
            beyond: (!found.is_empty()).then(|| beyond as f64 / n),
            components,
            directions,
            rmse: (t2.sqrt(), r2.sqrt()),
            depth_velocity: sum(|r| &r.depth_velocity),
            looming: sum(|r| &r.looming),
            pixels_answered: records.iter().map(|r| r.answered).sum::<f64>() / records.len().max(1) as f64,
        }
    }

    pub(super) fn cells(&self) -> Vec<Cell> {
        let least = |by: &BySigma| {
            let shares = by.fifths().into_iter().filter_map(|f| f.share3());
            percent(shares.reduce(f64::min))
        };
        let mut cells: Vec<Cell> = vec![
            self.name.as_str().into(),
            self.pairs.into(),
            self.answered.into(),
            self.nees_over_6.into(),
            percent(self.beyond),
            (1e3 * self.rmse.0).into(),
            self.rmse.1.to_degrees().into(),
            percent(self.depth_velocity.all().coverage95()),
            least(&self.depth_velocity),
            percent(self.looming.all().coverage95()),
            least(&self.looming),
            (100.0 * self.pixels_answered).into(),
        ];
        cells.extend(self.depth_velocity.fifths().map(|f| percent(f.share3())));
        cells
    }
}

/// e²/λ along each eigenvector of a covariance, the least eigenvalue λ first.
fn along_eigenvectors(error: &Vector6<f64>, cov: &Matrix6<f64>) -> [f64; 6] {
    let eigen = cov.symmetric_eigen();
    let mut order: [usize; 6] = std::array::from_fn(|i| i);
    order.sort_by(|&a, &b| eigen.eigenvalues[a].total_cmp(&eigen.eigenvalues[b]));
    order.map(|k| eigen.eigenvectors.column(k).dot(error).powi(2) / eigen.eigenvalues[k])
}

/// Normalised variance of each component and of each eigen-direction.
pub(super) fn directions(verdicts: &[Verdict]) -> Table {
    let names = ["tX", "tY", "tZ", "ΩX", "ΩY", "ΩZ", "1", "2", "3", "4", "5", "6"];
    let columns: Vec<(&str, &str)> =
        std::iter::once(("sequence", "sequence")).chain(names.into_iter().map(|name| (name, name))).collect();
    let caption = "Mean squared error over the stated variance: of each component, and along each eigenvector of \
                   the covariance, the surest first.";
    let mut table = Table::new("normalised-variance", "Normalised variance", caption, &columns);
    table.rows = verdicts
        .iter()
        .map(|v| {
            let numbers = v.components.into_iter().chain(v.directions).map(Cell::from);
            std::iter::once(Cell::from(v.name.as_str())).chain(numbers).collect()
        })
        .collect();
    table
}

/// φ's error and σ of every pair.
pub(super) fn pairs(records: &[Record]) -> Table {
    const NAMES: [&str; 6] = ["tx", "ty", "tz", "wx", "wy", "wz"];
    let mut names = vec!["sequence".to_owned(), "pair".to_owned()];
    names.extend(NAMES.map(|name| format!("error_{name}")));
    names.extend(NAMES.map(|name| format!("sigma_{name}")));
    names.push("nees".into());
    let columns: Vec<(&str, &str)> = names.iter().map(|name| (name.as_str(), name.as_str())).collect();
    let mut table = Table::new("pairs", "Every pair", "Metres and radians.", &columns);
    for record in records {
        let Some((error, cov)) = record.phi() else { continue };
        let mut row: Vec<Cell> = vec![record.sequence.as_str().into(), record.pair.into()];
        row.extend(error.iter().map(|&e| Cell::from(e)));
        row.extend((0..6).map(|i| Cell::from(cov[(i, i)].sqrt())));
        row.push(Gaussian { mean: error, cov }.mahalanobis2(&Vector6::zeros()).into());
        table.rows.push(row);
    }
    table
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_are_judged_by_component_and_by_eigenvector() {
        let record = |error: [f64; 6]| {
            // tY and ΩY are known together: the surest direction lies across them.
            let mut cov = Matrix6::from_diagonal(&Vector6::new(9.0, 4.0, 16.0, 25.0, 4.0, 36.0));
            (cov[(1, 4)], cov[(4, 1)]) = (3.0, 3.0);
            Record {
                sequence: "C".into(),
                pair: 0,
                error: Some(error),
                cov: cov.iter().copied().collect(),
                depth_velocity: BySigma::default(),
                looming: BySigma::default(),
                answered: 1.0,
            }
        };
        // Across by 4 and along by 0: the eigenvalues are 1 and 7.
        let across = 8.0_f64.sqrt();
        let records = [record([3.0, across, 0.0, 0.0, -across, 0.0]), record([3.0, 0.0, 8.0, 0.0, 0.0, 0.0])];
        let verdict = Verdict::of("C", &records.iter().collect::<Vec<_>>());
        let near = |found: [f64; 6], expected: [f64; 6]| {
            found.iter().zip(expected).for_each(|(a, b)| assert!((a - b).abs() < 1e-9, "{found:?}"));
        };
        near(verdict.components, [1.0, 1.0, 2.0, 0.0, 1.0, 0.0]);
        near(verdict.directions, [8.0, 0.0, 1.0, 2.0, 0.0, 0.0]);
        // 1 + 16 and 1 + 4 over six degrees each; 17 is beyond χ²₆(0.99).
        assert!((verdict.nees_over_6.unwrap() - 22.0 / 12.0).abs() < 1e-9);
        assert_eq!(verdict.beyond, Some(0.5));
    }
}
