//! The tables of the reliability study.

use super::tally::ReliabilityTally;
use super::{DisparitySource, ReliabilityRecord, ways};
use crate::components::NAMES;
use crate::{Cell, Table};
use egomotion::pipeline::{Approach, EstimatorKind, Method};

/// Columns of the counts.
const COUNTS: [(&str, &str); 9] = [
    ("pairs", "pairs"),
    ("complete", "complete"),
    ("partial", "in part"),
    ("unobservable", "unobservable"),
    ("failed", "failed"),
    ("warned", "warned"),
    ("silently_wrong", "> 8σ, no warning"),
    ("worst_unwarned_sigma", "worst without warning (σ)"),
    ("falsely_warned_percent", "warned without bias (%)"),
];
/// Both sources of disparity.
const SOURCES: [DisparitySource; 2] = [DisparitySource::Exact, DisparitySource::Matched];

/// The records of one way of one sequence.
fn tally(
    records: &[ReliabilityRecord],
    sequence: &str,
    source: DisparitySource,
    way: (Method, Approach, EstimatorKind),
) -> ReliabilityTally {
    let of_way = |r: &&ReliabilityRecord| {
        r.sequence == sequence && r.disparity == source && (r.method, r.approach, r.estimator) == way
    };
    ReliabilityTally::of(&records.iter().filter(of_way).collect::<Vec<_>>())
}

fn counts(tally: &ReliabilityTally) -> Vec<Cell> {
    vec![
        tally.pairs.into(),
        tally.complete.into(),
        tally.partial.into(),
        tally.unobservable.into(),
        tally.failed.into(),
        tally.warned.into(),
        tally.silently_wrong.into(),
        tally.worst_unwarned.into(),
        tally.falsely_warned().map(|share| 100.0 * share).into(),
    ]
}

/// All methods of each sequence.
pub(super) fn by_sequence(sequences: &[String], records: &[ReliabilityRecord]) -> Table {
    let columns: Vec<(&str, &str)> =
        [("sequence", "sequence"), ("disparity", "disparity")].into_iter().chain(COUNTS).collect();
    let caption = "Each pair solved in 18 ways. Failed: refused without naming a direction.";
    let mut table = Table::new("by-sequence", "By sequence", caption, &columns);
    for (sequence, source) in sequences.iter().flat_map(|name| SOURCES.map(|source| (name, source))) {
        let all = ways().map(|way| tally(records, sequence, source, way));
        let total = all.fold(ReliabilityTally::default(), |sum, tally| sum.merged(&tally));
        let mut row: Vec<Cell> = vec![sequence.as_str().into(), name(source).into()];
        row.extend(counts(&total));
        table.rows.push(row);
    }
    table
}

/// All sequences by each method.
pub(super) fn by_method(records: &[ReliabilityRecord]) -> Table {
    let columns: Vec<(&str, &str)> = [
        ("disparity", "disparity"),
        ("method", "method"),
        ("approach", "approach"),
        ("estimator", "estimator"),
    ]
    .into_iter()
    .chain(COUNTS)
    .collect();
    let mut sequences: Vec<&str> = records.iter().map(|record| record.sequence.as_str()).collect();
    sequences.sort_unstable();
    sequences.dedup();
    let mut table = Table::new("by-method", "By method", "Over all sequences.", &columns);
    for (source, way) in SOURCES.into_iter().flat_map(|source| ways().map(move |way| (source, way))) {
        let all = sequences.iter().map(|sequence| tally(records, sequence, source, way));
        let total = all.fold(ReliabilityTally::default(), |sum, tally| sum.merged(&tally));
        let [method, approach, estimator] = words(way);
        let mut row: Vec<Cell> = vec![
            name(source).into(),
            method.as_str().into(),
            approach.as_str().into(),
            estimator.as_str().into(),
        ];
        row.extend(counts(&total));
        table.rows.push(row);
    }
    table
}

fn name(source: DisparitySource) -> &'static str {
    match source {
        DisparitySource::Exact => "exact",
        DisparitySource::Matched => "matched",
    }
}

fn words((method, approach, estimator): (Method, Approach, EstimatorKind)) -> [String; 3] {
    [format!("{method:?}"), format!("{approach:?}"), format!("{estimator:?}")].map(|word| word.to_lowercase())
}

/// Every record.
pub(super) fn every_pair(records: &[ReliabilityRecord]) -> Table {
    let mut names: Vec<String> =
        ["sequence", "pair", "disparity", "method", "approach", "estimator"].map(str::to_owned).to_vec();
    names.extend(NAMES.map(|name| format!("sigmas_{name}")));
    names.extend(["refused", "undetermined", "warning"].map(str::to_owned));
    let columns: Vec<(&str, &str)> = names.iter().map(|name| (name.as_str(), name.as_str())).collect();
    let caption = "Errors over their own standard deviation.";
    let mut table = Table::new("reliability", "Every pair in every way", caption, &columns);
    for record in records {
        let [method, approach, estimator] = words((record.method, record.approach, record.estimator));
        let mut row: Vec<Cell> = vec![
            record.sequence.as_str().into(),
            record.pair.into(),
            name(record.disparity).into(),
            method.as_str().into(),
            approach.as_str().into(),
            estimator.as_str().into(),
        ];
        row.extend(record.sigmas.map(Cell::from));
        row.push(record.refused.as_deref().unwrap_or_default().into());
        row.push(record.undetermined.as_str().into());
        row.push(record.warning.as_deref().unwrap_or_default().into());
        table.rows.push(row);
    }
    table
}
