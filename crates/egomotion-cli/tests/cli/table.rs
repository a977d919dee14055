//! `motion.csv` as scripts read it.

use std::collections::HashMap;
use std::path::Path;

/// The columns, in order, as the contract lists them.
pub const COLUMNS: &str = "frame,time_s,dt_s,tx,ty,tz,wx,wy,wz,\
    cov_00,cov_01,cov_02,cov_03,cov_04,cov_05,cov_11,cov_12,cov_13,cov_14,cov_15,\
    cov_22,cov_23,cov_24,cov_25,cov_33,cov_34,cov_35,cov_44,cov_45,cov_55,\
    rows,inliers,observed,impact_s,impact_lo_s,impact_hi_s,status";

/// One row by column.
pub struct Row(HashMap<String, String>);

impl Row {
    pub fn text(&self, column: &str) -> &str {
        &self.0[column]
    }

    pub fn number(&self, column: &str) -> f64 {
        self.text(column).parse().unwrap_or_else(|e| panic!("{column} {:?}: {e}", self.text(column)))
    }

    pub fn frame(&self) -> usize {
        self.text("frame").parse().unwrap()
    }

    pub fn status(&self) -> &str {
        self.text("status")
    }

    /// (tx, ty, tz, wx, wy, wz).
    pub fn phi(&self) -> [f64; 6] {
        ["tx", "ty", "tz", "wx", "wy", "wz"].map(|column| self.number(column))
    }
}

/// The rows of `motion.csv` in a folder of results.
pub fn motion(out: &Path) -> Vec<Row> {
    let mut reader = csv::Reader::from_path(out.join("motion.csv")).unwrap();
    let head: Vec<String> = reader.headers().unwrap().iter().map(String::from).collect();
    let rows = reader.records().map(|record| {
        let record = record.unwrap();
        Row(head.iter().cloned().zip(record.iter().map(String::from)).collect())
    });
    rows.collect()
}
