//! Tables 3 to 7 in the paper's form, for sequences of any origin.

use super::RealResults;
use crate::real::contender::{ImageContender, ImageEstimator};
use crate::real::printed::PrintedDepthVelocity;
use crate::real::quantity::Quantity;
use crate::real::statistics::PooledStatistics;
use crate::{Cell, Table};
use egomotion::pipeline::{Approach, Method};

/// What the median rows of Tables 3 and 6 hold.
pub(super) const MEDIANS: &str = "Means over pixels are at the mercy of a few wrong matches; so the row \"median\" below each has \
     the median over the draws of the median over the pixels: of −VZ, and in the place of ERM of the absolute relative error.";

/// A table of the paper: the stem of its file, its title, and how to read it.
#[derive(Debug, Clone, Copy)]
pub(super) struct Heading<'a> {
    pub(super) id: &'a str,
    pub(super) title: &'a str,
    pub(super) caption: &'a str,
}

/// A sequence in Table 3 or 6.
pub(super) struct DepthVelocityEntry<'a> {
    /// Its name in the table.
    pub(super) label: &'a str,
    /// The name in its records.
    pub(super) sequence: String,
    /// Whether VZ is much the same all over the image: then its mean is given, and the signed ERM.
    pub(super) constant: bool,
    /// The paper's values.
    pub(super) paper: Option<&'a PrintedDepthVelocity>,
    /// Our rows: which pixels count.
    pub(super) sources: &'a [(&'static str, Quantity)],
}

/// Table 3 or 6: the paper's row, then two rows for each choice of pixels.
pub(super) fn vz(
    results: &RealResults<'_>,
    heading: Heading<'_>,
    approach: Approach,
    entries: &[DepthVelocityEntry<'_>],
) -> Table {
    let mut table = Table::new(
        heading.id,
        heading.title,
        heading.caption,
        &[
            ("sequence", "sequence"),
            ("source", ""),
            ("estimated_dcce", "−VZ (mm) DCCE"),
            ("estimated_dv", "DV"),
            ("estimated_ml", "ML"),
            ("true", "true"),
            ("erm_dcce", "ERM (%) DCCE"),
            ("erm_dv", "DV"),
            ("erm_ml", "ML"),
            ("std_dcce", "STD (%) DCCE"),
            ("std_dv", "DV"),
            ("std_ml", "ML"),
        ],
    );
    let contenders = [
        ImageContender::new(approach, Method::Dcce, ImageEstimator::Pixel),
        ImageContender::new(approach, Method::Dv, ImageEstimator::Pixel),
        ImageContender::BEST,
    ];
    for entry in entries {
        table.rows.extend(entry.paper.map(papers_row));
        for (source, quantity) in entry.sources {
            let found = contenders.map(|contender| results.get(&entry.sequence, Some(contender), *quantity));
            table.rows.extend(mean_and_median(entry, source, &found));
        }
    }
    table
}

fn papers_row(row: &PrintedDepthVelocity) -> Vec<Cell> {
    let pair = |pair: [f64; 2]| [pair[0].into(), pair[1].into(), Cell::Empty];
    let mut cells: Vec<Cell> = vec![row.letter.into(), "paper".into()];
    cells.extend(row.estimated_mm.map_or([Cell::Empty, Cell::Empty, Cell::Empty], pair));
    cells.push(row.true_mm.into());
    cells.extend(pair(row.erm_percent).into_iter().chain(pair(row.std_percent)));
    cells
}

/// The means of three contenders, and below them the medians.
fn mean_and_median(
    entry: &DepthVelocityEntry<'_>,
    source: &str,
    found: &[Option<PooledStatistics>; 3],
) -> [Vec<Cell>; 2] {
    let each = |value: fn(&PooledStatistics) -> Option<f64>| {
        found.each_ref().map(|found| Cell::from(found.as_ref().and_then(value)))
    };
    let empty = || [Cell::Empty, Cell::Empty, Cell::Empty];
    let truth = found.iter().flatten().find_map(|found| found.truth).filter(|_| entry.constant);
    let row = |name: &str, groups: [[Cell; 3]; 3]| -> Vec<Cell> {
        let [estimated, erm, std] = groups;
        let mut cells: Vec<Cell> = vec![entry.label.into(), name.into()];
        cells.extend(estimated);
        cells.push(truth.map(|truth| -truth).into());
        cells.extend(erm.into_iter().chain(std));
        cells
    };
    let (mean, median, erm) = if entry.constant {
        let signed = each(|found| found.erm_signed.map(|erm| erm.mean));
        (each(|found| Some(-found.estimate)), each(|found| Some(-found.median)), signed)
    } else {
        (empty(), empty(), each(|found| found.erm_abs.map(|erm| erm.mean)))
    };
    [
        row(source, [mean, erm, each(|found| found.std_percent)]),
        row(&format!("{source}, median"), [median, each(|found| found.erm_median), empty()]),
    ]
}

/// A sequence in Table 4, 5 or 7.
pub(super) struct MotionEntry<'a> {
    /// Its name in the table.
    pub(super) label: &'a str,
    /// The name in its records.
    pub(super) sequence: String,
    /// Rows above ours: the truth and the paper's values.
    pub(super) above: Vec<(&'static str, [Option<f64>; 6])>,
}

/// Table 4, 5 or 7: the truth, the paper's estimates, ours.
pub(super) fn phi(
    results: &RealResults<'_>,
    heading: Heading<'_>,
    approach: Approach,
    entries: &[MotionEntry<'_>],
) -> Table {
    let mut columns = vec![("sequence", "sequence"), ("row", "")];
    columns.extend(Quantity::PHI.map(|quantity| (quantity.name(), quantity.heading())));
    let mut table = Table::new(heading.id, heading.title, heading.caption, &columns);
    for entry in entries {
        for (name, values) in &entry.above {
            let mut cells: Vec<Cell> = vec![entry.label.into(), (*name).into()];
            cells.extend(values.map(Cell::from));
            table.rows.push(cells);
        }
        for contender in contenders(approach) {
            let mut cells: Vec<Cell> = vec![entry.label.into(), contender.label().as_str().into()];
            cells.extend(Quantity::PHI.map(|quantity| {
                mean_scatter_median(results.get(&entry.sequence, Some(contender), quantity), quantity)
            }));
            table.rows.push(cells);
        }
    }
    table
}

/// The contenders of an approach, in the order of the rows; the best one last.
pub(super) fn contenders(approach: Approach) -> Vec<ImageContender> {
    let methods: &[Method] = match approach {
        Approach::Differential => &[Method::Dcce, Method::Dv],
        Approach::Discrete => &[Method::Linear22, Method::Rigid, Method::Dcce, Method::Dv],
    };
    let both = |&method: &Method| {
        [ImageEstimator::Ls, ImageEstimator::Lmeds].map(|e| ImageContender::new(approach, method, e))
    };
    methods.iter().flat_map(both).chain([ImageContender::BEST]).collect()
}

/// Mean ± scatter (median), with as many digits as the paper prints.
fn mean_scatter_median(found: Option<PooledStatistics>, quantity: Quantity) -> Cell {
    let Some(found) = found else { return Cell::Empty };
    let digits = if matches!(quantity, Quantity::Tx | Quantity::Ty | Quantity::Tz) { 2 } else { 3 };
    // One digit more where the scatter would vanish.
    let digits = digits + usize::from(found.scatter < 2.0 * 0.1f64.powi(digits as i32));
    let [estimate, median] =
        [found.estimate, found.median].map(|value| format!("{value:.digits$}").replace('-', "−"));
    Cell::Text(format!("{estimate} ± {:.digits$} ({median})", found.scatter))
}
