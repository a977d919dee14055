//! The factors of the efficiency study and their levels: noise, number of points, outliers.

use serde::{Deserialize, Serialize};

/// Levels of the noise's σ, in pixels: from half to four times the 1/8 px of the paper's real baseline.
pub(super) const NOISE_PX: [f64; 4] = [0.0625, 0.125, 0.25, 0.5];
/// Levels of the number of points, each four times the one before, so that σ of φ halves from level to level.
pub(super) const POINTS: [usize; 4] = [128, 512, 2048, 8192];
/// Levels of the share of outliers; beyond one half a robust estimator may follow them.
pub(super) const OUTLIER_SHARES: [f64; 6] = [0.1, 0.2, 0.3, 0.4, 0.5, 0.6];
/// The levels at which factors stand while another one is swept: 1/8 px at both ends, 2048 points, no outliers.
pub(super) const BASELINE: Factors = Factors {
    noise_px: 0.125,
    ends: Ends::Both,
    points: 2048,
    outliers: 0.0,
    outlier_kind: OutlierKind::Uniform,
};

/// At which ends of a displacement x and y are noisy; disparity is at both.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Ends {
    /// At t and t′.
    Both,
    /// At t′ alone: points are exact pixels at t.
    Later,
}

/// How outliers arise.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum OutlierKind {
    /// Found anywhere within a matcher's reach.
    Uniform,
    /// One body with its own rigid motion.
    Coherent,
}

/// The factors of the experiment, each at one level: noise, number of points, outliers.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Factors {
    /// σ of x, y and d, in pixels; in the differential form of d and of every component of flow.
    pub noise_px: f64,
    /// The ends at which x and y have it.
    pub ends: Ends,
    /// Number of points, outliers included.
    pub points: usize,
    /// Share of outliers among the points.
    pub outliers: f64,
    /// How outliers arise.
    #[serde(rename = "kind")]
    pub outlier_kind: OutlierKind,
}

/// Every level of noise with each of these numbers of points.
pub(super) fn noise_by_points(points: &[usize], ends: Ends) -> Vec<Factors> {
    let of = |&points: &usize| NOISE_PX.map(|noise_px| Factors { noise_px, points, ends, ..BASELINE });
    points.iter().flat_map(of).collect()
}

/// Every level of outliers of a kind.
pub(super) fn outlier_shares(outlier_kind: OutlierKind) -> Vec<Factors> {
    OUTLIER_SHARES.into_iter().map(|outliers| Factors { outliers, outlier_kind, ..BASELINE }).collect()
}
