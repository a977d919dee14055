//! One row for each thing estimated in one draw, and what many draws say together.

use serde::{Deserialize, Serialize};

use super::way::{Quantity, Way};
use egomotion::estimate::MotionEstimate;
use egomotion::geometry::Twist;
use egomotion::metrics::SectionSeven;

/// One quantity found in one way in one draw; in mm, degrees or pixels, as [`Quantity`] says.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Record {
    /// Name of the sequence.
    pub sequence: String,
    /// Reference pose exp(k φ), or the frame's index in a recording.
    pub pose: i64,
    /// Seed of texture and noise; 0 for a recording.
    pub seed: u64,
    /// How it was found; `None` for what is measured in the images before any motion.
    pub way: Option<Way>,
    /// What it is.
    pub quantity: Quantity,
    /// The estimate; for VZ its mean over the pixels.
    pub estimate: f64,
    /// The truth; for VZ its mean over the same pixels.
    pub truth: f64,
    /// The stated standard deviation of the estimate, where it has one.
    pub sigma: Option<f64>,
    /// Signed ERM in percent.
    pub erm_signed: Option<f64>,
    /// Absolute ERM in percent.
    pub erm_abs: Option<f64>,
    /// EAM.
    pub eam: f64,
    /// STD over the pixels, of estimate/truth in percent.
    pub std_percent: Option<f64>,
    /// STD over the pixels, of estimate − truth.
    pub std: f64,
    /// Number of values: pixels, or 1.
    pub n: usize,
}

/// Which draw a record belongs to.
#[derive(Debug, Clone, PartialEq)]
pub struct Draw {
    /// Name of the sequence.
    pub sequence: String,
    /// Reference pose or frame.
    pub pose: i64,
    /// Seed.
    pub seed: u64,
}

impl Draw {
    /// The record of (estimate, truth) pairs; `None` without a pair of numbers.
    pub fn record(&self, way: Option<Way>, quantity: Quantity, pairs: &[(f64, f64)]) -> Option<Record> {
        let figures = SectionSeven::of(pairs)?;
        let known = pairs.iter().filter(|(estimate, truth)| estimate.is_finite() && truth.is_finite());
        let (estimates, truths): (f64, f64) =
            known.fold((0.0, 0.0), |(sum, truths), (estimate, truth)| (sum + estimate, truths + truth));
        let n = figures.count as f64;
        Some(Record {
            sequence: self.sequence.clone(),
            pose: self.pose,
            seed: self.seed,
            way,
            quantity,
            estimate: estimates / n,
            truth: truths / n,
            sigma: None,
            erm_signed: figures.erm_signed_percent,
            erm_abs: figures.erm_abs_percent,
            eam: figures.eam,
            std_percent: figures.std_percent,
            std: figures.std,
            n: figures.count,
        })
    }

    /// One record for each known component of φ, against the truth for the same camera.
    pub fn phi(&self, way: Way, estimate: &MotionEstimate, truth: &Twist) -> Vec<Record> {
        let (found, truth) = (in_mm_deg(&estimate.phi()), in_mm_deg(truth));
        let component = |i: usize| {
            let record = self.record(Some(way), Quantity::PHI[i], &[(found[i], truth[i])])?;
            let sigma = estimate.theta.sigma(i) * unit(i);
            estimate.observed[i].then_some(Record { sigma: Some(sigma).filter(|s| s.is_finite()), ..record })
        };
        (0..6).filter_map(component).collect()
    }
}

/// Paper's units in one metre or one radian of φ's component `i`.
fn unit(i: usize) -> f64 {
    if i < 3 { 1e3 } else { 1f64.to_degrees() }
}

/// φ as (tX, tY, tZ) in mm and (ΩX, ΩY, ΩZ) in degrees.
pub fn in_mm_deg(phi: &Twist) -> [f64; 6] {
    let v = phi.vector();
    std::array::from_fn(|i| v[i] * unit(i))
}

/// What the draws of one sequence say of one quantity found in one way.
#[derive(Debug, Clone, PartialEq)]
pub struct Summary {
    /// Mean estimate.
    pub estimate: f64,
    /// Standard deviation of the estimate from draw to draw.
    pub scatter: f64,
    /// Mean truth.
    pub truth: f64,
    /// Mean signed ERM in percent.
    pub erm_signed: Option<f64>,
    /// Mean absolute ERM in percent.
    pub erm_abs: Option<f64>,
    /// Mean EAM.
    pub eam: f64,
    /// STD of estimate/truth over all pixels of all draws, in percent; of φ, over the draws.
    pub std_percent: Option<f64>,
    /// STD of estimate − truth over all pixels of all draws; of φ, over the draws.
    pub std: f64,
    /// Standard error of the absolute ERM, or of EAM where there is no ERM, from its spread over the draws.
    pub standard_error: Option<f64>,
    /// Number of draws.
    pub n: usize,
}

impl Summary {
    /// Of the records that `chosen` picks; `None` if it picks none.
    pub fn of(records: &[Record], chosen: impl Fn(&Record) -> bool) -> Option<Self> {
        let records: Vec<&Record> = records.iter().filter(|record| chosen(record)).collect();
        let all = |value: fn(&Record) -> f64| moments(records.iter().map(|record| value(record)));
        let known =
            |value: fn(&Record) -> Option<f64>| moments(records.iter().filter_map(|record| value(record)));
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
    use super::*;

    #[test]
    fn a_summary_pools_pixels_and_draws() {
        let draw = |pose| Draw { sequence: "lab-E".into(), pose, seed: 1 };
        // Two draws of two pixels with truth −2: errors (0, 1) and (2, 3).
        let pairs = [[(-2.0, -2.0), (-1.0, -2.0)], [(0.0, -2.0), (1.0, -2.0)]];
        let records: Vec<Record> = pairs
            .iter()
            .zip(0..)
            .filter_map(|(pairs, pose)| draw(pose).record(Some(Way::BEST), Quantity::Vz, pairs))
            .collect();
        let summary = Summary::of(&records, |_| true).unwrap();
        assert_eq!((summary.estimate, summary.truth, summary.eam, summary.n), (-0.5, -2.0, 1.5, 2));
        assert_eq!((summary.erm_signed, summary.erm_abs), (Some(-75.0), Some(75.0)));
        // Variance .5 inside each draw and 2 between them; 1 mm is 50 % of the truth.
        assert!((summary.std - 2.5f64.sqrt()).abs() < 1e-12);
        assert!((summary.std_percent.unwrap() - 50.0 * 2.5f64.sqrt()).abs() < 1e-9);
        assert!((summary.standard_error.unwrap() - 50.0).abs() < 1e-9);
        assert!(Summary::of(&records, |_| false).is_none());
    }
}
