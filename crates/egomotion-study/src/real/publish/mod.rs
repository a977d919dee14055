//! Records of section 7.2 as the paper's tables and figures.

mod comparison;
mod data;
mod figures;
mod recording;
mod tables;

use super::lab::LabStudy;
use super::record::{Record, Summary};
use super::way::{Quantity, Way};
use crate::Publication;
use egomotion::sim::Sequence;

/// All that the records of the lab say.
pub(super) fn lab(study: &LabStudy, records: &[Record]) -> Publication {
    let results = Results { records };
    let mut tables = vec![tables::matching(&results)];
    tables.extend(tables::printed(&results));
    tables.push(comparison::estimators(&results));
    tables.push(comparison::consistency(&results));
    Publication {
        title: "Section 7.2: the manipulator's sequences through the whole image pipeline".to_owned(),
        data: vec![data::aggregated(&results), data::draws(records)],
        tables,
        figures: figures::all(study, &results),
    }
}

/// All that the records of a recording say; `name` is that of its sequence.
pub(super) fn recording(name: &str, records: &[Record]) -> Publication {
    let results = Results { records };
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

/// What the records say.
struct Results<'a> {
    records: &'a [Record],
}

impl Results<'_> {
    /// Over the draws of one sequence.
    fn get(&self, sequence: &str, way: Option<Way>, quantity: Quantity) -> Option<Summary> {
        Summary::of(self.records, |record| {
            record.way == way && record.quantity == quantity && record.sequence == sequence
        })
    }

    /// Over the draws of the lab sequence of that letter.
    fn lab(&self, letter: &str, way: Option<Way>, quantity: Quantity) -> Option<Summary> {
        self.get(&lab_name(letter), way, quantity)
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
