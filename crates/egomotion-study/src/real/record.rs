//! One record for each quantity estimated in one draw.

use serde::{Deserialize, Serialize};

use super::contender::ImageContender;
use super::quantity::Quantity;
use crate::components::{in_mm_deg, unit};
use egomotion::estimate::MotionEstimate;
use egomotion::geometry::Twist;
use egomotion::metrics::SectionSeven;

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
        let (estimates, truths): (f64, f64) =
            known.fold((0.0, 0.0), |(sum, truths), (estimate, truth)| (sum + estimate, truths + truth));
        let n = figures.count as f64;
        Some(RealRecord {
            sequence: self.sequence.clone(),
            pose: self.pose,
            seed: self.seed,
            contender,
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
    pub(super) fn phi(
        &self,
        contender: ImageContender,
        estimate: &MotionEstimate,
        truth: &Twist,
    ) -> Vec<RealRecord> {
        let (found, truth) = (in_mm_deg(&estimate.phi()), in_mm_deg(truth));
        let component = |i: usize| {
            let record = self.record(Some(contender), Quantity::PHI[i], &[(found[i], truth[i])])?;
            let sigma = estimate.theta.sigma(i) * unit(i);
            estimate.observed[i]
                .then_some(RealRecord { sigma: Some(sigma).filter(|s| s.is_finite()), ..record })
        };
        (0..6).filter_map(component).collect()
    }
}
