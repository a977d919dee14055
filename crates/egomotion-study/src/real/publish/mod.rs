//! Records of section 7.2 as the paper's tables and figures.

mod comparison;
mod data;
mod figures;
mod recording;
mod tables;

use super::contender::ImageContender;
use super::matching::MatchedFrames;
use super::quantity::Quantity;
use super::record::RealRecord;
use super::statistics::PooledStatistics;
use crate::Publication;
use egomotion::sim::{Sequence, StereoImages};

/// Tables and figures of the rendered sequences; `example` is what Figure 11 shows.
pub(super) fn lab(
    example: Option<&([StereoImages; 3], MatchedFrames)>,
    records: &[RealRecord],
) -> Publication {
    let results = RealResults { records };
    let mut tables = vec![tables::matching(&results)];
    tables.extend(tables::printed(&results));
    tables.push(comparison::estimators(&results));
    tables.push(comparison::consistency(&results));
    Publication {
        title: "Section 7.2: the manipulator's sequences through the whole image pipeline".to_owned(),
        data: vec![data::aggregated(&results), data::draws(records)],
        tables,
        figures: figures::all(example, &results),
    }
}

/// Tables and figures of a recording; `name` is that of its sequence.
pub(super) fn recording(name: &str, records: &[RealRecord]) -> Publication {
    let results = RealResults { records };
    let mut tables = recording::tables(name, &results);
    tables.push(comparison::estimators(&results));
    tables.push(comparison::consistency(&results));
    Publication {
        title: format!("Section 7.2 on a recording: {name}"),
        data: vec![data::aggregated(&results), data::draws(records)],
        tables,
        figures: recording::figures(&results),
    }
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
        PooledStatistics::of(self.records, |record| {
            record.contender == contender && record.quantity == quantity && record.sequence == sequence
        })
    }

    /// Over the draws of the lab sequence of that letter.
    fn lab(
        &self,
        letter: &str,
        contender: Option<ImageContender>,
        quantity: Quantity,
    ) -> Option<PooledStatistics> {
        self.get(&lab_name(letter), contender, quantity)
    }

    /// Names of the sequences, in the order of their records.
    fn sequences(&self) -> Vec<&str> {
        let mut names: Vec<&str> = self.records.iter().map(|record| record.sequence.as_str()).collect();
        names.dedup();
        names
    }

    /// Letters of the lab sequences that have records, in the paper's order.
    fn letters(&self) -> Vec<&'static str> {
        let known = self.sequences();
        let letters = Sequence::lab_names().filter(|name| known.contains(name));
        letters.filter_map(|name| name.strip_prefix("lab-")).collect()
    }
}

fn lab_name(letter: &str) -> String {
    format!("lab-{letter}")
}
