//! Records of section 7.2 as the paper's tables and figures.

mod comparison;
mod data;
mod figures;
mod lab;
mod recording;
mod speed;
mod tables;

use super::contender::ImageContender;
use super::matching::MatchedFrames;
use super::quantity::Quantity;
use super::record::RealRecord;
use super::statistics::PooledStatistics;
use crate::{Publication, Table};
use egomotion::sim::StereoImages;

/// Three frames and what is matched in them, which Figure 11 shows.
pub(super) type Example<'a> = (&'a [StereoImages; 3], &'a MatchedFrames);

/// Tables and figures of the rendered sequences.
pub(super) fn lab(example: Option<Example<'_>>, records: &[RealRecord]) -> Publication {
    let results = RealResults { records };
    let mut tables = vec![lab::matching(&results)];
    tables.extend(lab::printed(&results));
    Publication {
        title: "Section 7.2: the manipulator's sequences through the whole image pipeline".to_owned(),
        data: vec![data::aggregated(&results, lab::speed), data::draws(records)],
        tables: with_comparisons(tables, &results),
        figures: lab::figures(example, &results),
    }
}

/// Tables and figures of a recording; `name` is that of its sequence.
pub(super) fn recording(name: &str, records: &[RealRecord], example: Option<Example<'_>>) -> Publication {
    let split = recording::by_path(records);
    let results = RealResults { records: &split };
    let speed = |sequence: &str| recording::speed(&results, sequence);
    Publication {
        title: format!("Section 7.2 on a recording: {name}"),
        data: vec![data::aggregated(&results, speed), data::draws(&split)],
        tables: with_comparisons(recording::tables(name, &results), &results),
        figures: recording::figures(name, example, &results),
    }
}

/// These tables, and the two that compare errors, if there are any.
fn with_comparisons(mut tables: Vec<Table>, results: &RealResults<'_>) -> Vec<Table> {
    if results.have_truth() {
        tables.push(comparison::estimators(results));
        tables.push(comparison::consistency(results));
    }
    tables
}

/// The records, and statistics over them.
struct RealResults<'a> {
    records: &'a [RealRecord],
}

impl RealResults<'_> {
    /// Over the draws of one sequence.
    fn get(
        &self,
        sequence: &str,
        contender: Option<ImageContender>,
        quantity: Quantity,
    ) -> Option<PooledStatistics> {
        self.among(|record| record.sequence == sequence, contender, quantity)
    }

    /// Over the draws of which a record says so.
    fn among(
        &self,
        draws: impl Fn(&RealRecord) -> bool,
        contender: Option<ImageContender>,
        quantity: Quantity,
    ) -> Option<PooledStatistics> {
        PooledStatistics::of(self.records, |record| {
            record.contender == contender && record.quantity == quantity && draws(record)
        })
    }

    /// Whether any record knows its truth.
    fn have_truth(&self) -> bool {
        self.records.iter().any(|record| record.truth.is_some())
    }

    /// Names of the sequences, in the order of their records.
    fn sequences(&self) -> Vec<&str> {
        let mut names: Vec<&str> = self.records.iter().map(|record| record.sequence.as_str()).collect();
        names.dedup();
        names
    }
}
