//! All records, and their summaries, as files.

use super::RealResults;
use crate::real::contender::ImageContender;
use crate::real::quantity::Quantity;
use crate::real::record::RealRecord;
use crate::real::statistics::PooledStatistics;
use crate::{Cell, Table};

/// One row for each sequence, contender and quantity, in the columns that all studies share, and the medians.
pub(super) fn aggregated(results: &RealResults<'_>, speed: impl Fn(&str) -> Option<f64>) -> Table {
    let columns = [
        "sequence",
        "baseline",
        "sweep",
        "value",
        "approach",
        "method",
        "estimator",
        "quantity",
        "erm_signed",
        "erm_abs",
        "eam",
        "std",
        "standard_error",
        "n",
        "estimate",
        "truth",
        "scatter",
        "median",
        "erm_median",
        "eam_median",
    ];
    let mut table = Table::new(
        "real",
        "Section 7.2, summed up",
        "ERM in percent, all else in mm, degrees or pixels; std is in percent where there is an ERM; that of VZ is over pixels and draws, all other std and \
         the scatter of the estimate are over draws; n counts draws; value is the sequence's speed in mm or degrees. \
         Medians are over draws: of the estimate, of the absolute relative error, of EAM; of VZ those of the estimate and the relative error are of medians over pixels.",
        &columns.map(|name| (name, name)),
    );
    let mut seen: Vec<(&str, Option<ImageContender>, Quantity)> = Vec::new();
    for record in results.records {
        let key = (record.sequence.as_str(), record.contender, record.quantity);
        if !seen.contains(&key) {
            seen.push(key);
        }
    }
    for (sequence, contender, quantity) in seen {
        let chosen =
            |r: &RealRecord| r.sequence == sequence && r.contender == contender && r.quantity == quantity;
        let Some(found) = PooledStatistics::of(results.records, chosen) else { continue };
        let mut row: Vec<Cell> =
            vec![sequence.into(), "images".into(), "speed".into(), speed(sequence).into()];
        row.extend(names(contender).map(Cell::from));
        row.push(quantity.name().into());
        let means = [found.erm_signed, found.erm_abs, found.eam].map(|error| error.map(|error| error.mean));
        row.extend(means.into_iter().chain([found.std_percent.or(Some(found.std))]).map(Cell::from));
        row.extend([found.error().and_then(|error| error.standard_error).into(), found.n.into()]);
        let last = [Some(found.estimate), found.truth, Some(found.scatter), Some(found.median)];
        row.extend(last.into_iter().chain([found.erm_median, found.eam_median]).map(Cell::from));
        table.rows.push(row);
    }
    table
}

/// One row for each record.
pub(super) fn draws(records: &[RealRecord]) -> Table {
    let columns = [
        "sequence",
        "pose",
        "seed",
        "approach",
        "method",
        "estimator",
        "quantity",
        "estimate",
        "truth",
        "error",
        "sigma",
        "erm_signed",
        "erm_abs",
        "eam",
        "std",
        "n",
        "median",
        "erm_median",
    ];
    let mut table = Table::new(
        "real-draws",
        "Section 7.2, every draw",
        "Estimate, truth and error in mm, degrees or pixels; of VZ their means over n pixels. sigma is what the \
         estimator itself states; median and erm_median are over the pixels.",
        &columns.map(|name| (name, name)),
    );
    for record in records {
        let mut row: Vec<Cell> = vec![
            record.sequence.as_str().into(),
            Cell::Number(record.pose as f64),
            record.seed.to_string().as_str().into(),
        ];
        row.extend(names(record.contender).map(Cell::from));
        row.push(record.quantity.name().into());
        let error = record.truth.map(|truth| record.estimate - truth);
        row.extend([Some(record.estimate), record.truth, error, record.sigma].map(Cell::from));
        row.extend([record.erm_signed, record.erm_abs, record.eam, Some(record.std)].map(Cell::from));
        row.extend([record.n.into(), record.median.into(), record.erm_median.into()]);
        table.rows.push(row);
    }
    table
}

fn names(contender: Option<ImageContender>) -> [&'static str; 3] {
    contender.map_or(["", "matching", ""], |contender| contender.names())
}
