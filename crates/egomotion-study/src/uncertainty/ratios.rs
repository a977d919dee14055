//! Ratios of variances over a whole image: DCCE against DV, and printed against corrected formulas.

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::coefficients::Variances;
use super::pixel::{ExactPixel, PixelNoise};
use crate::Table;
use crate::sequences::PAPER_STEPS;
use crate::synthetic::SyntheticWorld;
use egomotion::metrics::quantile;
use egomotion::pipeline::Approach;
use egomotion::sim::Sequence;

/// Median of a quantity over the usable pixels, with the middle 90 % of it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct QuantileRange {
    /// Median.
    pub median: f64,
    /// 5 % lie below.
    pub lo: f64,
    /// 5 % lie above.
    pub hi: f64,
}

/// The methods' variances relative to each other with equal noise on disparity and flow; first order.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct VarianceRatios {
    /// Sequence.
    pub sequence: String,
    /// Multiple of its motion.
    pub step: f64,
    /// Usable pixels.
    pub pixels: usize,
    /// Length of the flow |v|, in pixels per interval.
    pub flow_px: QuantileRange,
    /// (39c)/(44).
    pub differential: QuantileRange,
    /// (39c)/(44) relative to (1 + |v|²)/4.
    pub differential_rule: QuantileRange,
    /// Share of the pixels with (39c) < (44).
    pub differential_wins: f64,
    /// Share of the pixels with |v| < √3 px.
    pub slow: f64,
    /// (47c)/(50).
    pub discrete: QuantileRange,
    /// (47c)/(50) relative to 1 + |Δ|²/4.
    pub discrete_rule: QuantileRange,
    /// Share of the pixels with (47c) < (50).
    pub discrete_wins: f64,
    /// (39)/(39c) at the usable pixels.
    pub printed: QuantileRange,
    /// Largest (39)/(39c) or its inverse at the pixels whose stencil crosses an edge.
    pub printed_at_edges: f64,
    /// (47)/(47c), σ²_dt = ½ σ²_d taken as section 5.6 does.
    pub printed_discrete: QuantileRange,
}

/// The ratios for each multiple of the motion, at the sequence's first pose.
pub(super) fn over_steps(sequence: &Sequence) -> Vec<VarianceRatios> {
    let Some(phi) = sequence.phi_cyclopean(0) else { return Vec::new() };
    let at = |&step: &f64| {
        let world = SyntheticWorld::new(&sequence.scene, &sequence.rig, &phi, 0, step);
        over_image(&world, &sequence.name, step)
    };
    PAPER_STEPS.iter().filter_map(at).collect()
}

/// The ratios at one pixel.
struct PixelRatios {
    flow_px: f64,
    differential: f64,
    discrete: f64,
    moved2: f64,
    printed: f64,
    printed_discrete: f64,
}

fn at_pixel(world: &SyntheticWorld, index: usize) -> Option<PixelRatios> {
    let at = ExactPixel::at(world, index)?;
    let noise = PixelNoise { disparity_px: 1.0, flow_px: 1.0 };
    let Variances { printed, corrected } = Variances::of(&at, &noise, world.rig.depth_disparity_product());
    Some(PixelRatios {
        flow_px: at.flow[0].hypot(at.flow[1]),
        differential: corrected[0] / corrected[1],
        discrete: corrected[2] / corrected[3],
        moved2: at.displacement[0].powi(2) + at.displacement[1].powi(2),
        printed: printed[0] / corrected[0],
        printed_discrete: printed[2] / corrected[2],
    })
}

fn over_image(world: &SyntheticWorld, sequence: &str, step: f64) -> Option<VarianceRatios> {
    let usable: Vec<usize> = world.usable_in(Approach::Differential).map(|p| p.index).collect();
    let points: Vec<PixelRatios> = usable.par_iter().filter_map(|&i| at_pixel(world, i)).collect();
    let spread = |of: fn(&PixelRatios) -> f64| {
        let values: Vec<f64> = points.iter().map(of).collect();
        Some(QuantileRange {
            median: quantile(&values, 0.5)?,
            lo: quantile(&values, 0.05)?,
            hi: quantile(&values, 0.95)?,
        })
    };
    let share =
        |of: fn(&PixelRatios) -> bool| points.iter().filter(|p| of(p)).count() as f64 / points.len() as f64;
    let all = 0..world.rig.width_px * world.rig.height_px;
    let edges = all.into_par_iter().filter(|i| usable.binary_search(i).is_err());
    let printed_at_edges = edges
        .filter_map(|i| at_pixel(world, i))
        .map(|p| p.printed.max(p.printed.recip()))
        .reduce(|| 1.0, f64::max);
    Some(VarianceRatios {
        sequence: sequence.to_owned(),
        step,
        pixels: points.len(),
        flow_px: spread(|p| p.flow_px)?,
        differential: spread(|p| p.differential)?,
        differential_rule: spread(|p| p.differential / (0.25 * (1.0 + p.flow_px * p.flow_px)))?,
        differential_wins: share(|p| p.differential < 1.0),
        slow: share(|p| p.flow_px < 3.0_f64.sqrt()),
        discrete: spread(|p| p.discrete)?,
        discrete_rule: spread(|p| p.discrete / (1.0 + 0.25 * p.moved2))?,
        discrete_wins: share(|p| p.discrete < 1.0),
        printed: spread(|p| p.printed)?,
        printed_at_edges,
        printed_discrete: spread(|p| p.printed_discrete)?,
    })
}

/// All ratios.
pub(super) fn table(ratios: &[&VarianceRatios]) -> Table {
    let mut table = Table::new(
        "dcce-against-dv",
        "Variance of VZ per pixel: DCCE against DV with equal noise of disparity and flow",
        "Medians over the usable pixels (and where it says so the middle 90 %). The rule (1 + |v|²)/4 holds \
         where the gradient of disparity and its rate are small; by it the differential DCCE is the better \
         one below √3 px of motion. The discrete DCCE is never the better one: its rule is 1 + |Δ|²/4. \
         (39)/(39c) and (47)/(47c) say what the printed formulas get wrong.",
        &[
            ("sequence", "sequence"),
            ("step", "STEP"),
            ("pixels", "pixels"),
            ("flow_px", "|v| (px)"),
            ("differential", "(39c)/(44)"),
            ("rule", "of (1 + |v|²)/4"),
            ("rule_lo", "5 %"),
            ("rule_hi", "95 %"),
            ("dcce_wins_percent", "DCCE better (% of pixels)"),
            ("slow_percent", "|v| < √3 px (%)"),
            ("discrete", "(47c)/(50)"),
            ("discrete_rule", "of 1 + |Δ|²/4"),
            ("discrete_wins_percent", "discrete DCCE better (%)"),
            ("printed", "(39)/(39c)"),
            ("printed_hi", "95 %"),
            ("printed_at_edges", "at edges, largest"),
            ("printed_discrete", "(47)/(47c), ½σ²_d"),
        ],
    );
    table.rows = ratios
        .iter()
        .map(|c| {
            vec![
                c.sequence.as_str().into(),
                c.step.into(),
                c.pixels.into(),
                c.flow_px.median.into(),
                c.differential.median.into(),
                c.differential_rule.median.into(),
                c.differential_rule.lo.into(),
                c.differential_rule.hi.into(),
                (100.0 * c.differential_wins).into(),
                (100.0 * c.slow).into(),
                c.discrete.median.into(),
                c.discrete_rule.median.into(),
                (100.0 * c.discrete_wins).into(),
                c.printed.median.into(),
                c.printed.hi.into(),
                c.printed_at_edges.into(),
                c.printed_discrete.median.into(),
            ]
        })
        .collect();
    table
}
