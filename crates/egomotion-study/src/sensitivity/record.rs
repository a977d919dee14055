//! The records of the sensitivity studies, and their rows in a file.

use serde::{Deserialize, Serialize};

use super::errors::QuantityErrors;
use crate::{Cell, Table};

/// Columns of the file, each with its heading on a page.
const COLUMNS: [(&str, &str); 14] = [
    ("sequence", "sequence"),
    ("baseline", "baseline"),
    ("sweep", "sweep"),
    ("value", "value"),
    ("approach", "approach"),
    ("method", "method"),
    ("estimator", "estimator"),
    ("quantity", "quantity"),
    ("erm_signed", "ERM, signed (%)"),
    ("erm_abs", "ERM (%)"),
    ("eam", "EAM (mm, °)"),
    ("std", "STD (%; mm, °)"),
    ("standard_error", "standard error"),
    ("n", "draws"),
];

/// Errors of one quantity by one contender at one setting: a row of the study's file, its errors still as sums.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SensitivityRecord {
    /// The sequence: `A`, `B`, `C`.
    pub sequence: String,
    /// `clean` or `real`; `custom` for a single setting that is neither.
    pub baseline: String,
    /// The swept parameter; `table` for a single setting.
    pub sweep: String,
    /// The swept parameter's value, `inf` for no rounding; STEP for a single setting.
    pub value: String,
    /// The contender, the quantity and its errors.
    #[serde(rename = "score")]
    pub errors: QuantityErrors,
}

impl SensitivityRecord {
    fn cells(&self) -> Option<Vec<Cell>> {
        let found = self.errors.tally.statistics()?;
        let words = [&self.sequence, &self.baseline, &self.sweep, &self.value];
        let who = [&self.errors.approach, &self.errors.method, &self.errors.estimator, &self.errors.quantity];
        let mut cells: Vec<Cell> = words.into_iter().chain(who).map(|w| Cell::from(w.as_str())).collect();
        let numbers = [found.erm_signed, found.erm_abs, Some(found.eam), found.std, found.standard_error];
        cells.extend(numbers.map(Cell::from));
        cells.push(found.n.into());
        Some(cells)
    }

    /// Whether it holds the Cramér–Rao bound instead of a contender.
    pub(super) fn is_bound(&self) -> bool {
        self.errors.method == "bound"
    }
}

/// A table of the records that have a draw.
pub(super) fn rows<'a>(
    id: &str,
    title: &str,
    caption: &str,
    records: impl Iterator<Item = &'a SensitivityRecord>,
) -> Table {
    let mut table = Table::new(id, title, caption, &COLUMNS);
    table.rows = records.filter_map(SensitivityRecord::cells).collect();
    table
}

/// A swept value in files; `inf` for no rounding.
pub(super) fn value_name(value: f64) -> String {
    if value.is_finite() { value.to_string() } else { "inf".to_owned() }
}
