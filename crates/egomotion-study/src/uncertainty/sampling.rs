//! Cases at places, poses and noise drawn at random from the sequences.

use std::collections::BTreeMap;

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use rayon::prelude::*;

use super::case::{SampledPlace, VarianceCase};
use super::formula::{Family, FormulaKind, Inputs};
use super::monte_carlo::{DrawnVariance, NoisyFunction, mixed_seed};
use super::pixel::{ExactPixel, PixelNoise};
use super::rounding::rounded_variance;
use crate::sequences::PAPER_STEPS;
use crate::synthetic::SyntheticWorld;
use egomotion::geometry::Twist;
use egomotion::geometry::rounding_variance;
use egomotion::sim::{Sequence, View, reference_pose};

/// Standard deviations of a disparity, in pixels; the largest reach beyond σ_d/d = 0.02, where first order ends.
const SIGMA_DISPARITY_PX: [f64; 6] = [1.0 / 32.0, 1.0 / 16.0, 1.0 / 8.0, 1.0 / 4.0, 1.0 / 2.0, 1.0];
/// Standard deviations of flow and displacement, in pixels: none, and up to those of the paper's sweep.
const SIGMA_FLOW_PX: [f64; 5] = [0.0, 1.0 / 16.0, 1.0 / 8.0, 1.0 / 4.0, 1.0 / 2.0];
/// ROUND of the sweeps (7.1): levels of disparity in a pixel.
const DISPARITY_LEVELS: [usize; 4] = [4, 8, 16, 32];
/// Least noise of a disparity that is rounded, in levels.
///
/// With less, hardly a draw leaves its level, and the empirical variance has tails too heavy for a standard error.
const LEAST_NOISE_LEVELS: f64 = 0.25;
/// Factor on the number of draws of a rounded disparity, whose variance has heavy tails where few draws leave a level.
const ROUNDING_DRAWS_FACTOR: usize = 5;
/// Levels that the disparity of a surface must span for its rounding error to be spread uniformly, as (52) has it.
///
/// With fewer, one level weighs so much that (52) need not hold.
const UNIFORM_SPAN_LEVELS: f64 = 10.0;

/// The cases of one family in one sequence, `places` of them for each multiple of the motion.
///
/// Places, poses and noise are drawn at random, every usable pixel as likely as another.
pub(super) fn cases(
    family: Family,
    sequence: &Sequence,
    places: usize,
    draws: usize,
    seed: u64,
) -> Vec<VarianceCase> {
    let Some(phi) = sequence.phi_cyclopean(0) else { return Vec::new() };
    let of_step = |(i, &step): (u64, &f64)| {
        let mut rng = Pcg64Mcg::seed_from_u64(mixed_seed(&[seed, i]));
        let pose = rng.random_range(-2..=2);
        let world = SyntheticWorld::new(&sequence.scene, &sequence.rig, &phi, pose, step);
        let view = SampledView { family, sequence, step, pose, world };
        let points = view.points(places, &mut rng);
        let one =
            |(k, point): (usize, &SampledPoint)| view.cases(point, draws, mixed_seed(&[seed, i, k as u64]));
        points.par_iter().enumerate().flat_map_iter(one).collect::<Vec<_>>()
    };
    let mut cases: Vec<VarianceCase> = (0..).zip(&PAPER_STEPS).flat_map(of_step).collect();
    if family == Family::Rounding {
        let of_levels = |&levels: &usize| over_all_points(sequence, &phi, levels, draws, seed);
        cases.extend(DISPARITY_LEVELS.iter().flat_map(of_levels));
    }
    cases
}

/// A pixel with its noise, drawn at random.
#[derive(Debug, Clone, Copy)]
struct SampledPoint {
    exact: ExactPixel,
    noise: PixelNoise,
    levels: usize,
}

/// A sequence at a pose drawn at random, where points are drawn.
struct SampledView<'a> {
    family: Family,
    sequence: &'a Sequence,
    step: f64,
    pose: i32,
    world: SyntheticWorld,
}

impl SampledView<'_> {
    fn points(&self, places: usize, rng: &mut Pcg64Mcg) -> Vec<SampledPoint> {
        let usable = self.world.pixels().iter().filter(|p| p.differential || !self.family.differential());
        let pixels: Vec<usize> = usable.map(|p| p.index).collect();
        let mut one = || {
            let index = pick(&pixels, rng)?;
            let noise = PixelNoise {
                disparity_px: pick(&SIGMA_DISPARITY_PX, rng)?,
                flow_px: pick(&SIGMA_FLOW_PX, rng)?,
            };
            let mut levels = pick(&DISPARITY_LEVELS, rng)?;
            while noise.disparity_px * (levels as f64) < LEAST_NOISE_LEVELS {
                levels *= 2;
            }
            Some(SampledPoint { exact: ExactPixel::at(&self.world, index)?, noise, levels })
        };
        (0..places).filter_map(|_| one()).collect()
    }

    /// Every formula of the family at a point, against draws.
    fn cases(&self, point: &SampledPoint, draws: usize, seed: u64) -> Vec<VarianceCase> {
        if self.family == Family::Rounding {
            return self.rounded_cases(point, draws, seed).into();
        }
        let bf = self.sequence.rig.depth_disparity_product();
        let experiments = self.family.experiments(&point.exact, &point.noise, bf);
        let numbered = (0..).zip(&experiments);
        let all = numbered.flat_map(|(k, experiment)| {
            let drawn = experiment.noisy.drawn(draws, mixed_seed(&[seed, k]));
            let (quantity, inputs) = (experiment.quantity, experiment.inputs);
            experiment.predictions.iter().map(move |&p| (quantity, inputs, p, drawn))
        });
        all.map(|(quantity, inputs, p, drawn)| self.case(point, quantity, inputs, p, &drawn)).collect()
    }

    /// (52), and its exact form, against draws.
    fn rounded_cases(&self, point: &SampledPoint, draws: usize, seed: u64) -> [VarianceCase; 2] {
        let (d, sigma, levels) = (point.exact.now.centre, point.noise.disparity_px, point.levels as f64);
        let rounded = move |x: &[f64]| x.iter().map(|d| (d * levels + 0.5).floor() / levels).sum();
        let drawn = NoisyFunction::new([(d, sigma)], rounded).drawn(ROUNDING_DRAWS_FACTOR * draws, seed);
        let printed = ("(52)", FormulaKind::Printed, sigma * sigma + rounding_variance(1.0 / levels));
        let corrected = ("(52c)", FormulaKind::Corrected, rounded_variance(d, sigma, 1.0 / levels));
        [printed, corrected].map(|prediction| self.case(point, "d", Inputs::Raw, prediction, &drawn))
    }

    fn case(
        &self,
        point: &SampledPoint,
        quantity: &str,
        inputs: Inputs,
        (formula, kind, predicted): (&str, FormulaKind, f64),
        drawn: &DrawnVariance,
    ) -> VarianceCase {
        let place = SampledPlace {
            pose: self.pose,
            pixel: point.exact.pixel,
            depth_m: point.exact.depth_m,
            flow_px: point.exact.flow[0].hypot(point.exact.flow[1]),
            sigma_disparity_px: point.noise.disparity_px,
            sigma_flow_px: point.noise.flow_px,
            relative: point.noise.disparity_px / point.exact.now.centre,
        };
        VarianceCase {
            family: self.family,
            formula: formula.to_owned(),
            kind,
            inputs,
            quantity: quantity.to_owned(),
            sequence: self.sequence.name.clone(),
            step: self.step,
            place: Some(place),
            levels: (self.family == Family::Rounding).then_some(point.levels),
            predicted,
            empirical: drawn.variance,
            standard_error: drawn.standard_error,
            draws: drawn.draws,
        }
    }
}

fn pick<T: Copy>(from: &[T], rng: &mut Pcg64Mcg) -> Option<T> {
    from.get(rng.random_range(0..from.len().max(1))).copied()
}

/// The error of rounding alone, over random places of the view from the pose exp(φ): all of them, and those
/// on surfaces whose disparity spans [`UNIFORM_SPAN_LEVELS`] levels.
fn over_all_points(
    sequence: &Sequence,
    phi: &Twist,
    levels: usize,
    draws: usize,
    seed: u64,
) -> [VarianceCase; 2] {
    let view = View::new(&sequence.scene, &sequence.rig, reference_pose(phi, 1));
    let (width, height) = (sequence.rig.width_px as f64 - 1.0, sequence.rig.height_px as f64 - 1.0);
    let n = levels as f64;
    let seen = |i: usize| {
        let mut rng = Pcg64Mcg::seed_from_u64(mixed_seed(&[seed, levels as u64, i as u64]));
        let (xyd, surface) = view.structure_at(width * rng.random::<f64>(), height * rng.random::<f64>())?;
        Some((xyd.z, surface))
    };
    let seen: Vec<(f64, u16)> = (0..draws).into_par_iter().filter_map(seen).collect();
    let mut ranges = BTreeMap::new();
    for &(d, surface) in &seen {
        let (lo, hi) = ranges.entry(surface).or_insert((d, d));
        (*lo, *hi) = (d.min(*lo), d.max(*hi));
    }
    let spans =
        |surface: &u16| ranges.get(surface).is_some_and(|(lo, hi)| (hi - lo) * n >= UNIFORM_SPAN_LEVELS);
    let case = |quantity: &str, counts: &dyn Fn(&u16) -> bool| {
        let points = seen.iter().filter(|(_, surface)| counts(surface));
        let drawn =
            DrawnVariance::of(&points.map(|(d, _)| (d * n + 0.5).floor() / n - d).collect::<Vec<_>>());
        VarianceCase {
            family: Family::Rounding,
            formula: "(52)".to_owned(),
            kind: FormulaKind::Printed,
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
