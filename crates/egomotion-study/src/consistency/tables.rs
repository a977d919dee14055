//! The tables of the consistency study.

use nalgebra::Vector6;

use super::statistics::ConsistencyStatistics;
use super::{ConsistencyRecord, CoverageBySigma};
use crate::components::{NAMES, SYMBOLS};
use crate::{Cell, Table};
use egomotion::geometry::Gaussian;

/// Columns of the study's file.
const COLUMNS: [(&str, &str); 17] = [
    ("sequence", "sequence"),
    ("pairs", "pairs"),
    ("answered", "answered"),
    ("nees_over_6", "NEES/6"),
    ("beyond_chi2_99_percent", "beyond χ²₆(0.99) (%)"),
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

/// NEES, errors and coverage of each sequence.
pub(super) fn consistency(statistics: &[ConsistencyStatistics]) -> Table {
    let caption = "Each pair at a random pose with its own texture and noise, through the whole image \
                   pipeline. NEES/6 is 1 and a normalised variance is 1 where covariances are true.";
    let mut table = Table::new("consistency", "Uncertainty against exact truth", caption, &COLUMNS);
    table.rows = statistics.iter().map(cells).collect();
    table
}

fn cells(statistics: &ConsistencyStatistics) -> Vec<Cell> {
    let least = |by: &CoverageBySigma| {
        let shares = by.fifths().into_iter().filter_map(|f| f.coverage3());
        percent(shares.reduce(f64::min))
    };
    let mut cells: Vec<Cell> = vec![
        statistics.name.as_str().into(),
        statistics.pairs.into(),
        statistics.answered.into(),
        statistics.nees_over_6.into(),
        percent(statistics.beyond_chi2_99),
        (1e3 * statistics.translation_rmse_m).into(),
        statistics.rotation_rmse_rad.to_degrees().into(),
        percent(statistics.depth_velocity.all().coverage95()),
        least(&statistics.depth_velocity),
        percent(statistics.looming.all().coverage95()),
        least(&statistics.looming),
        (100.0 * statistics.pixels_answered).into(),
    ];
    cells.extend(statistics.depth_velocity.fifths().map(|f| percent(f.coverage3())));
    cells
}

/// A cell that shows a share in percent.
fn percent(share: Option<f64>) -> Cell {
    share.map(|share| 100.0 * share).into()
}

/// Normalised variance of each component and of each eigen-direction.
pub(super) fn normalised_variances(statistics: &[ConsistencyStatistics]) -> Table {
    let names = SYMBOLS.into_iter().chain(["1", "2", "3", "4", "5", "6"]);
    let columns: Vec<(&str, &str)> =
        std::iter::once(("sequence", "sequence")).chain(names.map(|name| (name, name))).collect();
    let caption = "Mean squared error over the stated variance: of each component, and along each eigenvector of \
                   the covariance, the surest first.";
    let mut table = Table::new("normalised-variance", "Normalised variance", caption, &columns);
    table.rows = statistics
        .iter()
        .map(|v| {
            let numbers = v.components.into_iter().chain(v.directions).map(Cell::from);
            std::iter::once(Cell::from(v.name.as_str())).chain(numbers).collect()
        })
        .collect();
    table
}

/// φ's error and σ of every pair.
pub(super) fn pairs(records: &[ConsistencyRecord]) -> Table {
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
