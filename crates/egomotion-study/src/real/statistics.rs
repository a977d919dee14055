//! Statistics over the draws of one sequence.

use super::record::RealRecord;

/// Statistics of one quantity by one contender, over the draws of one sequence.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct PooledStatistics {
    /// Mean estimate.
    pub(super) estimate: f64,
    /// Standard deviation of the estimate from draw to draw.
    pub(super) scatter: f64,
    /// Mean truth.
    pub(super) truth: f64,
    /// Mean signed ERM in percent.
    pub(super) erm_signed: Option<f64>,
    /// Mean absolute ERM in percent.
    pub(super) erm_abs: Option<f64>,
    /// Mean EAM.
    pub(super) eam: f64,
    /// STD of estimate/truth over all pixels of all draws, in percent; of φ, over the draws.
    pub(super) std_percent: Option<f64>,
    /// STD of estimate − truth over all pixels of all draws; of φ, over the draws.
    pub(super) std: f64,
    /// Standard error of the absolute ERM, or of EAM where there is no ERM, from its spread over the draws.
    pub(super) standard_error: Option<f64>,
    /// Number of draws.
    pub(super) n: usize,
}

impl PooledStatistics {
    /// The statistics of the records that `chosen` picks; `None` if it picks none.
    pub(super) fn of(records: &[RealRecord], chosen: impl Fn(&RealRecord) -> bool) -> Option<Self> {
        let records: Vec<&RealRecord> = records.iter().filter(|record| chosen(record)).collect();
        let all = |value: fn(&RealRecord) -> f64| moments(records.iter().map(|record| value(record)));
        let known = |value: fn(&RealRecord) -> Option<f64>| {
            moments(records.iter().filter_map(|record| value(record)))
        };
        let (estimate, scatter) = all(|record| record.estimate)?;
        let (erm_abs, eam) = (known(|record| record.erm_abs), all(|record| record.eam)?);
        let erm_signed = known(|record| record.erm_signed);
        let errors = all(|record| record.estimate - record.truth)?;
        // Within the draws and between them.
        let within = all(|record| record.std * record.std)?.0;
        let within_percent = known(|record| record.std_percent.map(|std| std * std));
        let spread = |within: f64, between: f64| (within + between * between).sqrt();
        let n = records.len();
        Some(Self {
            estimate,
            scatter,
            truth: all(|record| record.truth)?.0,
            erm_signed: erm_signed.map(|(mean, _)| mean),
            erm_abs: erm_abs.map(|(mean, _)| mean),
            eam: eam.0,
            std_percent: erm_signed.map(|(_, between)| spread(within_percent.map_or(0.0, |w| w.0), between)),
            std: spread(within, errors.1),
            standard_error: (n > 1).then(|| erm_abs.unwrap_or(eam).1 / (n as f64).sqrt()),
            n,
        })
    }
}

/// Mean and standard deviation (n − 1; 0 of a single value); `None` of no values.
fn moments(values: impl Iterator<Item = f64>) -> Option<(f64, f64)> {
    let values: Vec<f64> = values.collect();
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let squares: f64 = values.iter().map(|value| (value - mean).powi(2)).sum();
    (!values.is_empty()).then(|| (mean, (squares / (n - 1.0).max(1.0)).sqrt()))
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
        assert_eq!((pooled.estimate, pooled.truth, pooled.eam, pooled.n), (-0.5, -2.0, 1.5, 2));
        assert_eq!((pooled.erm_signed, pooled.erm_abs), (Some(-75.0), Some(75.0)));
        // Variance 0.5 inside each draw and 2 between them; 1 mm is 50 % of the truth.
        assert!((pooled.std - 2.5f64.sqrt()).abs() < 1e-12);
        assert!((pooled.std_percent.unwrap() - 50.0 * 2.5f64.sqrt()).abs() < 1e-9);
        assert!((pooled.standard_error.unwrap() - 50.0).abs() < 1e-9);
        assert!(PooledStatistics::of(&records, |_| false).is_none());
    }
}
