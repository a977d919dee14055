//! Records of section 7.2 as the paper's tables and figures.

mod comparison;
mod data;
mod figures;
mod tables;

use super::lab::LabStudy;
use super::record::{Record, Summary};
use super::way::{Quantity, Way};
use crate::study::Publication;

/// All that the records say.
pub(super) fn lab(study: &LabStudy, records: &[Record]) -> Publication {
    let results = Results { study, records };
    let mut tables = vec![tables::matching(&results)];
    tables.extend(tables::printed(&results));
    tables.push(comparison::estimators(&results));
    tables.push(comparison::consistency(&results));
    Publication {
        title: "Section 7.2: the manipulator's sequences through the whole image pipeline".to_owned(),
        data: vec![data::aggregated(&results), data::draws(records)],
        tables,
        figures: figures::all(&results),
    }
}

/// The records with what they belong to.
struct Results<'a> {
    study: &'a LabStudy,
    records: &'a [Record],
}

impl Results<'_> {
    /// What the draws of the lab sequence of that letter say.
    fn get(&self, letter: &str, way: Option<Way>, quantity: Quantity) -> Option<Summary> {
        let name = format!("lab-{letter}");
        Summary::of(self.records, |record| {
            record.way == way && record.quantity == quantity && record.sequence == name
        })
    }

    /// Letters of the study's sequences, in the paper's order.
    fn letters(&self) -> Vec<&'static str> {
        let chosen = |name: &&str| self.study.sequences.iter().any(|known| known.eq_ignore_ascii_case(name));
        crate::sim::Sequence::lab_names()
            .filter(chosen)
            .filter_map(|name| name.strip_prefix("lab-"))
            .collect()
    }
}
