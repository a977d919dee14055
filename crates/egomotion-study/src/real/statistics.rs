//! Statistics over the draws of one sequence.

use super::record::{RealRecord, moments};
use egomotion::metrics::quantile;

/// Statistics of one quantity by one contender, over the draws of one sequence.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct PooledStatistics {
    /// Mean estimate.
    pub(super) estimate: f64,
    /// Median over the draws of the estimate, of VZ of its median over the pixels.
    pub(super) median: f64,
    /// Standard deviation of the estimate from draw to draw.
    pub(super) scatter: f64,
    /// Mean truth.
    pub(super) truth: Option<f64>,
    /// Signed ERM in percent.
    pub(super) erm_signed: Option<MeanError>,
    /// Absolute ERM in percent.
    pub(super) erm_abs: Option<MeanError>,
    /// Median over the draws of the absolute relative error in percent, of VZ of its median over the pixels.
    pub(super) erm_median: Option<f64>,
    /// EAM.
    pub(super) eam: Option<MeanError>,
    /// Median over the draws of EAM.
    pub(super) eam_median: Option<f64>,
    /// STD of estimate/truth over all pixels of all draws, in percent; of φ, over the draws.
    pub(super) std_percent: Option<f64>,
    /// STD of estimate − truth, or without a truth of the estimate, over all pixels of all draws; of φ, over the draws.
    pub(super) std: f64,
    /// Number of draws.
    pub(super) n: usize,
}

/// A mean over draws.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct MeanError {
    /// The mean.
    pub(super) mean: f64,
    /// Its standard error, from the spread over the draws; `None` of a single one.
    pub(super) standard_error: Option<f64>,
}

impl MeanError {
    fn of(values: &[f64]) -> Option<Self> {
        let (mean, spread) = moments(values.iter().copied())?;
        let n = values.len();
        Some(Self { mean, standard_error: (n > 1).then(|| spread / (n as f64).sqrt()) })
    }
}

impl PooledStatistics {
    /// The statistics of the records that `chosen` picks; `None` if it picks none.
    pub(super) fn of(records: &[RealRecord], chosen: impl Fn(&RealRecord) -> bool) -> Option<Self> {
        let records: Vec<&RealRecord> = records.iter().filter(|record| chosen(record)).collect();
        let all = |value: fn(&RealRecord) -> f64| -> Vec<f64> { records.iter().map(|r| value(r)).collect() };
        let known = |value: fn(&RealRecord) -> Option<f64>| -> Vec<f64> {
            records.iter().filter_map(|r| value(r)).collect()
        };
        let (estimate, scatter) = moments(all(|record| record.estimate).into_iter())?;
        let (erm_signed, eam) = (known(|record| record.erm_signed), known(|record| record.eam));
        let errors = all(|record| record.estimate - record.truth.unwrap_or(0.0));
        // Within the draws and between them.
        let within = moments(all(|record| record.std * record.std).into_iter())?.0;
        let within_percent = moments(known(|r| r.std_percent.map(|std| std * std)).into_iter());
        let spread = |within: f64, between: f64| (within + between * between).sqrt();
        Some(Self {
            estimate,
            median: quantile(&all(|record| record.median), 0.5)?,
            scatter,
            truth: moments(known(|record| record.truth).into_iter()).map(|(mean, _)| mean),
            erm_signed: MeanError::of(&erm_signed),
            erm_abs: MeanError::of(&known(|record| record.erm_abs)),
            erm_median: quantile(&known(|record| record.erm_median), 0.5),
            eam: MeanError::of(&eam),
            eam_median: quantile(&eam, 0.5),
            std_percent: moments(erm_signed.into_iter())
                .map(|(_, between)| spread(within_percent.map_or(0.0, |w| w.0), between)),
            std: spread(within, moments(errors.into_iter())?.1),
            n: records.len(),
        })
    }

    /// Absolute ERM, or EAM where there is no ERM.
    pub(super) fn error(&self) -> Option<MeanError> {
        self.erm_abs.or(self.eam)
    }
}

#[cfg(test)]
mod tests {
    use super::super::contender::ImageContender;
    use super::super::quantity::Quantity;
    use super::super::record::DrawId;
    use super::*;

    #[test]
    fn statistics_pool_pixels_and_draws() {
        let draw = |pose| DrawId { sequence: "lab-E".into(), pose, seed: 1 };
        // Two draws of two pixels with truth −2: errors (0, 1) and (2, 3).
        let pairs = [[(-2.0, -2.0), (-1.0, -2.0)], [(0.0, -2.0), (1.0, -2.0)]];
        let records: Vec<RealRecord> = pairs
            .iter()
            .zip(0..)
            .filter_map(|(pairs, pose)| draw(pose).record(Some(ImageContender::BEST), Quantity::Vz, pairs))
            .collect();
        let pooled = PooledStatistics::of(&records, |_| true).unwrap();
        assert_eq!((pooled.estimate, pooled.median, pooled.truth, pooled.n), (-0.5, -0.5, Some(-2.0), 2));
        let close = |found: Option<MeanError>, mean: f64, standard_error: f64| {
            let found = found.unwrap();
            assert!((found.mean - mean).abs() < 1e-9, "{found:?}");
            assert!((found.standard_error.unwrap() - standard_error).abs() < 1e-9, "{found:?}");
        };
        close(pooled.erm_signed, -75.0, 50.0);
        close(pooled.erm_abs, 75.0, 50.0);
        close(pooled.error(), 75.0, 50.0);
        close(pooled.eam, 1.5, 1.0);
        // The draws' medians are 25 and 125 %.
        assert_eq!((pooled.erm_median, pooled.eam_median), (Some(75.0), Some(1.5)));
        // Variance 0.5 inside each draw and 2 between them; 1 mm is 50 % of the truth.
        assert!((pooled.std - 2.5f64.sqrt()).abs() < 1e-12);
        assert!((pooled.std_percent.unwrap() - 50.0 * 2.5f64.sqrt()).abs() < 1e-9);
        assert!(PooledStatistics::of(&records, |_| false).is_none());
    }

    #[test]
    fn without_a_truth_there_are_no_errors() {
        let draw = DrawId { sequence: "street".into(), pose: 1, seed: 1 };
        let record =
            draw.without_truth(Some(ImageContender::BEST), Quantity::VzStill, &[1.0, f64::NAN, 2.0, 9.0]);
        let record = record.unwrap();
        assert_eq!((record.estimate, record.median, record.n, record.std), (4.0, 2.0, 3, 19f64.sqrt()));
        let pooled = PooledStatistics::of(&[record], |_| true).unwrap();
        assert_eq!((pooled.estimate, pooled.median, pooled.truth, pooled.error()), (4.0, 2.0, None, None));
        assert_eq!((pooled.std, pooled.std_percent, pooled.erm_median), (19f64.sqrt(), None, None));
    }
}
