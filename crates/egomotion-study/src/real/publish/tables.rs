//! Tables 3 to 7 in the paper's form, its own values beside ours.

use super::{RealResults, lab_name};
use crate::components::in_mm_deg;
use crate::real::contender::{ImageContender, ImageEstimator};
use crate::real::printed::{MmDeg, PrintedDepthVelocity, TABLE_3, TABLE_6, TABLE_7, TABLES_4_5};
use crate::real::quantity::Quantity;
use crate::real::statistics::PooledStatistics;
use crate::sequences::two_frames;
use crate::{Cell, Table};
use egomotion::pipeline::{Approach, Method};

/// How well the images were matched.
pub(super) fn matching(results: &RealResults<'_>) -> Table {
    let mut table = Table::new(
        "real-matching",
        "What the methods had to work with",
        "Median errors of computed disparity (before it is rounded) and of computed flow against the exact maps.",
        &[("sequence", "sequence"), ("disparity_px", "disparity (px)"), ("flow_px", "flow (px)")],
    );
    for letter in results.letters() {
        let median = |quantity| results.lab(letter, None, quantity).map(|found| found.estimate);
        table.rows.push(vec![
            letter.into(),
            median(Quantity::Disparity).into(),
            median(Quantity::Flow).into(),
        ]);
    }
    table
}

/// Tables 3 to 7.
pub(super) fn printed(results: &RealResults<'_>) -> Vec<Table> {
    let turning = |letter: &str| ["A", "B", "C", "D"].contains(&letter);
    vec![
        vz(
            results,
            ("table-03", "Table 3. Estimation of VZ: differential approach"),
            Approach::Differential,
            &TABLE_3,
        ),
        phi(
            results,
            ("table-04", "Table 4. Estimation of φ, turning: differential approach"),
            Approach::Differential,
            turning,
        ),
        phi(
            results,
            ("table-05", "Table 5. Estimation of φ, translating and mixed: differential approach"),
            Approach::Differential,
            |letter| !turning(letter),
        ),
        vz(
            results,
            ("table-06", "Table 6. Estimation of VZ: discrete approach"),
            Approach::Discrete,
            &TABLE_6,
        ),
        phi(
            results,
            ("table-07", "Table 7. Estimation of φ: discrete approach"),
            Approach::Discrete,
            |_| true,
        ),
    ]
}

/// Table 3 or 6: three rows for each sequence.
fn vz(
    results: &RealResults<'_>,
    (id, title): (&str, &str),
    approach: Approach,
    printed: &[PrintedDepthVelocity],
) -> Table {
    let mut table = Table::new(
        id,
        title,
        "As in the paper: −VZ in mm per frame for E to M, whose ERM is signed; in A to D VZ varies from point to point \
         and ERM is absolute. \"Here\" counts pixels whose neighbours lie on one surface and which both cameras see, \
         \"here, anywhere\" all that were measured. The last column of each group is maximum likelihood, which \
         the paper did not have.",
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
    let letters = results.letters();
    for row in printed.iter().filter(|row| letters.contains(&row.letter)) {
        let constant = row.true_mm.is_some();
        let mut cells: Vec<Cell> = vec![row.letter.into(), "paper".into()];
        let pair = |pair: [f64; 2]| [pair[0].into(), pair[1].into(), Cell::Empty];
        cells.extend(row.estimated_mm.map_or([Cell::Empty, Cell::Empty, Cell::Empty], pair));
        cells.push(row.true_mm.into());
        cells.extend(pair(row.erm_percent).into_iter().chain(pair(row.std_percent)));
        table.rows.push(cells);
        for (source, quantity) in [("here", Quantity::Vz), ("here, anywhere", Quantity::VzAnywhere)] {
            let found = contenders.map(|contender| results.lab(row.letter, Some(contender), quantity));
            let each = |value: fn(&PooledStatistics) -> Option<f64>| {
                found.each_ref().map(|found| Cell::from(found.as_ref().and_then(value)))
            };
            let mut cells: Vec<Cell> = vec![row.letter.into(), source.into()];
            if constant {
                cells.extend(each(|found| Some(-found.estimate)));
                cells.push(found[0].as_ref().map(|found| -found.truth).into());
                cells.extend(each(|found| found.erm_signed));
            } else {
                cells.extend(vec![Cell::Empty; 4]);
                cells.extend(each(|found| found.erm_abs));
            }
            cells.extend(each(|found| found.std_percent));
            table.rows.push(cells);
        }
    }
    table
}

/// Table 4, 5 or 7: the truth, the paper's estimates, ours.
fn phi(
    results: &RealResults<'_>,
    (id, title): (&str, &str),
    approach: Approach,
    chosen: impl Fn(&str) -> bool,
) -> Table {
    let mut columns = vec![("sequence", "sequence"), ("row", "")];
    columns.extend(Quantity::PHI.map(|quantity| (quantity.name(), quantity.heading())));
    let mut table = Table::new(
        id,
        title,
        "mm and degrees per frame, of the camera between the two. Ours: mean ± standard deviation from draw to draw. The paper \
         gives one estimate for each sequence, and does not say whether by least squares or by least median of \
         squares.",
        &columns,
    );
    for letter in results.letters().into_iter().filter(|letter| chosen(letter)) {
        for (name, values) in printed_rows(letter, approach) {
            let mut cells: Vec<Cell> = vec![letter.into(), name.into()];
            cells.extend(values.map(Cell::from));
            table.rows.push(cells);
        }
        for contender in contenders(approach) {
            let mut cells: Vec<Cell> = vec![letter.into(), contender.label().into()];
            cells.extend(
                Quantity::PHI.map(|quantity| {
                    mean_and_scatter(results.lab(letter, Some(contender), quantity), quantity)
                }),
            );
            table.rows.push(cells);
        }
    }
    table
}

/// The truth and the paper's values of one sequence.
fn printed_rows(letter: &str, approach: Approach) -> Vec<(&'static str, MmDeg)> {
    let mut rows = Vec::new();
    let sequence = two_frames(&lab_name(letter));
    rows.extend(sequence.and_then(|s| s.phi_cyclopean(0)).map(|phi| ("exact", in_mm_deg(&phi))));
    if approach == Approach::Differential {
        for row in TABLES_4_5.iter().filter(|row| row.letter == letter) {
            rows.extend([("paper: DCCE", row.dcce), ("paper: DV", row.dv)]);
        }
    } else {
        rows.extend(TABLE_7.iter().filter(|row| row.0 == letter).map(|row| ("paper: estimated", row.1)));
    }
    rows
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

/// Mean ± scatter, with as many digits as the paper prints.
pub(super) fn mean_and_scatter(found: Option<PooledStatistics>, quantity: Quantity) -> Cell {
    let Some(found) = found else { return Cell::Empty };
    let digits = if matches!(quantity, Quantity::Tx | Quantity::Ty | Quantity::Tz) { 2 } else { 3 };
    // One digit more where the scatter would vanish.
    let digits = digits + i32::from(found.scatter < 2.0 * 0.1f64.powi(digits));
    let estimate = format!("{:.*}", digits as usize, found.estimate).replace('-', "−");
    Cell::Text(format!("{estimate} ± {:.*}", digits as usize, found.scatter))
}
