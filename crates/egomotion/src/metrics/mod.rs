//! How good an answer is: trajectory errors, the paper's relative errors, and whether the stated
//! uncertainty is true.

mod absolute;
mod association;
mod consistency;
mod drift;
mod relative;
mod section_seven;

pub use absolute::{Similarity, TrajectoryAlignment, absolute_errors_m, align};
pub use association::associate;
pub use consistency::{Coverage, Nees};
pub use drift::{Drift, KITTI_LENGTHS_M, kitti_drift};
pub use relative::{
    Delta, PoseError, RelativePoseError, pairs, relative_pose_error, relative_pose_errors, travelled_m,
};
pub use section_seven::SectionSeven;

pub use crate::geometry::order_statistics::quantile;

/// Statistics of many errors, in their own unit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ErrorStatistics {
    /// Root mean square.
    pub rmse: f64,
    /// Mean.
    pub mean: f64,
    /// Median.
    pub median: f64,
    /// Standard deviation about the mean (n).
    pub std: f64,
    /// Least.
    pub min: f64,
    /// Greatest.
    pub max: f64,
    /// Sum of squares.
    pub sse: f64,
    /// Number of errors.
    pub count: usize,
}

impl ErrorStatistics {
    /// Of some errors; `None` if there are none.
    pub fn of(errors: &[f64]) -> Option<Self> {
        let mean = mean(errors)?;
        let sse: f64 = errors.iter().map(|e| e * e).sum();
        let n = errors.len() as f64;
        Some(Self {
            rmse: (sse / n).sqrt(),
            mean,
            median: quantile(errors, 0.5)?,
            std: (errors.iter().map(|e| (e - mean).powi(2)).sum::<f64>() / n).sqrt(),
            min: quantile(errors, 0.0)?,
            max: quantile(errors, 1.0)?,
            sse,
            count: errors.len(),
        })
    }
}

fn mean(values: &[f64]) -> Option<f64> {
    (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
}

fn mean_abs(values: &[f64]) -> Option<f64> {
    (!values.is_empty()).then(|| values.iter().map(|v| v.abs()).sum::<f64>() / values.len() as f64)
}

fn root_mean_square(values: &[f64]) -> Option<f64> {
    (!values.is_empty()).then(|| (values.iter().map(|v| v * v).sum::<f64>() / values.len() as f64).sqrt())
}

fn standard_deviation(values: &[f64]) -> Option<f64> {
    let centre = mean(values)?;
    let squares: f64 = values.iter().map(|v| (v - centre).powi(2)).sum();
    (values.len() > 1).then(|| (squares / (values.len() - 1) as f64).sqrt())
}
