//! Figures 7, 8 and 9.

use super::Record;
use crate::study::Figure;

pub(super) fn figures(_sequences: &[String], _records: &[Record]) -> Vec<Figure> {
    Vec::new()
}
