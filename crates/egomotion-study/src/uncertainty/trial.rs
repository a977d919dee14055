//! Settings drawn at random from the sequences, and what is found at each.

use std::collections::BTreeMap;

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::exact::{Exact, Noise};
use super::formula::{Family, Inputs, Kind};
use super::monte_carlo::{Drawn, Noisy, mixed};
use super::rounding::rounded_variance;
use super::{LEVELS, STEPS};
use crate::world::World;
use egomotion::geometry::distribution::NORMAL_P975_MEDIUM;
use egomotion::geometry::{Twist, rounding_variance};
use egomotion::sim::{Sequence, View, reference_pose};

/// Standard deviations of a disparity, in pixels; the last ones reach beyond σ_d/d = .02.
const DISPARITY_PX: [f64; 6] = [1.0 / 32.0, 1.0 / 16.0, 1.0 / 8.0, 1.0 / 4.0, 1.0 / 2.0, 1.0];
/// Standard deviations of flow and displacement, in pixels.
const FLOW_PX: [f64; 5] = [0.0, 1.0 / 16.0, 1.0 / 8.0, 1.0 / 4.0, 1.0 / 2.0];
/// Rounding has heavy tails where few draws leave a level: so many times more draws.
const ROUNDING_DRAWS: usize = 5;
/// Levels that the disparity of a surface spans for its rounding error to be uniform.
const MANY_LEVELS: f64 = 10.0;

/// One predicted variance beside the one found.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Case {
    /// Which estimator.
    pub family: Family,
    /// Which formula: `(39c)`.
    pub formula: String,
    /// Printed, corrected, ….
    pub kind: Kind,
    /// What was drawn.
    pub inputs: Inputs,
    /// What is estimated; variances are in px² where it is a disparity, in mm² elsewhere.
    pub quantity: String,
    /// Sequence.
    pub sequence: String,
    /// Multiple of its motion.
    pub step: f64,
    /// Where and with what noise; `None` over all points of the sequence's view.
    pub place: Option<Place>,
    /// Disparity levels per pixel, where disparity is rounded.
    pub levels: Option<usize>,
    /// Predicted variance.
    pub predicted: f64,
    /// Variance over the draws.
    pub empirical: f64,
    /// Its standard error.
    pub standard_error: f64,
    /// Draws.
    pub draws: usize,
}

/// Place and noise of a case.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Place {
    /// Reference pose exp(k φ).
    pub pose: i32,
    /// Pixel (u, v).
    pub pixel: (usize, usize),
    /// Depth, in metres.
    pub depth_m: f64,
    /// Length of the flow, in pixels per interval.
    pub flow_px: f64,
    /// σ_d, in pixels.
    pub sigma_disparity_px: f64,
    /// σ_v, in pixels.
    pub sigma_flow_px: f64,
    /// σ_d/d.
    pub relative: f64,
}

impl Case {
    /// Empirical over predicted.
    pub fn ratio(&self) -> f64 {
        self.empirical / self.predicted
    }

    /// Its 95 % interval.
    pub fn interval(&self) -> (f64, f64) {
        let half = NORMAL_P975_MEDIUM * self.standard_error / self.predicted;
        (self.ratio() - half, self.ratio() + half)
    }

    /// σ_d/d; 0 over all points, where there is rounding alone.
    pub fn relative(&self) -> f64 {
        self.place.map_or(0.0, |place| place.relative)
    }
}

/// A point with its noise, drawn at random.
struct Setting<'a> {
    sequence: &'a Sequence,
    step: f64,
    pose: i32,
    exact: Exact,
    noise: Noise,
    levels: usize,
}

/// The cases of one family in one sequence: places, poses and noise drawn at random, `settings` of them
/// for each multiple of the motion, and every usable pixel as likely as another.
pub fn cases(family: Family, sequence: &Sequence, settings: usize, draws: usize, seed: u64) -> Vec<Case> {
    let Some(phi) = sequence.phi_cyclopean(0) else { return Vec::new() };
    let of_step = |(i, &step): (u64, &f64)| {
        let mut rng = Pcg64Mcg::seed_from_u64(mixed(&[seed, i]));
        let pose = rng.random_range(-2..=2);
        let world = World::new(&sequence.scene, &sequence.rig, &phi, pose, step);
        let drawn = draw_settings(family, &world, settings, &mut rng);
        let one = |(k, &(exact, noise, levels)): (usize, &(Exact, Noise, usize))| {
            let at = Setting { sequence, step, pose, exact, noise, levels };
            at_setting(family, &at, draws, mixed(&[seed, i, k as u64]))
        };
        drawn.par_iter().enumerate().flat_map_iter(one).collect::<Vec<_>>()
    };
    let mut cases: Vec<Case> = (0..).zip(&STEPS).flat_map(of_step).collect();
    if family == Family::Rounding {
        cases.extend(LEVELS.iter().flat_map(|&levels| over_all_points(sequence, &phi, levels, draws, seed)));
    }
    cases
}

fn draw_settings(
    family: Family,
    world: &World,
    settings: usize,
    rng: &mut Pcg64Mcg,
) -> Vec<(Exact, Noise, usize)> {
    let pixels: Vec<usize> =
        world.pixels().iter().filter(|p| p.differential || !family.differential()).map(|p| p.index).collect();
    let mut one = || {
        let index = pick(&pixels, rng)?;
        let noise = Noise { disparity_px: pick(&DISPARITY_PX, rng)?, flow_px: pick(&FLOW_PX, rng)? };
        // Levels no coarser than four times the noise: else hardly a draw leaves its level.
        let mut levels = pick(&LEVELS, rng)?;
        while noise.disparity_px * (levels as f64) < 0.25 {
            levels *= 2;
        }
        Some((Exact::at(world, index)?, noise, levels))
    };
    (0..settings).filter_map(|_| one()).collect()
}

fn pick<T: Copy>(from: &[T], rng: &mut Pcg64Mcg) -> Option<T> {
    from.get(rng.random_range(0..from.len().max(1))).copied()
}

fn at_setting(family: Family, at: &Setting<'_>, draws: usize, seed: u64) -> Vec<Case> {
    let place = Place {
        pose: at.pose,
        pixel: at.exact.pixel,
        depth_m: at.exact.depth_m,
        flow_px: at.exact.flow[0].hypot(at.exact.flow[1]),
        sigma_disparity_px: at.noise.disparity_px,
        sigma_flow_px: at.noise.flow_px,
        relative: at.noise.disparity_px / at.exact.now.centre,
    };
    let case = |quantity: &str, inputs, (formula, kind, predicted): (&str, Kind, f64), drawn: &Drawn| Case {
        family,
        formula: formula.to_owned(),
        kind,
        inputs,
        quantity: quantity.to_owned(),
        sequence: at.sequence.name.clone(),
        step: at.step,
        place: Some(place),
        levels: (family == Family::Rounding).then_some(at.levels),
        predicted,
        empirical: drawn.variance,
        standard_error: drawn.standard_error,
        draws: drawn.draws,
    };
    if family == Family::Rounding {
        let (d, sigma, levels) = (at.exact.now.centre, at.noise.disparity_px, at.levels as f64);
        let rounded = move |x: &[f64]| x.iter().map(|d| (d * levels + 0.5).floor() / levels).sum();
        let drawn = Noisy::new([(d, sigma)], rounded).drawn(ROUNDING_DRAWS * draws, seed);
        let printed = ("(52)", Kind::Printed, sigma * sigma + rounding_variance(1.0 / levels));
        let corrected = ("(52c)", Kind::Corrected, rounded_variance(d, sigma, 1.0 / levels));
        return [printed, corrected].map(|p| case("d", Inputs::Raw, p, &drawn)).into();
    }
    let experiments = family.experiments(&at.exact, &at.noise, at.sequence.rig.depth_disparity_product());
    let numbered = (0..).zip(&experiments);
    let all = numbered.flat_map(|(k, experiment)| {
        let drawn = experiment.noisy.drawn(draws, mixed(&[seed, k]));
        let (quantity, inputs) = (experiment.quantity, experiment.inputs);
        experiment.predictions.iter().map(move |&p| (quantity, inputs, p, drawn))
    });
    all.map(|(quantity, inputs, p, drawn)| case(quantity, inputs, p, &drawn)).collect()
}

/// The error of rounding alone, over random places of the view from the pose exp(φ): all of them, and those
/// on surfaces whose disparity spans [`MANY_LEVELS`] levels.
fn over_all_points(sequence: &Sequence, phi: &Twist, levels: usize, draws: usize, seed: u64) -> [Case; 2] {
    let view = View::new(&sequence.scene, &sequence.rig, reference_pose(phi, 1));
    let (width, height) = (sequence.rig.width_px as f64 - 1.0, sequence.rig.height_px as f64 - 1.0);
    let n = levels as f64;
    let seen = |i: usize| {
        let mut rng = Pcg64Mcg::seed_from_u64(mixed(&[seed, levels as u64, i as u64]));
        let (xyd, surface) = view.structure_at(width * rng.random::<f64>(), height * rng.random::<f64>())?;
        Some((xyd.z, surface))
    };
    let seen: Vec<(f64, u16)> = (0..draws).into_par_iter().filter_map(seen).collect();
    let mut ranges = BTreeMap::new();
    for &(d, surface) in &seen {
        let (lo, hi) = ranges.entry(surface).or_insert((d, d));
        (*lo, *hi) = (d.min(*lo), d.max(*hi));
    }
    let spans = |surface: &u16| ranges.get(surface).is_some_and(|(lo, hi)| (hi - lo) * n >= MANY_LEVELS);
    let case = |quantity: &str, counts: &dyn Fn(&u16) -> bool| {
        let points = seen.iter().filter(|(_, surface)| counts(surface));
        let drawn = Drawn::of(&points.map(|(d, _)| (d * n + 0.5).floor() / n - d).collect::<Vec<_>>());
        Case {
            family: Family::Rounding,
            formula: "(52)".to_owned(),
            kind: Kind::Printed,
            inputs: Inputs::Raw,
            quantity: quantity.to_owned(),
            sequence: sequence.name.clone(),
            step: 1.0,
            place: None,
            levels: Some(levels),
            predicted: rounding_variance(1.0 / n),
            empirical: drawn.variance,
            standard_error: drawn.standard_error,
            draws: drawn.draws,
        }
    };
    [case("d, all surfaces", &|_| true), case("d, slanted surfaces", &spans)]
}
