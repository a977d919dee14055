//! The tables of the efficiency study.

use super::EfficiencyRecord;
use super::factors::{BASELINE, Factors, OutlierKind};
use super::tally::EfficiencyStatistics;
use crate::components::{NAMES, SYMBOLS};
use crate::synthetic::Contender;
use crate::{Cell, Table};

/// Shares of outliers in the overview: none, a fifth and two fifths.
const OVERVIEW_SHARES: [f64; 3] = [0.0, 0.2, 0.4];
/// Columns of the study's files, with their headings.
const COLUMNS: [(&str, &str); 13] = [
    ("sequence", "sequence"),
    ("noise_px", "noise (px)"),
    ("points", "points"),
    ("outliers", "outliers"),
    ("approach", "approach"),
    ("method", "method"),
    ("estimator", "estimator"),
    ("component", "component"),
    ("variance_over_bound", "variance/bound"),
    ("bias_over_sigma", "bias/σ"),
    ("nees_over_6", "NEES/6"),
    ("coverage_95", "coverage of 95 %"),
    ("draws", "draws"),
];

/// Cells with the names of a contender.
fn contender_cells(contender: &Contender) -> [Cell; 3] {
    contender.names().map(Cell::from)
}

/// A table of every component's errors at the settings that belong to it.
pub(super) fn errors(
    id: &str,
    title: &str,
    caption: &str,
    records: &[EfficiencyRecord],
    belongs: impl Fn(&Factors) -> bool,
) -> Table {
    let mut table = Table::new(id, title, caption, &COLUMNS);
    for record in records {
        let EfficiencyRecord::Errors { sequence, factors, errors } = record else { continue };
        if !belongs(factors) {
            continue;
        }
        for (i, component) in NAMES.into_iter().enumerate() {
            let found = errors.tally.statistics(i);
            let mut row = vec![
                sequence.as_str().into(),
                factors.noise_px.into(),
                factors.points.into(),
                factors.outliers.into(),
            ];
            row.extend(contender_cells(&errors.contender));
            row.push(component.into());
            row.extend([
                found.map(|f| f.variance_over_bound).into(),
                found.map(|f| f.bias_over_sigma).into(),
                found.map(|f| f.nees_over_6).into(),
                found.map(|f| f.coverage_95).into(),
                errors.tally.draws.into(),
            ]);
            table.rows.push(row);
        }
    }
    table
}

/// The worst component of each contender at the baseline, and with a fifth and two fifths of outliers.
pub(super) fn overview(records: &[EfficiencyRecord]) -> Table {
    let mut table = Table::new(
        "overview",
        "The worst component of each contender",
        "1/8 px of noise, 2048 points; within 3 σ: answers within 3 of their own σ of the truth.",
        &[
            ("sequence", "sequence"),
            ("outliers", "outliers"),
            ("kind", "kind"),
            ("approach", "approach"),
            ("method", "method"),
            ("estimator", "estimator"),
            ("variance_over_bound", "variance/bound"),
            ("bias_over_sigma", "|bias|/σ"),
            ("nees_over_6", "NEES/6"),
            ("coverage_95", "coverage of 95 %"),
            ("within_3_sigma", "within 3 σ"),
            ("draws", "draws"),
            ("refused", "no answer"),
        ],
    );
    for record in records {
        let EfficiencyRecord::Errors { sequence, factors, errors } = record else { continue };
        let shown = OVERVIEW_SHARES.contains(&factors.outliers);
        if !shown
            || *factors
                != (Factors { outliers: factors.outliers, outlier_kind: factors.outlier_kind, ..BASELINE })
        {
            continue;
        }
        let all: Vec<_> = (0..6).filter_map(|i| errors.tally.statistics(i)).collect();
        let most = |f: fn(&EfficiencyStatistics) -> f64| all.iter().map(f).reduce(f64::max);
        let least = |f: fn(&EfficiencyStatistics) -> f64| all.iter().map(f).reduce(f64::min);
        let kind = match (factors.outliers > 0.0, factors.outlier_kind) {
            (false, _) => "",
            (true, OutlierKind::Uniform) => "uniform",
            (true, OutlierKind::Coherent) => "one body",
        };
        let mut row = vec![sequence.as_str().into(), factors.outliers.into(), kind.into()];
        row.extend(contender_cells(&errors.contender));
        row.extend([
            most(|f| f.variance_over_bound).into(),
            most(|f| f.bias_over_sigma.abs()).into(),
            all.first().map(|f| f.nees_over_6).into(),
            least(|f| f.coverage_95).into(),
            least(|f| f.within_3_sigma).into(),
            errors.tally.draws.into(),
            errors.tally.refused.into(),
        ]);
        table.rows.push(row);
    }
    table
}

/// How often each component is reported as observed in the degenerate scenes.
pub(super) fn observed(records: &[EfficiencyRecord]) -> Table {
    let mut columns: Vec<(&str, &str)> =
        vec![("scene", "scene"), ("approach", "approach"), ("method", "method"), ("estimator", "estimator")];
    columns.extend(NAMES.iter().zip(SYMBOLS).map(|(name, heading)| (*name, heading)));
    columns.extend([("within_3_sigma", "within 3 σ"), ("answered", "answered"), ("draws", "draws")]);
    let mut table = Table::new(
        "efficiency-degenerate",
        "What is reported observed",
        "Share of the draws in which each component is reported observed; of those, the share within 3 of their own σ \
         of the truth. 1/8 px of noise, places exact at t.",
        &columns,
    );
    for record in records {
        let EfficiencyRecord::Observed { scene, contender, counts } = record else { continue };
        let mut row = vec![scene.as_str().into()];
        row.extend(contender_cells(contender));
        let share = |count: usize, of: usize| Cell::from((of > 0).then(|| count as f64 / of as f64));
        row.extend(counts.observed.map(|count| share(count, counts.draws)));
        row.push(share(counts.within_3.iter().sum(), counts.observed.iter().sum()));
        row.extend([counts.answered.into(), counts.draws.into()]);
        table.rows.push(row);
    }
    table
}
