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
pub use drift::{Drift, KITTI_LENGTHS_M, KITTI_START_EVERY, kitti_drift};
pub use relative::{
    Delta, PoseError, RelativePoseError, pairs, relative_pose_error, relative_pose_errors, travelled_m,
};
pub use section_seven::SectionSeven;

/// What many errors have in common, in their own unit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Spread {
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

impl Spread {
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

/// The `q` quantile (0 … 1), interpolated linearly between the sorted values; `None` if there are none.
///
/// At ½ it is the median, with the mean of the two middle values of an even count.
pub fn quantile(values: &[f64], q: f64) -> Option<f64> {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let last = sorted.len().checked_sub(1)?;
    let at = q.clamp(0.0, 1.0) * last as f64;
    let (low, high) = (sorted[at.floor() as usize], sorted[(at.ceil() as usize).min(last)]);
    Some(if low == high { low } else { low + (high - low) * at.fract() })
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
