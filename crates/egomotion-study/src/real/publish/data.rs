//! All records, and their summaries, as files.

use super::RealResults;
use crate::real::contender::ImageContender;
use crate::real::quantity::Quantity;
use crate::real::record::RealRecord;
use crate::real::statistics::PooledStatistics;
use crate::sequences::two_frames;
use crate::{Cell, Table};

/// One row for each sequence, contender and quantity, in the columns that all studies share.
pub(super) fn aggregated(results: &RealResults<'_>) -> Table {
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
    ];
    let mut table = Table::new(
        "real",
        "Section 7.2, summed up",
        "ERM in percent, all else in mm, degrees or pixels; std is in percent where there is an ERM; that of VZ is over pixels and draws, all other std and \
         the scatter of the estimate are over draws; n counts draws; value is the sequence's speed in mm or degrees.",
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
        row.extend(
            [found.erm_signed, found.erm_abs, Some(found.eam), found.std_percent.or(Some(found.std))]
                .map(Cell::from),
        );
        row.extend([found.standard_error.into(), found.n.into()]);
        row.extend([found.estimate, found.truth, found.scatter].map(Cell::from));
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
    ];
    let mut table = Table::new(
        "real-draws",
        "Section 7.2, every draw",
        "Estimate, truth and error in mm, degrees or pixels; of VZ their means over n pixels. sigma is what the \
         estimator itself states.",
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
        row.extend([record.estimate, record.truth, record.estimate - record.truth].map(Cell::from));
        row.extend([record.sigma, record.erm_signed, record.erm_abs].map(Cell::from));
        row.extend([record.eam.into(), record.std.into(), record.n.into()]);
        table.rows.push(row);
    }
    table
}

fn names(contender: Option<ImageContender>) -> [&'static str; 3] {
    contender.map_or(["", "matching", ""], |contender| contender.names())
}

/// How fast a sequence is: |tZ| in mm per frame, or |ΩY| in degrees per frame where it only turns.
pub(super) fn speed(sequence: &str) -> Option<f64> {
    let phi = two_frames(sequence)?.phi_cyclopean(0)?;
    let (forward, turn) = (1e3 * phi.t.z.abs(), phi.omega.y.to_degrees().abs());
    Some(if forward > 0.0 { forward } else { turn })
}
