//! `trajectory_covariance.csv`: how certain each pose is, relative to the first.

use std::path::Path;

use nalgebra::Matrix6;

use super::motion_table::{covariance_columns, upper_triangle};
use crate::{IoError, write};

/// The table as text; numbers are written so that they read back the same, infinite ones as `inf`.
///
/// Each pose has its frame, its time in seconds, and the covariance of δ in T = T̂ exp(δ), 6×6: (translation, rotation) in
/// metres and radians.
pub fn text(poses: impl Iterator<Item = (usize, f64, Matrix6<f64>)>) -> String {
    let columns = ["frame", "time_s"].map(String::from).into_iter().chain(covariance_columns("cov"));
    let mut text = columns.collect::<Vec<_>>().join(",") + "\n";
    for (frame, time_s, cov) in poses {
        text += &format!("{frame},{time_s:?}");
        upper_triangle().for_each(|at| text += &format!(",{:?}", cov[at]));
        text.push('\n');
    }
    text
}

/// Write the table.
///
/// # Errors
/// The file cannot be written.
pub fn write(path: &Path, poses: impl Iterator<Item = (usize, f64, Matrix6<f64>)>) -> Result<(), IoError> {
    write::bytes(path, text(poses).as_bytes())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_row_is_the_upper_triangle_row_by_row() {
        let cov = Matrix6::from_fn(|i, j| 0.5 * (10 * i.min(j) + i.max(j)) as f64);
        let unknown = Matrix6::from_diagonal_element(f64::INFINITY);
        let text = text([(3, 0.25, cov), (4, 0.5, unknown)].into_iter());
        let lines: Vec<&str> = text.lines().collect();
        assert!(lines[0].starts_with("frame,time_s,cov_00,cov_01,") && lines[0].ends_with(",cov_45,cov_55"));
        assert!(lines[1].starts_with("3,0.25,0.0,0.5,1.0,1.5,2.0,2.5,5.5,6.0,"), "{}", lines[1]);
        assert!(lines[2].starts_with("4,0.5,inf,0.0,0.0,0.0,0.0,0.0,inf,"), "{}", lines[2]);
        assert!(lines.iter().all(|line| line.split(',').count() == 2 + 21));
    }
}
