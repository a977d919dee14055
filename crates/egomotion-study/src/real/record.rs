//! One record for each quantity estimated in one draw.

use serde::{Deserialize, Serialize};

use super::contender::ImageContender;
use super::quantity::Quantity;
use crate::components::{in_mm_deg, unit};
use egomotion::estimate::MotionEstimate;
use egomotion::geometry::Twist;
use egomotion::metrics::{SectionSeven, quantile};

/// One quantity by one contender in one draw; in mm, degrees or pixels, as [`Quantity`] says.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RealRecord {
    /// Name of the sequence.
    pub sequence: String,
    /// Reference pose exp(k φ), or the frame's index in a recording.
    pub pose: i64,
    /// Seed of texture and noise; 0 for a recording.
    pub seed: u64,
    /// The contender; `None` for disparity and flow, which are matched before any motion is estimated.
    #[serde(rename = "way")]
    pub contender: Option<ImageContender>,
    /// The quantity.
    pub quantity: Quantity,
    /// The estimate; for VZ its mean over the pixels.
    pub estimate: f64,
    /// The estimate; for VZ its median over the pixels.
    pub median: f64,
    /// The truth; for VZ its mean over the same pixels. `None` where a recording has none: then there are no errors.
    pub truth: Option<f64>,
    /// The stated standard deviation of the estimate, where it has one.
    pub sigma: Option<f64>,
    /// Signed ERM in percent.
    pub erm_signed: Option<f64>,
    /// Absolute ERM in percent.
    pub erm_abs: Option<f64>,
    /// Median over the pixels of the absolute relative error, in percent.
    pub erm_median: Option<f64>,
    /// EAM.
    pub eam: Option<f64>,
    /// STD over the pixels, of estimate/truth in percent.
    pub std_percent: Option<f64>,
    /// STD over the pixels, of estimate − truth; of the estimate where there is no truth.
    pub std: f64,
    /// Number of values: pixels, or 1.
    pub n: usize,
}

/// The draw to which a record belongs.
#[derive(Debug, Clone, PartialEq)]
pub struct DrawId {
    /// Name of the sequence.
    pub sequence: String,
    /// Reference pose or frame.
    pub pose: i64,
    /// Seed.
    pub seed: u64,
}

impl DrawId {
    /// The record of (estimate, truth) pairs; `None` without a pair of numbers.
    pub(super) fn record(
        &self,
        contender: Option<ImageContender>,
        quantity: Quantity,
        pairs: &[(f64, f64)],
    ) -> Option<RealRecord> {
        let figures = SectionSeven::of(pairs)?;
        let known = pairs.iter().filter(|(estimate, truth)| estimate.is_finite() && truth.is_finite());
        let (estimates, truths): (Vec<f64>, Vec<f64>) = known.copied().unzip();
        Some(RealRecord {
            truth: Some(truths.iter().sum::<f64>() / truths.len() as f64),
            erm_signed: figures.erm_signed_percent,
            erm_abs: figures.erm_abs_percent,
            erm_median: figures.erm_median_percent,
            eam: Some(figures.eam),
            std_percent: figures.std_percent,
            std: figures.std,
            ..self.without_truth(contender, quantity, &estimates)?
        })
    }

    /// The record of estimates of which the truth is not known; `None` without a number.
    pub(super) fn without_truth(
        &self,
        contender: Option<ImageContender>,
        quantity: Quantity,
        estimates: &[f64],
    ) -> Option<RealRecord> {
        let known: Vec<f64> = estimates.iter().copied().filter(|estimate| estimate.is_finite()).collect();
        let (estimate, std) = moments(known.iter().copied())?;
        Some(RealRecord {
            sequence: self.sequence.clone(),
            pose: self.pose,
            seed: self.seed,
            contender,
            quantity,
            estimate,
            median: quantile(&known, 0.5)?,
            truth: None,
            sigma: None,
            erm_signed: None,
            erm_abs: None,
            erm_median: None,
            eam: None,
            std_percent: None,
            std,
            n: known.len(),
        })
    }

    /// One record for each known component of φ, against the truth for the same camera where there is one.
    pub(super) fn phi(
        &self,
        contender: ImageContender,
        estimate: &MotionEstimate,
        truth: Option<&Twist>,
    ) -> Vec<RealRecord> {
        let (found, truth) = (in_mm_deg(&estimate.phi()), truth.map(in_mm_deg));
        let component = |i: usize| {
            let (contender, quantity) = (Some(contender), Quantity::PHI[i]);
            let record = match truth {
                Some(truth) => self.record(contender, quantity, &[(found[i], truth[i])])?,
                None => self.without_truth(contender, quantity, &[found[i]])?,
            };
            let sigma = estimate.theta.sigma(i) * unit(i);
            estimate.observed[i]
                .then_some(RealRecord { sigma: Some(sigma).filter(|s| s.is_finite()), ..record })
        };
        (0..6).filter_map(component).collect()
    }
}

/// Mean and standard deviation (n − 1; 0 of a single value); `None` of no values.
pub(super) fn moments(values: impl Iterator<Item = f64>) -> Option<(f64, f64)> {
    let values: Vec<f64> = values.collect();
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let squares: f64 = values.iter().map(|value| (value - mean).powi(2)).sum();
    (!values.is_empty()).then(|| (mean, (squares / (n - 1.0).max(1.0)).sqrt()))
}
