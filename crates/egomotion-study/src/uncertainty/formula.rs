//! The variance formulas of section 5, each with its estimator and the noisy inputs of this estimator.

use nalgebra::{Vector2, Vector4};
use serde::{Deserialize, Serialize};

use super::monte_carlo::NoisyFunction;
use super::pixel::{ExactPixel, PixelNoise, Stencil};
use egomotion::geometry::Gaussian;
use egomotion::motion::depth_velocity as vz;
use egomotion::observe::{DepthChange, DepthFlow, DepthTrack, StereoFlow, StereoTrack};

/// Square millimetres in a square metre.
const MM2_PER_M2: f64 = 1e6;

/// An estimator with the formulas for its variance.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Family {
    /// Z = b f/d, (32).
    Depth,
    /// Zx, Zy and Zt of (33), (35).
    Gradient,
    /// (7): (39), (39c).
    DcceDifferential,
    /// (9): (44).
    DvDifferential,
    /// (17): (47), (47c).
    DcceDiscrete,
    /// (21): (49), (50).
    DvDiscrete,
    /// A disparity rounded to levels, (52).
    Rounding,
}

/// The terms that a predicted variance holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum FormulaKind {
    /// As the paper prints it.
    Printed,
    /// Every input's noise to first order, shared disparity accounted for, without products of noises.
    FirstOrder,
    /// The library's: first order, and the product of gradient's and flow's noise where there is one.
    Corrected,
    /// All terms to the fourth order of the noise, by Taylor.
    SecondOrder,
}

/// The inputs that are drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Inputs {
    /// The raw disparities and flows, as the estimator meets them.
    Raw,
    /// Intermediates drawn each on their own, as the paper assumes them to be.
    Independent,
}

type Function = Box<dyn Fn(&[f64]) -> f64 + Send + Sync>;

/// One estimator at one point, with its noise and the variances predicted for it.
pub(super) struct Experiment {
    /// The quantity that is estimated: `Z`, `Zx`, `VZ`, …
    pub quantity: &'static str,
    /// The inputs that are drawn.
    pub inputs: Inputs,
    /// The estimator as a function of these inputs; depths in millimetres.
    pub noisy: NoisyFunction<Function>,
    /// (formula, kind, variance in mm²).
    pub predictions: Vec<(&'static str, FormulaKind, f64)>,
}

impl Family {
    /// All, in the paper's order.
    pub(super) const ALL: [Self; 7] = [
        Self::Depth,
        Self::Gradient,
        Self::DcceDifferential,
        Self::DvDifferential,
        Self::DcceDiscrete,
        Self::DvDiscrete,
        Self::Rounding,
    ];

    /// Name with the numbers of its formulas.
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Depth => "depth (32)",
            Self::Gradient => "gradient (35)",
            Self::DcceDifferential => "DCCE differential (39)",
            Self::DvDifferential => "DV differential (44)",
            Self::DcceDiscrete => "DCCE discrete (47)",
            Self::DvDiscrete => "DV discrete (50)",
            Self::Rounding => "rounding (52)",
        }
    }

    /// Whether it needs one surface at t − 1 too.
    pub(super) fn differential(self) -> bool {
        matches!(self, Self::Gradient | Self::DcceDifferential | Self::DvDifferential)
    }

    /// Its experiments at one point; none for [`Family::Rounding`], which rounds and so has no derivatives.
    pub(super) fn experiments(self, at: &ExactPixel, noise: &PixelNoise, bf: f64) -> Vec<Experiment> {
        match self {
            Self::Depth => vec![depth(at, noise, bf)],
            Self::Gradient => gradients(at, noise, bf),
            Self::DcceDifferential => vec![dcce_differential(at, noise, bf), dcce_independent(at, noise, bf)],
            Self::DvDifferential => vec![dv_differential(at, noise, bf)],
            Self::DcceDiscrete => {
                vec![dcce_discrete(at, noise, bf), dcce_discrete_independent(at, noise, bf)]
            }
            Self::DvDiscrete => vec![dv_discrete(at, noise, bf), dv_discrete_independent(at, noise, bf)],
            Self::Rounding => Vec::new(),
        }
    }
}

fn experiment(
    quantity: &'static str,
    inputs: Inputs,
    values: impl IntoIterator<Item = (f64, f64)>,
    estimate_m: impl Fn(&[f64]) -> f64 + Send + Sync + 'static,
    variances_m2: &[(&'static str, FormulaKind, f64)],
) -> Experiment {
    let function: Function = Box::new(move |x| 1e3 * estimate_m(x));
    let noisy = NoisyFunction::new(values, function);
    let mut predictions: Vec<_> = variances_m2
        .iter()
        .map(|&(formula, kind, variance)| (formula, kind, MM2_PER_M2 * variance))
        .collect();
    // Second order belongs to the inputs, so it has no formula of its own.
    let formula = variances_m2.last().map_or("", |last| last.0);
    predictions.push((formula, FormulaKind::SecondOrder, noisy.second_order()));
    Experiment { quantity, inputs, noisy, predictions }
}

/// A value that `estimate` never meets as NaN: an index past the inputs is an exact zero.
fn input(x: &[f64], i: usize) -> f64 {
    x.get(i).copied().unwrap_or(0.0)
}

/// Disparities from the `from`-th input on: centre, left, right, above, below.
fn stencil(x: &[f64], from: usize) -> Stencil {
    let at = |i: usize| input(x, from + i);
    Stencil { centre: at(0), left: at(1), right: at(2), above: at(3), below: at(4) }
}

fn disparities(s: &Stencil) -> [f64; 5] {
    [s.centre, s.left, s.right, s.above, s.below]
}

fn with(values: impl IntoIterator<Item = f64>, sigma: f64) -> impl Iterator<Item = (f64, f64)> {
    values.into_iter().map(move |value| (value, sigma))
}

fn exact<const N: usize>(mean: [f64; N]) -> Gaussian<N> {
    Gaussian::independent(mean, [0.0; N])
}

fn depth(at: &ExactPixel, noise: &PixelNoise, bf: f64) -> Experiment {
    let variance = vz::dv(&at.stereo_flow(noise), bf).z_vz.cov[(0, 0)];
    let estimate = move |x: &[f64]| {
        vz::dv(&StereoFlow { x_px: 0.0, y_px: 0.0, measured: exact([input(x, 0), 0.0, 0.0, 0.0]) }, bf)
            .z_vz
            .mean
            .x
    };
    let values = with([at.now.centre], noise.disparity_px);
    experiment(
        "Z",
        Inputs::Raw,
        values,
        estimate,
        &[("(32)", FormulaKind::Printed, variance), ("(32)", FormulaKind::Corrected, variance)],
    )
}

/// The change of depth that nine raw inputs give: five disparities at t, two around it in time, flow.
fn raw_depth_change(x: &[f64], bf: f64) -> DepthChange {
    let now = stencil(x, 0);
    let [dx, dy] = now.gradient();
    let dt = 0.5 * (input(x, 6) - input(x, 5));
    let (disparity, flow) = (exact([now.centre, dx, dy, dt]), exact([input(x, 7), input(x, 8)]));
    DepthFlow { x_px: 0.0, y_px: 0.0, disparity, flow }.depth_change(bf)
}

fn raw_inputs(at: &ExactPixel, noise: &PixelNoise) -> Vec<(f64, f64)> {
    let times = [at.before, at.after.centre];
    with(disparities(&at.now).into_iter().chain(times), noise.disparity_px)
        .chain(with(at.flow, noise.flow_px))
        .collect()
}

fn gradients(at: &ExactPixel, noise: &PixelNoise, bf: f64) -> Vec<Experiment> {
    let change = at.depth_flow(noise).depth_change(bf);
    let one = |(quantity, i): (&'static str, usize)| {
        let variance = change.depth.cov[(i, i)];
        experiment(
            quantity,
            Inputs::Raw,
            raw_inputs(at, noise),
            move |x| raw_depth_change(x, bf).depth.mean[i],
            &[("(35)", FormulaKind::Printed, variance), ("(35)", FormulaKind::Corrected, variance)],
        )
    };
    [("Zx", 1), ("Zy", 2), ("Zt", 3)].map(one).into()
}

fn dcce_differential(at: &ExactPixel, noise: &PixelNoise, bf: f64) -> Experiment {
    let flow = at.depth_flow(noise);
    let change = flow.depth_change(bf);
    let variances = [
        ("(39)", FormulaKind::Printed, vz::dcce_variance_as_printed(&flow, bf)),
        ("(39c)", FormulaKind::FirstOrder, vz::dcce(&change).vz().variance()),
        ("(39c+)", FormulaKind::Corrected, vz::dcce_variance_with_product(&change)),
    ];
    let estimate = move |x: &[f64]| vz::dcce(&raw_depth_change(x, bf)).vz().value();
    experiment("VZ", Inputs::Raw, raw_inputs(at, noise), estimate, &variances)
}

/// (7) with Zx, Zy and Zt each from a disparity of its own: inputs d, d, d, dx, dy, dt, vx, vy.
fn independent_change(x: &[f64], bf: f64) -> f64 {
    let slope = |i: usize| -bf / input(x, i).powi(2) * input(x, 3 + i);
    let depth = exact(Vector4::new(0.0, slope(0), slope(1), slope(2)).into());
    let flow = exact(Vector2::new(input(x, 6), input(x, 7)).into());
    vz::dcce(&DepthChange { x_px: 0.0, y_px: 0.0, depth, flow }).vz().value()
}

fn independent_inputs(flow: &DepthFlow) -> Vec<(f64, f64)> {
    let d = (flow.disparity.mean[0], flow.disparity.sigma(0));
    let gradient = (1..4).map(|i| (flow.disparity.mean[i], flow.disparity.sigma(i)));
    let v = (0..2).map(|i| (flow.flow.mean[i], flow.flow.sigma(i)));
    [d; 3].into_iter().chain(gradient).chain(v).collect()
}

fn dcce_independent(at: &ExactPixel, noise: &PixelNoise, bf: f64) -> Experiment {
    let flow = at.depth_flow(noise);
    let printed = [("(39)", FormulaKind::Printed, vz::dcce_variance_as_printed(&flow, bf))];
    let estimate = move |x: &[f64]| independent_change(x, bf);
    experiment("VZ", Inputs::Independent, independent_inputs(&flow), estimate, &printed)
}

fn dv_differential(at: &ExactPixel, noise: &PixelNoise, bf: f64) -> Experiment {
    let variance = vz::dv(&at.stereo_flow(noise), bf).vz().variance();
    let values =
        with([at.now.centre], noise.disparity_px).chain(with([at.flow[0], at.flow_right_x], noise.flow_px));
    let estimate = move |x: &[f64]| {
        let measured = exact([input(x, 0), input(x, 1), 0.0, input(x, 2)]);
        vz::dv(&StereoFlow { x_px: 0.0, y_px: 0.0, measured }, bf).vz().value()
    };
    experiment(
        "VZ",
        Inputs::Raw,
        values,
        estimate,
        &[("(44)", FormulaKind::Printed, variance), ("(44)", FormulaKind::Corrected, variance)],
    )
}

fn dcce_discrete(at: &ExactPixel, noise: &PixelNoise, bf: f64) -> Experiment {
    let track = at.depth_track(noise);
    let change = track.depth_change(bf);
    let halved = at.depth_track_as_in_5_6(noise);
    let variances = [
        ("(47) with σ²_dt = ½σ²_d", FormulaKind::Printed, vz::dcce_variance_as_printed(&halved, bf)),
        ("(47)", FormulaKind::Printed, vz::dcce_discrete_variance_as_printed(&track, bf)),
        ("(47c)", FormulaKind::FirstOrder, vz::dcce(&change).vz().variance()),
        ("(47c+)", FormulaKind::Corrected, vz::dcce_variance_with_product(&change)),
    ];
    let values = with([at.now.centre].into_iter().chain(disparities(&at.after)), noise.disparity_px)
        .chain(with(at.displacement, noise.flow_px));
    let estimate = move |x: &[f64]| {
        let after = stencil(x, 1);
        let [dx, dy] = after.gradient();
        let disparity = exact([input(x, 0), after.centre, dx, dy]);
        let displacement = exact([input(x, 6), input(x, 7)]);
        vz::dcce(&DepthTrack { x_px: 0.0, y_px: 0.0, disparity, displacement }.depth_change(bf)).vz().value()
    };
    experiment("VZ", Inputs::Raw, values, estimate, &variances)
}

fn dcce_discrete_independent(at: &ExactPixel, noise: &PixelNoise, bf: f64) -> Experiment {
    let track = at.depth_track(noise);
    let printed = [("(47)", FormulaKind::Printed, vz::dcce_discrete_variance_as_printed(&track, bf))];
    let estimate = move |x: &[f64]| independent_change(x, bf);
    experiment("VZ", Inputs::Independent, independent_inputs(&track.as_printed()), estimate, &printed)
}

fn dv_discrete(at: &ExactPixel, noise: &PixelNoise, bf: f64) -> Experiment {
    let track = at.stereo_track(noise);
    let variance = vz::dv_discrete(&track, bf).vz().variance();
    let variances = [
        ("(49)", FormulaKind::Printed, vz::dv_discrete_variance_as_printed(&track, bf)),
        ("(50)", FormulaKind::Printed, variance),
        ("(50)", FormulaKind::Corrected, variance),
    ];
    let estimate = move |x: &[f64]| {
        let end = |i: usize| exact([0.0, 0.0, input(x, i)]);
        vz::dv_discrete(&StereoTrack { before: end(0), after: end(1) }, bf).vz().value()
    };
    let values = with([at.now.centre, at.moved], noise.disparity_px);
    experiment("VZ", Inputs::Raw, values, estimate, &variances)
}

/// (21) with Z and Z′ from disparities of their own, as (49) has it.
fn dv_discrete_independent(at: &ExactPixel, noise: &PixelNoise, bf: f64) -> Experiment {
    let printed = vz::dv_discrete_variance_as_printed(&at.stereo_track(noise), bf);
    let (d, moved) = (at.now.centre, at.moved);
    let estimate = move |x: &[f64]| -bf / (input(x, 0) * input(x, 1)) * (input(x, 3) - input(x, 2));
    let values = with([d, moved, d, moved], noise.disparity_px);
    experiment("VZ", Inputs::Independent, values, estimate, &[("(49)", FormulaKind::Printed, printed)])
}
