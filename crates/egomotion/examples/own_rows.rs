//! Equations of your own in an estimator: a radar's Doppler measurements, which no camera gives.
//!
//! Every linear motion equation reads n · V(P) = c. A radar measures how fast the distance to a point P grows, so n is
//! the direction to P. `cargo run --release -p egomotion --example own_rows`

use egomotion::constrain::LinearConstraint;
use egomotion::estimate::Row;
use egomotion::estimate::{Weighting, least_squares};
use egomotion::geometry::Twist;
use nalgebra::Vector3;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let truth = Twist { t: Vector3::new(0.2, 0.0, -1.5), omega: Vector3::new(0.0, 0.1, 0.0) };
    let sigma = 0.02;
    let mut random = Pcg64Mcg::seed_from_u64(1);
    let rows: Vec<Row<6>> = (0..400)
        .map(|i| {
            let [x, y, z] = [(-8.0, 8.0), (-2.0, 2.0), (5.0, 40.0)].map(|(a, b)| random.random_range(a..b));
            let point = Vector3::new(x, y, z);
            let normal = point.normalize();
            // Uniform noise of the standard deviation sigma.
            let noise = sigma * 3.0_f64.sqrt() * random.random_range(-1.0..1.0);
            let rate = normal.dot(&truth.velocity(&point)) + noise;
            // Measurements of one block may share their noise; here each stands alone.
            Row::from_constraint(&LinearConstraint { point, normal, rate, sigma }, i)
        })
        .collect();

    let estimate = least_squares(&rows, Weighting::InverseVariance)?.estimate(&rows);
    for (i, name) in ["tX", "tY", "tZ", "ΩX", "ΩY", "ΩZ"].iter().enumerate() {
        if estimate.observed[i] {
            let (value, sigma) = (estimate.theta.mean[i], estimate.theta.sigma(i));
            println!("{name} {value:7.4} ± {sigma:.4}, true {:7.4}", truth.vector()[i]);
            assert!((value - truth.vector()[i]).abs() < 5.0 * sigma);
        } else {
            println!("{name} cannot be determined from these equations");
        }
    }
    // Turning about the radar changes no distance: the estimator says so instead of answering.
    assert_eq!(estimate.observed, [true, true, true, false, false, false]);
    Ok(())
}
