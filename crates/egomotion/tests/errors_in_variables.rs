//! The depth change constraint without the bias that noisy gradients bring to least squares.

use egomotion::estimate::MotionEstimate;
use egomotion::geometry::Twist;
use egomotion::metrics::Nees;
use egomotion::pipeline::{Approach, EstimatorKind, Method};
use egomotion::sim::Sequence;
use egomotion::study::contender::Contender;
use egomotion::study::draw::{self, Measuring};
use egomotion::study::world::World;
use nalgebra::Vector6;
use rayon::prelude::*;

/// Estimates over draws at the yardstick's settings, each with the true φ of the left camera.
fn estimates(
    approach: Approach,
    estimator: EstimatorKind,
    measuring: &Measuring,
    draws: usize,
) -> Vec<Result<(MotionEstimate, Twist), egomotion::estimate::Unsolvable>> {
    let sequence = Sequence::named("C", None, None, 1.0).unwrap();
    let phi = sequence.phi_cyclopean(0).unwrap();
    let worlds: Vec<World> =
        (-2..=2).map(|k| World::new(&sequence.scene, &sequence.rig, &phi, k, 1.0)).collect();
    let contender = Contender { approach, method: Method::Dcce, estimator };
    let solve = |i: usize| {
        let (world, seed) = (&worlds[i % worlds.len()], 1_000_003 + i as u64);
        let start = Twist::zero();
        let found = match approach {
            Approach::Differential => {
                contender.differential(&draw::differential(world, measuring, seed), &world.rig, &start, seed)
            }
            Approach::Discrete => {
                contender.discrete(&draw::discrete(world, measuring, seed), &world.rig, &start, seed)
            }
        };
        found.map(|found| (found, world.phi))
    };
    (0..draws).into_par_iter().map(solve).collect()
}

#[test]
fn trial() {
    let draws: usize = std::env::var("DRAWS").map_or(40, |d| d.parse().unwrap());
    for (approach, features) in [(Approach::Differential, 0), (Approach::Discrete, 100_000), (Approach::Discrete, 2048)] {
        let measuring = Measuring { features, ..Measuring::real() };
        for estimator in [EstimatorKind::Eiv] {
            let found = estimates(approach, estimator, &measuring, draws);
            println!("{:?}", found.iter().filter_map(|f| f.as_ref().err()).take(3).collect::<Vec<_>>());
            for f in found.iter().flatten().take(2) { println!("{:?}", f.0.observed); }
            let found: Vec<_> = found.into_iter().flatten().collect();
            if found.is_empty() || !found.iter().any(|f| f.0.is_complete()) { continue; }
            let mut nees = Nees::default();
            let unit = Vector6::new(1e3, 1e3, 1e3, 57.29578, 57.29578, 57.29578);
            let complete: Vec<_> = found.iter().filter(|(f, _)| f.is_complete()).collect();
            complete.iter().for_each(|(f, t)| nees.add(&f.theta, &t.vector()));
            let n = complete.len() as f64;
            let mean = complete.iter().map(|(f, _)| f.theta.mean).sum::<Vector6<f64>>() / n;
            let truth = complete[0].1.vector();
            let var = complete.iter().map(|(f, _)| (f.theta.mean - mean).map(|v| v * v)).sum::<Vector6<f64>>() / (n - 1.0);
            let sd = var.map(f64::sqrt);
            let stated = (complete.iter().map(|(f, _)| f.theta.cov.diagonal()).sum::<Vector6<f64>>() / n).map(f64::sqrt);
            println!("{approach:?} {estimator:?} complete {n} scale {}", found[0].0.residual_scale);
            println!("  truth {:.4?}", truth.component_mul(&unit).as_slice());
            println!("  mean  {:.4?}", mean.component_mul(&unit).as_slice());
            println!("  sd    {:.4?}", sd.component_mul(&unit).as_slice());
            println!("  stated{:.4?}", stated.component_mul(&unit).as_slice());
            println!("  bias/s{:.3?}", (mean - truth).component_div(&sd).as_slice());
            println!("  NEES/6 {:?} ± {:?}", nees.per_degree(), nees.standard_error());
        }
    }
}
